#pragma once

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <random>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {

inline CameraCalibration exampleCalibration() {
  CameraCalibration calibration;
  calibration.width = 640;
  calibration.height = 480;
  calibration.fx = 420.0;
  calibration.fy = 425.0;
  calibration.cx = 315.0;
  calibration.cy = 243.0;
  calibration.distortion_model = DistortionModel::kPlumbBob;
  calibration.distortion = {-0.2, 0.05, 1e-3, -5e-4, 0.0};
  return calibration;
}

/// Fixed for the tests, whatever suits live use.
inline FilterOptions exampleOptions() {
  FilterOptions options;
  options.initial_sigma_focal = options.initial_sigma_radial = 0.01;
  options.initial_sigma_centre = 0.007;
  options.sigma_acceleration_mps2 = 1.0;
  options.sigma_angular_acceleration_rps2 = 1.0;
  options.sigma_px = 1.0;
  options.landmark_noise_px = 0.0;
  options.initial_sigma_velocity_mps = 0.5;
  options.initial_sigma_angular_velocity_rps = 0.5;
  options.initial_inverse_depth = 0.5;
  options.initial_sigma_inverse_depth = 0.25;
  options.linearity_threshold = 0.1;
  options.update_iterations = 2;
  return options;
}

inline CalibrationVector calibrationOf(const CameraState& camera) {
  CalibrationVector numbers;
  numbers << camera.readout_s, camera.lens.focal, camera.lens.radial, camera.lens.centre;
  return numbers;
}

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double normal(double sigma = 1.0) { return sigma * std::normal_distribution<double>()(engine_); }
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  Eigen::Vector3d vector(double sigma) {
    const double x = normal(sigma), y = normal(sigma), z = normal(sigma);
    return Eigen::Vector3d(x, y, z);
  }
  Eigen::Vector2d pixel() {
    const double u = uniform(40.0, 600.0), v = uniform(40.0, 440.0);
    return Eigen::Vector2d(u, v);
  }

 private:
  std::mt19937 engine_;
};

inline CameraState exampleCamera(Random& random) {
  CameraState camera;
  camera.position_world = random.vector(0.5);
  camera.q_world_camera = rotationFromVector(random.vector(0.6));
  camera.velocity_world = random.vector(0.3);
  camera.angular_velocity_camera = random.vector(0.3);
  return camera;
}

/// Reads its rows one after the other and has another lens than its calibration says.
inline CameraState poorlyCalibratedCamera() {
  CameraState camera;
  camera.readout_s = 0.03;
  camera.lens = {0.01, -0.02, Eigen::Vector2d(0.005, -0.007)};
  return camera;
}

inline Eigen::Matrix<double, 12, 12> exampleCameraCovariance(Random& random) {
  Eigen::Matrix<double, 12, 12> A;
  for (int i = 0; i < A.size(); ++i) A.data()[i] = random.normal(0.02);
  return A * A.transpose() + 1e-5 * Eigen::Matrix<double, 12, 12>::Identity();
}

inline std::vector<FeatureId> idsOf(const Ekf& filter) {
  std::vector<FeatureId> ids;
  for (const FeatureState& feature : filter.features()) ids.push_back(feature.id);
  return ids;
}

/// Measurements of all features in the image at their predicted places, with noise.
inline std::vector<FeatureMeasurement> noisyMeasurements(const Ekf& filter,
                                                         const CameraModel& model, double sigma_px,
                                                         Random& random) {
  std::vector<FeatureMeasurement> measurements;
  const PredictedMeasurements predicted = filter.predictMeasurements(model, idsOf(filter));
  for (std::size_t i = 0; i < predicted.ids.size(); ++i) {
    if (!model.isInImage(predicted.z.segment<2>(2 * i))) continue;
    const double du = random.normal(sigma_px), dv = random.normal(sigma_px);
    measurements.push_back(
        {predicted.ids[i], predicted.z.segment<2>(2 * i) + Eigen::Vector2d(du, dv), 0.0});
  }
  return measurements;
}

/// The symmetric root of a covariance: draws by it depend on the covariance alone, those by its
/// eigenvectors on rounding where eigenvalues are equal.
inline Eigen::MatrixXd symmetricRoot(const Eigen::MatrixXd& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(covariance);
  return solver.eigenvectors() * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal() *
         solver.eigenvectors().transpose();
}

/// Lets an empty filter begin with features anchored at the origin, a little correlated.
inline void startFromOrigin(const CameraModel& model, int features, Random& random, Ekf* filter) {
  const int old_size = filter->stateSize(), size = old_size + 3 * features;
  std::vector<FeatureState> states(features);
  for (int i = 0; i < features; ++i) {
    FeatureState& state = states[i];
    state.id = i;
    state.anchored_at_origin = true;
    state.bearing_world = filter->camera().q_world_camera * *model.unproject(random.pixel());
    state.bearing_world.normalize();
    state.tangent_world = state.bearing_world.cross(Eigen::Vector3d::UnitY()).normalized();
    state.inverse_depth = random.uniform(0.4, 1.0);
  }
  Eigen::MatrixXd A(3 * features, 3 * features + 3);
  for (Eigen::Index i = 0; i < A.size(); ++i) A.data()[i] = random.normal(0.01);
  Eigen::MatrixXd P = Eigen::MatrixXd::Zero(size, size);
  P.topLeftCorner(old_size, old_size) = filter->covariance();
  P.bottomRightCorner(size - old_size, size - old_size) = A * A.transpose();
  filter->restore(filter->camera(), states, P, features);
}

/// A filter in mid-flight: features anchored at the origin, inverse-depth features of several ages
/// and known points, all correlated. Of `calibration` the readout and the lens are taken.
inline Ekf exampleFilter(const CameraModel& model, unsigned seed, int features = 6,
                         const CameraState& calibration = CameraState(),
                         const FilterOptions& options = exampleOptions()) {
  Random random(seed);
  Ekf filter(options);
  CameraState camera = exampleCamera(random);
  camera.readout_s = calibration.readout_s;
  camera.lens = calibration.lens;
  filter.reset(camera, exampleCameraCovariance(random));
  Random others(seed + 1000);
  startFromOrigin(model, 2, others, &filter);
  for (int step = 0; step < 4; ++step) {
    filter.predict(0.05);
    filter.update(model, noisyMeasurements(filter, model, 1.0, random));
    for (int i = 0; i < features; i += 2) {
      filter.addInverseDepthFeature(model, random.pixel(), random.uniform(0.2, 1.0), 0.1);
      if (step % 2 == 0) continue;
      const auto bearing = model.unproject(random.pixel());
      const double depth = random.uniform(1.0, 3.0);
      filter.addPointFeature(filter.camera().poseWorldCamera() * (depth * *bearing),
                             1e-4 * Eigen::Matrix3d::Identity());
    }
  }
  filter.predict(0.05);
  return filter;
}

/// The error state that leads from (camera, features) to the other mean, to first order.
inline Eigen::VectorXd errorBetween(const CameraState& camera,
                                    const std::vector<FeatureState>& features,
                                    const CameraState& other,
                                    const std::vector<FeatureState>& others, int size) {
  Eigen::VectorXd delta = Eigen::VectorXd::Zero(size);
  delta.segment<3>(CameraError::kPosition) = other.position_world - camera.position_world;
  delta.segment<3>(CameraError::kRotation) =
      vectorFromRotation(other.q_world_camera * camera.q_world_camera.conjugate());
  delta.segment<3>(CameraError::kVelocity) = other.velocity_world - camera.velocity_world;
  delta.segment<3>(CameraError::kAngularVelocity) =
      other.angular_velocity_camera - camera.angular_velocity_camera;
  delta[CameraError::kReadout] = other.readout_s - camera.readout_s;
  delta[CameraError::kFocal] = other.lens.focal - camera.lens.focal;
  delta[CameraError::kRadial] = other.lens.radial - camera.lens.radial;
  delta.segment<2>(CameraError::kCentre) = other.lens.centre - camera.lens.centre;
  for (std::size_t i = 0; i < features.size(); ++i) {
    const FeatureState &a = features[i], &b = others[i];
    if (a.kind == FeatureKind::kPoint) {
      delta.segment<3>(a.offset) = b.point_world - a.point_world;
    } else {
      if (a.hasAnchorError()) delta.segment<3>(a.offset) = b.anchor_world - a.anchor_world;
      delta.segment<2>(a.bearingRow()) =
          a.tangentBasis().transpose() * (b.bearing_world - a.bearing_world);
      delta[a.inverseDepthRow()] = b.inverse_depth - a.inverse_depth;
    }
  }
  return delta;
}

}  // namespace active_matching_slam
