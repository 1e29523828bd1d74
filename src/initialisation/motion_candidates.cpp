#include "motion_candidates.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace active_matching_slam {
namespace {

/// Cost: directions over the hemisphere, 13 degrees apart, of which a minimum is lower than all
/// within 25 degrees; minima that become candidates; iterations of the weights.
constexpr int kDirections = 120, kIterations = 4;
constexpr double kNeighbourCosine = 0.9;
constexpr std::size_t kMinima = 3;
/// Sine of the angle to the translation below which an image point has no parallax to speak of.
/// Derivation: its parallax is this fraction of that of a point abeam, at most.
constexpr double kMinimumSine = 0.05;
/// Depths to start an adjustment from are within this factor of the mean. Cost: of iterations.
constexpr double kDepthRatio = 3.0;
/// Cosine between the translations of two candidates that are one: 18 degrees. Derivation: less
/// than between a lattice's neighbours that may both be minima.
constexpr double kSameCosine = 0.95;

/// Rays of a feature from the first camera and the last, unit, in the first camera's frame.
struct RayPair {
  int feature = 0;
  Eigen::Vector3d first, last;
  double information = 1.0;  ///< per squared radian, in that of the loss's scale
};

std::vector<RayPair> rayPairs(const CameraModel& model, const BundleOptions& options,
                              const Bundle& rotation_only) {
  const Eigen::Matrix3d R = rotation_only.cameras.back().q_world_camera.toRotationMatrix();
  const double scale = model.calibration().fx / (options.loss_scale_sigmas * options.sigma_px);
  std::vector<RayPair> pairs;
  for (const BundleObservation& o : rotation_only.observations.back())
    if (const auto ray = model.unproject(o.pixel))
      pairs.push_back({o.feature, rotation_only.features[o.feature].bearing_world,
                       R * ray->normalized(), std::pow(scale / o.relative_sigma, 2)});
  return pairs;
}

/// A direction of translation, with the small rotation [rad] that goes best with it.
struct Translation {
  Eigen::Vector3d direction, rotation;
  double cost = 0.0;  ///< Cauchy's, of the epipolar errors
};

/// t . (f x (q + w x q)) = 0 is linear in the rotation w. Over |f x t| it is an angle.
Translation translationAlong(const Eigen::Vector3d& t, const std::vector<RayPair>& pairs) {
  Translation translation{t, Eigen::Vector3d::Zero()};
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix3d left = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    translation.cost = 0.0;
    for (const RayPair& pair : pairs) {
      const double squared_sine = pair.first.cross(t).squaredNorm();
      if (squared_sine < kMinimumSine * kMinimumSine) continue;
      const double weight = pair.information / squared_sine;
      const double error = t.dot(pair.first.cross(pair.last));
      const Eigen::Vector3d d_rotation =
          pair.first.dot(pair.last) * t - t.dot(pair.last) * pair.first;
      const double squared = weight * std::pow(error + d_rotation.dot(translation.rotation), 2);
      translation.cost += std::log1p(squared);
      const double robust = weight / (1.0 + squared);
      left += robust * d_rotation * d_rotation.transpose();
      right -= robust * error * d_rotation;
    }
    translation.rotation = left.ldlt().solve(right);
  }
  return translation;
}

/// The lowest minima over the hemisphere; a translation and its opposite cost the same. Directions
/// are spread evenly (Fibonacci lattice).
std::vector<Translation> lowestMinima(const std::vector<RayPair>& pairs) {
  const double golden_angle = M_PI * (3.0 - std::sqrt(5.0));
  std::vector<Translation> all, minima;
  for (int n = 0; n < kDirections; ++n) {
    const double z = (n + 0.5) / kDirections, radius = std::sqrt(1.0 - z * z);
    all.push_back(translationAlong(
        {radius * std::cos(n * golden_angle), radius * std::sin(n * golden_angle), z}, pairs));
  }
  for (const Translation& translation : all)
    if (std::none_of(all.begin(), all.end(), [&translation](const Translation& other) {
          return other.cost < translation.cost &&
                 std::abs(other.direction.dot(translation.direction)) > kNeighbourCosine;
        }))
      minima.push_back(translation);
  std::sort(minima.begin(), minima.end(),
            [](const Translation& a, const Translation& b) { return a.cost < b.cost; });
  if (minima.size() > kMinima) minima.resize(kMinima);
  return minima;
}

/// Forwards or backwards, baseline and depths by how far the points went along their epipolar
/// lines; the cameras between on a line.
Bundle candidateOf(const Translation& translation, const CameraModel& model,
                   const BundleOptions& options, const std::vector<RayPair>& pairs, Bundle bundle) {
  struct Depth {
    int feature;
    double times_baseline;  ///< inverse depth times the baseline
  };
  std::vector<Depth> depths;
  double along = 0.0, expected = 0.0;
  for (const RayPair& pair : pairs) {
    // The last ray is first - inverse depth * translation, rotated back.
    const Eigen::Vector3d last = pair.last + translation.rotation.cross(pair.last);
    const Eigen::Vector3d epipolar =
        translation.direction - pair.first * pair.first.dot(translation.direction);
    const double sine = epipolar.norm();
    if (sine < kMinimumSine) continue;
    const double moved = epipolar.dot(pair.first - last) / sine;
    depths.push_back({pair.feature, moved / sine});
    along += sine * moved;
    expected += sine * sine;
  }
  if (along == 0.0) return bundle;
  const double mean = along / expected;
  for (const Depth& depth : depths)
    bundle.features[depth.feature].inverse_depth =
        options.inverse_depth *
        std::clamp(depth.times_baseline / mean, 1.0 / kDepthRatio, kDepthRatio);
  const std::size_t last = bundle.cameras.size() - 1;
  for (std::size_t k = 1; k <= last; ++k) {
    bundle.cameras[k].position_world = static_cast<double>(k) / static_cast<double>(last) * mean /
                                       options.inverse_depth * translation.direction;
    alignRotation(model, static_cast<int>(k), &bundle);
  }
  return bundle;
}

}  // namespace

std::vector<Bundle> motionCandidates(const CameraModel& model, const BundleOptions& options,
                                     const Bundle& rotation_only) {
  const std::vector<RayPair> pairs = rayPairs(model, options, rotation_only);
  std::vector<Bundle> candidates;
  for (const Translation& translation : lowestMinima(pairs)) {
    candidates.push_back(candidateOf(translation, model, options, pairs, rotation_only));
    candidates.push_back(candidates.back());
    makeBasReliefCounterpart(model, &candidates.back());
  }
  return candidates;
}

void makeBasReliefCounterpart(const CameraModel& model, Bundle* bundle) {
  // Of the mean, that a mirrored inverse depth keeps. Cost: of iterations from there.
  constexpr double kMinimumFraction = 0.1;
  double mean = 0.0;
  for (const FeatureState& feature : bundle->features) mean += feature.inverse_depth;
  mean /= static_cast<double>(std::max<std::size_t>(bundle->features.size(), 1));
  for (FeatureState& feature : bundle->features)
    feature.inverse_depth = std::max(2.0 * mean - feature.inverse_depth, kMinimumFraction * mean);
  for (std::size_t k = 1; k < bundle->cameras.size(); ++k) {
    bundle->cameras[k].position_world *= -1.0;
    alignRotation(model, static_cast<int>(k), bundle);
  }
}

bool isSameMotion(const Bundle& a, const Bundle& b) {
  const Eigen::Vector3d& x = a.cameras.back().position_world;
  const Eigen::Vector3d& y = b.cameras.back().position_world;
  return x.dot(y) > kSameCosine * x.norm() * y.norm();
}

}  // namespace active_matching_slam
