// How the errors of image points hang together from one keyframe of an initialisation to the next:
// of matches on rendered films, whose truth is known.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "accuracy/long_runs.h"
#include "active_matching_slam/initialisation/keyframes.h"
#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {
namespace {

/// Where a ray from `centre` meets the scene.
std::optional<Eigen::Vector3d> firstHit(const Scene& scene, const Eigen::Vector3d& centre,
                                        const Eigen::Vector3d& ray) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Surface& surface : scene.surfaces) {
    const double towards = surface.normal().dot(ray);
    if (!(towards < 0.0)) continue;
    const double along = surface.normal().dot(surface.origin - centre) / towards;
    const Eigen::Vector3d at = centre + along * ray - surface.origin;
    const double u = at.dot(surface.u_axis), v = at.dot(surface.v_axis);
    if (along > 0.0 && along < nearest && u >= 0.0 && u <= surface.width_m && v >= 0.0 &&
        v <= surface.height_m)
      nearest = along;
  }
  if (!std::isfinite(nearest)) return std::nullopt;
  return centre + nearest * ray;
}

/// Errors of one feature in the keyframes that show it after the first, both axes of each, and
/// their derivatives by what an adjustment estimates for it: its pixel and its inverse depth.
struct FeatureErrors {
  std::vector<int> keyframes;
  Eigen::VectorXd errors_px;
  Eigen::MatrixX3d by_feature;
};

/// The keyframes of an initialisation: matches of features that the first image shows.
struct Beginning {
  Keyframes keyframes{InitialiserOptions()};
  std::map<FeatureId, Eigen::Vector3d> rays;          ///< in the first camera
  std::map<std::int64_t, Eigen::Isometry3d> T_world;  ///< true pose of each image's camera
};

Beginning trackBeginning(Simulator* simulator) {
  const CameraModel& camera = simulator->camera();
  Tracker tracker(camera, TrackerOptions());
  Beginning result;
  while (const auto image = simulator->next()) {
    const auto frame = tracker.track(image->image, image->stamp_s);
    KeyframeMeasurements measured{frame->index, frame->stamp_s, {}};
    for (const TrackedFeature& feature : frame->features) {
      if (frame->index == 0) {
        result.rays[feature.id] = feature.bearing_world.normalized();
        if (const auto pixel = camera.project(feature.bearing_world))
          measured.measurements.push_back({feature.id, *pixel, 0.0});
      } else if (feature.status == FeatureStatus::kMatched && result.rays.count(feature.id)) {
        measured.measurements.push_back({feature.id, feature.matched_px, 0.0});
      }
    }
    result.T_world[frame->index] = image->truth.T_world_camera;
    if (frame->index == 0) {
      result.keyframes.begin(measured);
      continue;
    }
    result.keyframes.add(camera, measured, image->truth.T_world_camera);
    const auto parallax = result.keyframes.parallax(camera);  // none of too few keyframes
    if (parallax && *parallax * 180.0 / M_PI >= InitialiserOptions().last_parallax_deg) break;
  }
  return result;
}

/// Of the feature at `point`, which the first image shows along `ray_world` at that depth.
FeatureErrors errorsOf(const CameraModel& camera, const Beginning& beginning, FeatureId id,
                       const Eigen::Vector3d& point, const Eigen::Vector3d& ray_world,
                       double depth) {
  Eigen::Matrix3d axes;  // pixel and depth, all as if moved by the depth
  axes << ray_world.unitOrthogonal(), ray_world.cross(ray_world.unitOrthogonal()), ray_world;
  FeatureErrors feature;
  const auto& keyframes = beginning.keyframes.all();
  feature.errors_px.resize(2 * keyframes.size());
  feature.by_feature.resize(2 * keyframes.size(), 3);
  Eigen::Index rows = 0;
  for (std::size_t k = 1; k < keyframes.size(); ++k) {
    const FeatureMeasurement* seen = keyframes[k].find(id);
    const Eigen::Isometry3d T_camera_world = beginning.T_world.at(keyframes[k].image).inverse();
    Eigen::Matrix<double, 2, 3> d_point;
    const auto truth = seen ? camera.project(T_camera_world * point, &d_point) : std::nullopt;
    if (!truth) continue;
    feature.keyframes.push_back(static_cast<int>(k));
    feature.errors_px.segment<2>(rows) = seen->pixel - *truth;
    feature.by_feature.middleRows<2>(rows) = d_point * T_camera_world.linear() * axes * depth;
    rows += 2;
  }
  feature.errors_px.conservativeResize(rows);
  feature.by_feature.conservativeResize(rows, 3);
  return feature;
}

std::vector<FeatureErrors> errorsOf(const SimulatorOptions& simulation) {
  Simulator simulator(simulation);
  const Beginning beginning = trackBeginning(&simulator);
  const Eigen::Isometry3d first = beginning.T_world.begin()->second;
  std::vector<FeatureErrors> result;
  for (const auto& [id, ray] : beginning.rays) {
    const Eigen::Vector3d ray_world = first.linear() * ray;
    const auto point = firstHit(simulator.scene(), first.translation(), ray_world);
    if (!point) continue;
    FeatureErrors feature = errorsOf(simulator.camera(), beginning, id, *point, ray_world,
                                     (*point - first.translation()).norm());
    if (static_cast<int>(feature.keyframes.size()) >= InitialiserOptions().minimum_sightings)
      result.push_back(std::move(feature));
  }
  return result;
}

/// Without features that are no points of the scene, as an adjustment drops them: corners where one
/// surface hides another. Those count that err at most three times as much as the median one.
void dropOutliers(std::vector<FeatureErrors>* features) {
  std::vector<double> sizes;
  const auto size = [](const FeatureErrors& f) {
    return f.errors_px.norm() / std::sqrt(static_cast<double>(f.errors_px.size()));
  };
  for (const FeatureErrors& f : *features) sizes.push_back(size(f));
  const double most = 3.0 * medianOf(sizes);
  features->erase(std::remove_if(features->begin(), features->end(),
                                 [&](const FeatureErrors& f) { return size(f) > most; }),
                  features->end());
}

/// Takes off what an adjustment explains by the feature's pixel and depth.
Eigen::MatrixXd residualMaker(const Eigen::MatrixX3d& by_feature) {
  const Eigen::MatrixXd A = by_feature;
  return Eigen::MatrixXd::Identity(A.rows(), A.rows()) -
         A * A.completeOrthogonalDecomposition().pseudoInverse();
}

/// Ones where two errors are of one axis and `lag` keyframes apart.
Eigen::MatrixXd lagMatrix(const FeatureErrors& f, int lag) {
  const auto n = static_cast<Eigen::Index>(f.keyframes.size());
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b < n; ++b)
      if (f.keyframes[b] - f.keyframes[a] == lag)
        L.block<2, 2>(2 * a, 2 * b) = Eigen::Matrix2d::Identity();
  return L;
}

Eigen::MatrixXd autoregressive(const FeatureErrors& f, double phi) {
  const auto n = static_cast<Eigen::Index>(f.keyframes.size());
  Eigen::MatrixXd S = Eigen::MatrixXd::Zero(2 * n, 2 * n);
  for (Eigen::Index a = 0; a < n; ++a)
    for (Eigen::Index b = 0; b < n; ++b)
      S.block<2, 2>(2 * a, 2 * b) =
          std::pow(phi, std::abs(f.keyframes[a] - f.keyframes[b])) * Eigen::Matrix2d::Identity();
  return S;
}

struct Pool {
  std::vector<FeatureErrors> features;
  std::vector<Eigen::MatrixXd> makers;

  void add(const std::vector<FeatureErrors>& more) {
    for (const FeatureErrors& f : more) {
      features.push_back(f);
      makers.push_back(residualMaker(f.by_feature));
    }
  }
  /// Autocorrelation of the residuals.
  double measured(int lag) const {
    double products = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < features.size(); ++i) {
      Eigen::VectorXd r = makers[i] * features[i].errors_px;
      const auto n = static_cast<double>(r.size());
      const double variance = r.squaredNorm() / std::max(n - 3.0, 1.0);
      if (!(variance > 0.0)) continue;
      products += r.dot(lagMatrix(features[i], lag) * r) / variance;
      squares += r.dot(lagMatrix(features[i], 0) * r) / variance *
                 lagMatrix(features[i], lag).sum() / lagMatrix(features[i], 0).sum();
    }
    return products / squares;
  }
  /// Autocorrelation of the errors as they are.
  double raw(int lag) const {
    double products = 0.0, squares = 0.0;
    for (const FeatureErrors& f : features) {
      const Eigen::VectorXd& r = f.errors_px;
      const double variance = r.squaredNorm() / static_cast<double>(r.size());
      products += r.dot(lagMatrix(f, lag) * r) / variance;
      squares += r.squaredNorm() / variance * lagMatrix(f, lag).sum() / lagMatrix(f, 0).sum();
    }
    return products / squares;
  }
  /// What measured() would be of a first-order autoregression.
  double expected(double phi, int lag) const {
    double products = 0.0, squares = 0.0;
    for (std::size_t i = 0; i < features.size(); ++i) {
      const Eigen::MatrixXd C = makers[i] * autoregressive(features[i], phi) * makers[i];
      const double variance = C.trace() / std::max(static_cast<double>(C.rows()) - 3.0, 1.0);
      if (!(variance > 1e-12)) continue;
      products += (lagMatrix(features[i], lag) * C).trace() / variance;
      squares += C.trace() / variance * lagMatrix(features[i], lag).sum() /
                 lagMatrix(features[i], 0).sum();
    }
    return products / squares;
  }
  /// The autoregression whose residuals would have the autocorrelation measured.
  double phi() const {
    const double wanted = measured(1);
    double low = -0.9, high = 0.99;
    for (int i = 0; i < 20; ++i) {
      const double middle = 0.5 * (low + high);
      (expected(middle, 1) < wanted ? low : high) = middle;
    }
    return 0.5 * (low + high);
  }
};

class LongKeyframeErrors : public test::LongRuns {};

double inflation(double autocorrelation) {
  return (1.0 + autocorrelation) / (1.0 - autocorrelation);
}

// What lasts for all of an initialisation is for the most part that of the feature's pixel and
// depth, which are adjusted. So the variance inflation is less than that of the errors as they are,
// and not less than that of what these leave.
TEST_F(LongKeyframeErrors, PersistAsTheInitialiserTakesThem) {
  Pool all;
  for (const auto& [width, height] : {std::pair<int, int>{320, 240}, {640, 480}, {1024, 768}})
    for (const char* motion : {"slow", "jerky"}) {
      Pool pool;
      for (std::uint64_t seed = 1; seed <= (width > 640 ? 3u : 5u); ++seed) {
        SimulatorOptions simulation;
        simulation.motion = motion;
        simulation.seed = seed;
        simulation.width = width;
        simulation.height = height;
        simulation.duration_s = 4.0;
        std::vector<FeatureErrors> features = errorsOf(simulation);
        dropOutliers(&features);
        pool.add(features);
      }
      std::printf("%d %s: autocorrelation %.2f, beside what is adjusted %.2f\n", width, motion,
                  pool.raw(1), pool.phi());
      std::fflush(stdout);
      all.add(pool.features);
    }
  const double most = inflation(all.raw(1)), least = inflation(all.phi());
  std::printf("inflation of the variance %.2f to %.2f\n", least, most);
  EXPECT_GT(InitialiserOptions().correlation_inflation, least);
  EXPECT_LT(InitialiserOptions().correlation_inflation, most);
}

}  // namespace
}  // namespace active_matching_slam
