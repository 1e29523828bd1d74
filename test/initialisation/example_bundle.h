#pragma once

#include "active_matching_slam/initialisation/bundle_adjustment.h"
#include "filter/example_filter.h"

namespace active_matching_slam {

/// A camera that goes right and a little forward, turning left, past points at inverse depths from
/// 0.4 to 1.6, but for `fraction_far` of them, at 0.01: the true bundle, with what `sigma_px` of
/// noise leaves of its image points.
inline Bundle exampleBundle(const CameraModel& model, int cameras, int features, double step_m,
                            double sigma_px, unsigned seed, double fraction_far = 0.0) {
  Random random(seed);
  Bundle bundle;
  for (int k = 0; k < cameras; ++k) {
    CameraState camera;
    camera.position_world = k * step_m * Eigen::Vector3d(1.0, 0.1, 0.3);
    camera.q_world_camera = rotationFromVector(k * step_m * Eigen::Vector3d(0.05, -0.3, 0.1));
    bundle.cameras.push_back(camera);
    bundle.observations.emplace_back();
  }
  for (int i = 0; i < features; ++i) {
    FeatureState feature;
    feature.id = i;
    feature.anchored_at_origin = true;
    feature.bearing_world = model.unproject(random.pixel())->normalized();
    feature.tangent_world = feature.bearing_world.cross(Eigen::Vector3d::UnitY()).normalized();
    feature.inverse_depth = random.uniform(0.4, 1.6);
    if (i < fraction_far * features) feature.inverse_depth = 0.01;
    for (int k = 0; k < cameras; ++k) {
      const auto projection = projectFeature(model, bundle.cameras[k], feature);
      if (!projection || !model.isInImage(projection->pixel)) continue;
      const double du = random.normal(sigma_px), dv = random.normal(sigma_px);
      bundle.observations[k].push_back({i, projection->pixel + Eigen::Vector2d(du, dv)});
    }
    bundle.features.push_back(feature);
  }
  return bundle;
}

/// The same past a camera that goes straight forward, slightly unsteady: the epipole is in the
/// image.
inline Bundle forwardBundle(const CameraModel& model, int cameras, int features, double step_m,
                            double sigma_px, unsigned seed) {
  Bundle bundle = exampleBundle(model, cameras, features, 0.0, 0.0, seed);
  Random random(seed);
  for (int k = 0; k < cameras; ++k) {
    CameraState& camera = bundle.cameras[k];
    camera.position_world = k * step_m * Eigen::Vector3d::UnitZ();
    if (k > 0) camera.q_world_camera = rotationFromVector(Eigen::Vector3d(0.002, 0.001, 0.0) * k);
    bundle.observations[k].clear();
    for (int i = 0; i < features; ++i) {
      const auto projection = projectFeature(model, camera, bundle.features[i]);
      const double du = random.normal(sigma_px), dv = random.normal(sigma_px);
      if (projection && model.isInImage(projection->pixel))
        bundle.observations[k].push_back({i, projection->pixel + Eigen::Vector2d(du, dv)});
    }
  }
  return bundle;
}

/// Depths are what the images say.
inline BundleOptions weakPrior() {
  BundleOptions options;
  options.sigma_inverse_depth = 3.0;
  return options;
}

/// Directions of two moves as a cosine.
inline double cosineBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return a.normalized().dot(b.normalized());
}

}  // namespace active_matching_slam
