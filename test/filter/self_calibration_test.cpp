#include <gtest/gtest.h>

#include <cmath>

#include "filter/example_filter.h"
#include "filter/monte_carlo.h"

namespace active_matching_slam {
namespace {

/// A hand that sways slowly and shakes its camera at up to 2 Hz and 1.5 rad/s.
class ShakingHand {
 public:
  explicit ShakingHand(Random& random) {
    for (int axis = 0; axis < 6; ++axis) {
      for (int i = 0; i < 2; ++i) {
        const double hz = i == 0 ? random.uniform(0.1, 0.3) : random.uniform(1.0, 2.0);
        const double amplitude = i == 0 ? random.uniform(0.1, 0.2) : random.uniform(0.02, 0.06);
        waves_[axis][i] = {amplitude, 2.0 * M_PI * hz, random.uniform(0.0, 2.0 * M_PI)};
      }
    }
  }

  Eigen::Isometry3d poseAt(double time_s) const {
    Eigen::Matrix<double, 6, 1> sway = Eigen::Matrix<double, 6, 1>::Zero();
    for (int axis = 0; axis < 6; ++axis)
      for (const Eigen::Vector3d& w : waves_[axis])
        sway[axis] += w[0] * std::sin(w[1] * time_s + w[2]);
    Eigen::Isometry3d pose(rotationFromVector(sway.tail<3>()));
    pose.pretranslate(Eigen::Vector3d(sway.head<3>()));
    return pose;
  }

  CameraState stateAt(double time_s) const {
    const double h = 1e-4;
    const Eigen::Isometry3d before = poseAt(time_s - h), pose = poseAt(time_s),
                            after = poseAt(time_s + h);
    CameraState camera;
    camera.position_world = pose.translation();
    camera.q_world_camera = pose.linear();
    camera.velocity_world = (after.translation() - before.translation()) / (2.0 * h);
    camera.angular_velocity_camera =
        vectorFromRotation(Eigen::Quaterniond(before.linear().transpose() * after.linear())) /
        (2.0 * h);
    return camera;
  }

 private:
  Eigen::Vector3d waves_[6][2];  ///< amplitude, angular frequency, phase
};

/// Where a point is seen by a camera whose rows are exposed one after the other along the whole
/// motion, not along its tangent as the filter has it.
std::optional<Eigen::Vector2d> seenByRow(const ShakingHand& hand, double time_s,
                                         const CameraModel& lens, double readout_s,
                                         const Eigen::Vector3d& point_world) {
  double v = 0.5 * lens.height();
  std::optional<Eigen::Vector2d> pixel;
  for (int i = 0; i < 10; ++i) {
    const double row_s = time_s + readout_s * (v / lens.height() - 0.5);
    pixel = lens.project(hand.poseAt(row_s).inverse() * point_world);
    if (!pixel) return std::nullopt;
    v = pixel->y();
  }
  return lens.isInImage(*pixel) ? pixel : std::nullopt;
}

/// What a filter that begins with the calibration as given makes of the camera's true one in 10 s.
Ekf learn(const CameraState& truth, unsigned seed) {
  const double sigma_px = 0.3, sigma_point_m = 1e-3;
  Random random(seed);
  const CameraModel calibrated(exampleCalibration());
  const CameraModel lens = calibrated.corrected(truth.lens);
  const ShakingHand hand(random);
  FilterOptions options;
  options.sigma_px = sigma_px;
  options.initial_sigma_focal = options.initial_sigma_radial = 0.01;
  options.initial_sigma_centre = 0.007;
  options.sigma_acceleration_mps2 = 6.0;
  options.sigma_angular_acceleration_rps2 = 10.0;
  Ekf filter(options);
  filter.reset(hand.stateAt(0.0), 1e-4 * Eigen::Matrix<double, 12, 12>::Identity());
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 40; ++i) {
    const double depth = random.uniform(1.0, 3.0);
    points.push_back(depth * *calibrated.unproject(random.pixel()));
    filter.addPointFeature(points.back() + random.vector(sigma_point_m),
                           std::pow(sigma_point_m, 2) * Eigen::Matrix3d::Identity());
  }
  const double interval_s = 1.0 / 30.0;
  for (int frame = 1; frame <= 300; ++frame) {
    filter.predict(interval_s);
    std::vector<FeatureMeasurement> measurements;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto pixel = seenByRow(hand, frame * interval_s, lens, truth.readout_s, points[i]);
      const double du = random.normal(sigma_px), dv = random.normal(sigma_px);
      if (pixel)
        measurements.push_back({static_cast<FeatureId>(i), *pixel + Eigen::Vector2d(du, dv), 0.0});
    }
    EXPECT_TRUE(filter.update(calibrated, measurements).healthy) << frame;
  }
  return filter;
}

TEST(SelfCalibration, FindsReadoutAndLens) {
  for (int seed = 0; seed < 6; ++seed) {
    CameraState truth;
    truth.readout_s = seed % 2 == 0 ? 0.025 : -0.025;  // from above and from below
    truth.lens = {0.005, 0.0, {0.0035, -0.0035}};
    const Ekf filter = learn(truth, 100 + seed);
    const CalibrationVector error = calibrationOf(filter.camera()) - calibrationOf(truth);
    // The filter's velocity is that of the last interval, half of it late: of a shaking camera the
    // readout comes out some per cent too small, and the rest can not be as good as it is said to
    // be.
    EXPECT_LT(std::abs(error[0]), 2e-3) << seed;
    EXPECT_LT(std::abs(error[1]), 2e-3) << seed;
    EXPECT_LT(std::abs(error[2]), 1e-3) << seed;
    EXPECT_LT(error.tail<2>().norm(), 0.007) << seed;
  }
}

}  // namespace
}  // namespace active_matching_slam
