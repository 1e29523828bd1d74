#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "feature_choice.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Fraction of its velocity that a camera keeps from one frame with too few matches to the next: a
/// hand that jerks does not go on for long.
constexpr double kVelocityDecay = 0.7;

/// 1/2 log2 |before| / |after| [bit]; 0 where one of them is singular.
double informationGained(const MotionCovariance& before, const MotionCovariance& after) {
  const std::optional<double> prior = entropyBits(before), posterior = entropyBits(after);
  return prior && posterior ? std::max(*prior - *posterior, 0.0) : 0.0;
}

}  // namespace

void Tracker::Implementation::predict(double interval_s) {
  if (poor_frames_ == 0) {
    T_world_reference_ = filter_.camera().poseWorldCamera();
  }
  if (motion_history_) {
    motion_ = motion_history_->between(state_stamp_s_ - interval_s, state_stamp_s_, &motion_fault_);
    unscaled_velocity_.reset();
    if (motion_ && !isMetric()) unscaled_velocity_.swap(motion_->velocity_start);
  }
  if (poor_frames_ > 0) {
    if (!isTranslationKnown()) filter_.decayVelocity(kVelocityDecay);
    motion_noise_.reset();
  }
  if (!motion_) interval_s = std::min(interval_s, options_.max_frame_interval_s);
  predicted_interval_s_ = interval_s;
  filter_.predict(interval_s, motion_noise_.expected());
  measureMotion();
  noise_.predict(camera_, interval_s, options_.mapping ? &filter_ : nullptr);
}

/// Features that should be seen in the part of the image that is used.
/// `behind_mask`: also those in the other part, ascending; null: not asked for.
std::vector<VisibleFeature> Tracker::Implementation::visibleFeatures(
    std::vector<FeatureId>* behind_mask) const {
  std::vector<VisibleFeature> visible =
      map_.visible(filter_, camera_, options_.map, options_.image.border_px);
  const auto is_masked = [&](const VisibleFeature& feature) {
    const bool is_behind = !mask_.isSearched(feature.view.pixel);
    if (is_behind && behind_mask) behind_mask->push_back(feature.id);
    return is_behind || submaps_.isUnsearched(feature.id);
  };
  visible.erase(std::remove_if(visible.begin(), visible.end(), is_masked), visible.end());
  return visible;
}

/// Features that should be seen and the templates to search them by.
void Tracker::Implementation::chooseCandidates(FrameState* current) const {
  current->visible = visibleFeatures(&current->behind_mask);
  FeatureChoice choice =
      chooseFeatures(filter_, camera_, map_, noise_, current->visible,
                     {options_.map.features_per_frame, options_.map.choose_by_information,
                      options_.matching.stop_bits});
  current->visible_bits = std::move(choice.bits_of_visible);
  current->visible_state_bits = std::move(choice.state_bits_of_visible);
  current->bits_left = choice.bits_left;
  const Eigen::Isometry3d T_world_camera = filter_.camera().poseWorldCamera();
  for (VisibleFeature& feature : choice.chosen) {
    const SourcePatch& patch = map_.find(feature.id)->patch;
    Template expected;
    if (!bendView(patch, camera_, T_world_camera, homogeneousPosition(*filter_.find(feature.id)),
                  &feature.view) ||
        !warpTemplate(patch, feature.view, options_.image.template_size_px, &expected) ||
        expected.contrast() < options_.image.minimum_contrast)
      continue;
    current->candidates.push_back(feature);
    current->templates.push_back(expected);
  }
}

/// Joint prediction of the candidates' image points. Leaves out those that do not project.
void Tracker::Implementation::predictMeasurements(FrameState* current) const {
  std::vector<FeatureId> ids;
  for (const VisibleFeature& feature : current->candidates) ids.push_back(feature.id);
  const double sigma_px = noise_.gateSigma_px(MapFeature());
  PredictedMeasurements predicted = filter_.predictMeasurements(camera_, ids, sigma_px);
  MeasurementPrior& prior = current->prior;
  prior.ids = std::move(predicted.ids);
  prior.z = std::move(predicted.z);
  prior.S = std::move(predicted.S);
  prior.noise_variance_px2 = sigma_px * sigma_px;
  for (int i = 0; i < prior.size(); ++i) {
    const double own_px = noise_.gateSigma_px(*map_.find(prior.ids[i]));
    prior.noise_variances_px2.push_back(own_px * own_px);
    prior.S.diagonal().segment<2>(2 * i).array() += own_px * own_px - sigma_px * sigma_px;
  }
  const auto impulse = motion_ ? filter_.impulse() : std::nullopt;
  const Eigen::Matrix<double, 6, 1> jerk =
      widestImpulse() -
      impulse.value_or(impulseVariance(motion_noise_.expected(), current->predicted_interval_s));
  current->jerk_px = predicted.impulse_px * jerk.cwiseMax(0.0).cwiseSqrt().asDiagonal();
  current->jerk_probability = motion_noise_.jerkProbability();
  if (impulse) {
    const Eigen::Matrix<double, 6, 1> unmeasured =
        impulseVariance(motion_noise_.widest(), current->predicted_interval_s) - *impulse;
    current->unmeasured_px =
        predicted.impulse_px * unmeasured.cwiseMax(0.0).cwiseSqrt().asDiagonal();
  }
  std::size_t kept = 0;
  for (std::size_t i = 0; i < ids.size() && kept < prior.ids.size(); ++i) {
    if (ids[i] != prior.ids[kept]) continue;
    current->candidates[kept] = current->candidates[i];
    current->templates[kept++] = current->templates[i];
  }
  current->candidates.resize(kept);
  current->templates.resize(kept);
}

/// Predicts what should be seen and prepares the search for it.
FrameState Tracker::Implementation::measure(const cv::Mat& image, double interval_s) const {
  FrameState current(options_.image);
  current.image = image;
  current.mask = mask_;
  current.interval_s = interval_s;
  current.predicted_interval_s = predicted_interval_s_;
  current.poor_frames = poor_frames_;
  current.depths_vague = initialiser_.areDepthsGuessed();
  current.reference_image = reference_image_;
  chooseCandidates(&current);
  predictMeasurements(&current);
  const Eigen::Isometry3d T_reference_world = T_world_reference_.inverse();
  for (std::size_t i = 0; i < current.prior.ids.size(); ++i) {
    const FeatureId id = current.prior.ids[i];
    const MapFeature& feature = *map_.find(id);
    current.sources.push_back({feature.patch, current.candidates[i].view});
    current.match_probabilities.push_back(submaps_.isOnTrial(id) ? 0.0 : feature.recent_rate);
    current.in_reference.push_back(feature.last_matched_frame == reference_index_);
    if (options_.learn_rates)
      current.prior.rates.push_back(feature.rates.rates({options_.matching.default_rates}));
    const Eigen::Vector4d point = homogeneousPosition(*filter_.find(id));
    current.reference_px.push_back(camera_.project(T_reference_world.linear() * point.head<3>() +
                                                   point.w() * T_reference_world.translation()));
  }
  current.search.beginFrame(image, current.templates, current.sources, mask_.templateCentres());
  return current;
}

/// Updates the filter by the matches, and learns from them.
void Tracker::Implementation::correct(FrameState* current, TrackedFrame* frame) {
  leaveOutTrial(current);
  current->measurements = selectMeasurements(*current);
  noise_.weigh([this](FeatureId id) { return initialiser_.isAdjusting(id); }, map_,
               &current->measurements);
  frame->match_sigma_px = noise_.typicalSigma_px();

  Accelerations allowed = motion_noise_.expected();
  if (current->is_jerk) {
    allowed = motion_noise_.widest();
    filter_.replaceImpulse(widestImpulse());
  }
  // While depths are guessed, residuals are due to these, not to noise: R is taken as known.
  const bool are_depths_guessed = initialiser_.areDepthsGuessed();
  const NoisePrior prior = are_depths_guessed ? NoisePrior() : noise_.prior();
  const MotionCovariance predicted = filter_.cameraCovariance();
  const UpdateReport report = filter_.update(camera_, current->measurements, prior, corrected());
  frame->camera_bits = informationGained(predicted, filter_.cameraCovariance());
  frame->nis = report.nis;
  frame->nis_degrees = 2 * report.used;

  motion_noise_.countImage(current->is_jerk);
  if (!are_depths_guessed) learnMotion(report, allowed, current->is_jerk);
  if (!are_depths_guessed) noise_.learn(report, current->measurements, &map_);
  if (options_.mapping) {
    learnSlopes(*current);
    map_.recordInformation(current->visible, current->visible_bits, current->behind_mask,
                           current->interval_s);
  }
  recordSearches(*current, frame->index);
  if (!are_depths_guessed && !frame->repeated_image) judgeQuality(*current);
}

/// Lets the image tell whether a submap that is on trial is where it was predicted, unless it tells
/// little of the rest either. Until it is, none of its features is an inlier.
void Tracker::Implementation::leaveOutTrial(FrameState* current) {
  if (!submaps_.hasTrial()) return;
  std::map<FeatureId, bool> on_trial;
  int others = 0, others_matched = 0;
  for (int i = 0; i < current->prior.size(); ++i) {
    if (!current->isLookedFor(i)) continue;
    const FeatureId id = current->prior.ids[i];
    const bool is_matched = std::binary_search(current->inliers.begin(), current->inliers.end(), i);
    if (submaps_.isOnTrial(id)) {
      on_trial[id] = is_matched;
    } else {
      ++others;
      others_matched += is_matched;
    }
  }
  if (2 * others_matched >= others) submaps_.judgeTrial(on_trial);
  const auto isLeftOut = [&](int i) { return submaps_.isOnTrial(current->prior.ids[i]); };
  current->inliers.erase(
      std::remove_if(current->inliers.begin(), current->inliers.end(), isLeftOut),
      current->inliers.end());
}

/// The accepted matches that pass the innovation gate, with the noise of their templates' fit.
std::vector<FeatureMeasurement> Tracker::Implementation::selectMeasurements(
    const FrameState& current) {
  std::vector<FeatureMeasurement> measurements;
  for (const int i : current.inliers) {
    const SearchMatch& match = current.search.matches(i)[current.matching.match_of_feature[i]];
    measurements.push_back(
        {current.prior.ids[i], match.pixel, match.sigma_px, 1.0, match.noise_shape});
  }
  return measurements;
}

/// The inclination of the features' surfaces, from how their matches differ from the templates.
void Tracker::Implementation::learnSlopes(const FrameState& current) {
  for (std::size_t k = 0; k < current.inliers.size(); ++k) {
    const int i = current.inliers[k];
    map_.learnSlope(current.candidates[i], current.templates[i], current.image,
                    current.measurements[k].pixel);
  }
}

/// Whether what was found fits the model.
void Tracker::Implementation::judgeQuality(const FrameState& current) {
  QualitySigns signs;
  signs.variance_factor = noise_.varianceFactor();
  signs.matched = static_cast<int>(current.inliers.size());
  for (int i = 0; i < current.prior.size(); ++i) {
    const bool is_found = !current.search.matches(i).empty();
    if (!current.isLookedFor(i) || submaps_.isOnTrial(current.prior.ids[i]) ||
        (!is_found && current.search.isPartlyMasked(i)))
      continue;
    ++signs.predicted;
    if (is_found) ++signs.rejected;
  }
  signs.rejected -= signs.matched;
  quality_.add(current.interval_s, signs, filter_.camera(), filter_.options());
}

/// The record of each feature that was searched. One that may be behind the mask has not failed.
void Tracker::Implementation::recordSearches(const FrameState& current, std::int64_t index) {
  std::vector<SearchRecord> records;
  std::size_t next = 0;
  for (int i = 0; i < current.prior.size(); ++i) {
    const bool used = next < current.inliers.size() && current.inliers[next] == i;
    const double pixels = current.search.clutterPixels(i);
    const Eigen::Vector2d innovation_px =
        used ? Eigen::Vector2d(current.measurements[next++].pixel - current.prior.mean(i))
             : Eigen::Vector2d::Zero();
    if (used || (pixels > 0.0 && !current.search.isPartlyMasked(i)))
      records.push_back({current.prior.ids[i], used,
                         static_cast<std::int64_t>(current.search.matches(i).size()),
                         std::llround(pixels), innovation_px});
  }
  map_.record(records, index);
}

}  // namespace active_matching_slam
