#include "active_matching_slam/initialisation/initialiser.h"

#include <cmath>
#include <cstdlib>
#include <utility>

#include "hypothesis_test.h"
#include "initial_state.h"

namespace active_matching_slam {

Eigen::Isometry3d InitialState::corrected(std::int64_t image,
                                          const Eigen::Isometry3d& T_world_camera) const {
  if (corrections.empty()) return T_world_camera;
  auto last = std::upper_bound(corrections.begin(), corrections.end(), image,
                               [](std::int64_t i, const Correction& c) { return i < c.image; });
  if (last != corrections.begin()) --last;
  return last->T_world_camera_after * last->T_world_camera_before.inverse() * T_world_camera;
}

Initialiser::Initialiser(const InitialiserOptions& options)
    : options_(options), keyframes_(options) {}

void Initialiser::begin(KeyframeMeasurements first) {
  *this = Initialiser(options_);
  state_ = InitialiserState::kCollecting;
  keyframes_.begin(std::move(first));
}

void Initialiser::add(const CameraModel& model, const KeyframeMeasurements& image,
                      const Ekf& filter, int looked_for) {
  if (isDone()) return;
  ++images_;
  const double shared = static_cast<double>(image.measurements.size());
  const double first = static_cast<double>(keyframes_.all().front().measurements.size());
  is_first_unrelated_ = images_ == 1 && looked_for > options_.unrelated_fraction * first &&
                        shared < options_.unrelated_fraction * looked_for;
  is_last_added_ = keyframes_.add(model, image, filter.camera().poseWorldCamera());
}

void Initialiser::addFirstSights(const std::vector<FeatureMeasurement>& measurements) {
  if (!isDone() && is_last_added_) keyframes_.addFirstSights(measurements);
}

void Initialiser::rescale(double factor) {
  keyframes_.rescale(factor);
  scale_.rescale(factor);
  if (accepted_) rescaleBundle(factor, &accepted_->bundle);
}

/// Whether parallax or the number of images has grown enough to be worth another test or
/// adjustment.
bool Initialiser::hasGrown(double parallax) {
  if (parallax < options_.growth * last_parallax_ && images_ < options_.growth * last_images_)
    return false;
  last_parallax_ = parallax;
  last_images_ = images_;
  return true;
}

BundleOptions Initialiser::bundleOptions(const FilterOptions& filter) const {
  BundleOptions options;
  options.sigma_px = filter.sigma_px;
  options.minimum_sigma_px = std::min(filter.minimum_sigma_px, filter.sigma_px);
  options.inverse_depth = filter.initial_inverse_depth;
  options.sigma_inverse_depth *= filter.initial_inverse_depth;
  options.minimum_inverse_depth = filter.minimum_inverse_depth;
  // So few images would bend the lens until depths fit their prior: it stays as calibrated.
  options.sigma_calibration[0] = filter.initial_sigma_readout_s;
  return options;
}

std::optional<InitialState> Initialiser::step(const CameraModel& model, const Ekf& filter) {
  if (isDone() || !is_last_added_ ||
      keyframes_.size() < static_cast<int>(options_.minimum_keyframes))
    return std::nullopt;
  if (state_ == InitialiserState::kRefining) return refine(model, filter);
  disambiguate(model, filter);
  return state_ == InitialiserState::kRefining ? refine(model, filter) : std::nullopt;
}

void Initialiser::disambiguate(const CameraModel& model, const Ekf& filter) {
  const BundleOptions options = bundleOptions(filter.options());
  keyframes_.dropUnseen();
  const auto parallax = keyframes_.parallax(model);
  if (!parallax) return;
  const double sigma = options.sigma_px / model.calibration().fx;
  state_ = *parallax < options_.first_parallax_sigmas * sigma ? InitialiserState::kCollecting
                                                              : InitialiserState::kDisambiguating;
  last_parallax_ = std::min(last_parallax_, *parallax);  // what showed more may be out of sight
  if (state_ == InitialiserState::kCollecting || !hasGrown(*parallax)) return;
  auto rotation_only = keyframes_.rotationOnly(model);
  if (!rotation_only) return;
  auto test = testMotions(model, options_, options, rotation_only->bundle);
  if (!test) return;
  accepted_ = std::move(rotation_only);
  accepted_->bundle = std::move(test->accepted);
  sigma_px_ = test->sigma_px;
  state_ = InitialiserState::kRefining;
  parallax_ = *parallax;
  adjusting_images_ = 1;
}

/// A few iterations an image, over all keyframes, until they converge.
std::optional<InitialState> Initialiser::refine(const CameraModel& model, const Ekf& filter) {
  if (adjusting_images_ == 0) {
    const auto parallax = keyframes_.parallax(model);
    if (!parallax) end();
    if (!parallax || !hasGrown(*parallax)) return std::nullopt;
    parallax_ = *parallax;
    adjusting_images_ = 1;
  }
  auto extended = keyframes_.extend(model, *accepted_);
  if (!extended) {
    end();
    return std::nullopt;
  }
  BundleOptions options = bundleOptions(filter.options());
  options.sigma_px = sigma_px_;
  options.max_iterations = std::max(2, options_.keyframe_iterations / keyframes_.size());
  const BundleFit fit = adjustBundle(model, options, &extended->bundle);
  if (!fit.converged && adjusting_images_ < options_.images_per_adjustment) {
    ++adjusting_images_;
    accepted_ = std::move(extended);
    return std::nullopt;
  }
  adjusting_images_ = 0;
  estimateImageVariances(model, &extended->bundle);
  adjustBundle(model, options, &extended->bundle);
  return commit(model, filter, options, *std::move(extended));
}

std::optional<InitialState> Initialiser::commit(const CameraModel& model, const Ekf& filter,
                                                const BundleOptions& options,
                                                MotionHypothesis adjusted) {
  BundleOptions by_noise = options;
  by_noise.sigma_px = std::max(estimateSigma(model, adjusted.bundle), options.minimum_sigma_px);
  dropOutliers(model, by_noise, &adjusted);
  const Eigen::VectorXd scale_weights =
      scale_.apply(filter, depthInformation(model, by_noise, adjusted.bundle), &adjusted);
  const auto& keyframes = keyframes_.all();
  const double interval_s = keyframes.back().stamp_s - keyframes[keyframes.size() - 2].stamp_s;
  auto state = makeInitialState(
      model, filter, by_noise, options_.correlation_inflation, adjusted, scale_weights,
      expected_.value_or(Accelerations{filter.options().sigma_acceleration_mps2,
                                       filter.options().sigma_angular_acceleration_rps2}),
      interval_s);
  if (!state) return std::nullopt;
  state->is_first = committed_.empty();
  for (std::size_t k = 0; k < keyframes.size(); ++k) {
    Eigen::Isometry3d& T_world_camera = keyframes_.all()[k].T_world_camera;
    const Eigen::Isometry3d before = T_world_camera;
    T_world_camera = adjusted.bundle.cameras[k].poseWorldCamera();
    state->corrections.push_back({keyframes[k].image, before, T_world_camera});
  }
  sigma_px_ = by_noise.sigma_px;
  committed_ = adjusted.ids;
  accepted_ = std::move(adjusted);
  if (parallax_ >= options_.last_parallax_deg * M_PI / 180.0) end();
  return state;
}

}  // namespace active_matching_slam
