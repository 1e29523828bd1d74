#include "adjusted_start.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

constexpr double kClearlyBetter = 0.35;  ///< of standard deviations

/// Relative standard deviation of the distance from the world's origin, median.
double depthSigma(const Ekf& filter, const std::vector<FeatureState>& features) {
  std::vector<double> sigmas;
  for (const FeatureState& feature : features) {
    const FeatureState& known = *filter.find(feature.id);
    sigmas.push_back(relativeLengthSigma(known.position(), filter.positionCovariance(known)));
  }
  return medianOf(std::move(sigmas));
}

/// The same of an adjusted start, all of whose features are anchored there.
double depthSigma(const AdjustedStart& start) {
  std::vector<double> sigmas;
  for (const FeatureState& feature : start.features) {
    const int row = feature.inverseDepthRow();
    sigmas.push_back(std::sqrt(std::max(start.covariance(row, row), 0.0)) / feature.inverse_depth);
  }
  return medianOf(std::move(sigmas));
}

}  // namespace

double relativeLengthSigma(const Eigen::Vector3d& way, const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(way.dot(covariance * way), 0.0)) / way.squaredNorm();
}

Eigen::Isometry3d AdjustedStart::corrected(std::int64_t image,
                                           const Eigen::Isometry3d& T_world_camera) const {
  const auto nearest =
      std::min_element(moves.begin(), moves.end(), [image](const Move& a, const Move& b) {
        return std::abs(a.image - image) < std::abs(b.image - image);
      });
  if (nearest == moves.end()) return T_world_camera;
  return nearest->T_world_camera_after * nearest->T_world_camera_before.inverse() * T_world_camera;
}

std::optional<AdjustedStart> makeAdjustedStart(const CameraModel& model, const Ekf& filter,
                                               const BundleOptions& options, const Bundle& bundle,
                                               const std::vector<FeatureId>& ids,
                                               const Eigen::VectorXd& unit_shares,
                                               double unit_sigma, double interval_s) {
  const int last = static_cast<int>(bundle.cameras.size()) - 1;
  const double dt = interval_s;
  BundleOptions doubting_lens = options;
  doubting_lens.sigma_calibration = calibrationSigmas(filter.options());
  const Eigen::MatrixXd joint =
      bundleCovariance(model, doubting_lens, bundle, last - 1, unit_shares, unit_sigma);
  if (joint.size() == 0 || !joint.allFinite() || !(dt > 0.0)) return std::nullopt;

  AdjustedStart start;
  start.camera = bundle.cameras[last];
  const CameraState& before = bundle.cameras[last - 1];
  start.camera.velocity_world = (start.camera.position_world - before.position_world) / dt;
  start.camera.angular_velocity_camera =
      vectorFromRotation(before.q_world_camera.conjugate() * start.camera.q_world_camera) / dt;

  start.camera.readout_s = bundle.calibration[0];
  start.camera.lens = {bundle.calibration[1], bundle.calibration[2], bundle.calibration.tail<2>()};

  // The camera's error by those of the cameras before last and last and of the calibration.
  constexpr int kBefore = 0, kLast = 6, kCalibration = 12,
                kJoint = kCalibration + CameraError::kCalibrationSize;
  using CameraJacobian = Eigen::Matrix<double, CameraError::kSize, kJoint>;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity();
  const Eigen::Matrix3d R_camera_world = start.camera.q_world_camera.toRotationMatrix().transpose();
  CameraJacobian J = CameraJacobian::Zero();
  J.block<3, 3>(CameraError::kPosition, kLast) = I;
  J.block<3, 3>(CameraError::kRotation, kLast + 3) = I;
  J.block<3, 3>(CameraError::kVelocity, kBefore) = -I / dt;
  J.block<3, 3>(CameraError::kVelocity, kLast) = I / dt;
  J.block<3, 3>(CameraError::kAngularVelocity, kBefore + 3) = -R_camera_world / dt;
  J.block<3, 3>(CameraError::kAngularVelocity, kLast + 3) = R_camera_world / dt;
  J.bottomRightCorner<CameraError::kCalibrationSize, CameraError::kCalibrationSize>().setIdentity();

  std::vector<int> kept;
  for (std::size_t i = 0; i < ids.size(); ++i)
    if (filter.find(ids[i]) != nullptr) kept.push_back(static_cast<int>(i));
  const int F = static_cast<int>(kept.size());
  start.covariance.resize(CameraError::kSize + 3 * F, CameraError::kSize + 3 * F);
  auto camera = start.covariance.topLeftCorner<CameraError::kSize, CameraError::kSize>();
  camera = J * joint.topLeftCorner<kJoint, kJoint>() * J.transpose();
  camera = 0.5 * (camera + camera.transpose()).eval();
  for (int i = 0; i < F; ++i) {
    FeatureState feature = bundle.features[kept[i]];
    feature.id = ids[kept[i]];
    feature.offset = CameraError::kSize + 3 * i;
    start.features.push_back(feature);
    const int from = kJoint + 3 * kept[i];
    auto columns = start.covariance.middleCols<3>(feature.offset);
    columns.topRows<CameraError::kSize>() = J * joint.block<kJoint, 3>(0, from);
    start.covariance.block<3, CameraError::kSize>(feature.offset, 0) =
        columns.topRows<CameraError::kSize>().transpose();
    for (int k = 0; k < F; ++k)
      columns.middleRows<3>(CameraError::kSize + 3 * k) =
          joint.block<3, 3>(kJoint + 3 * kept[k], from);
  }
  const FilterOptions& noise = filter.options();
  start.covariance.diagonal().segment<3>(CameraError::kVelocity).array() +=
      std::pow(noise.sigma_acceleration_mps2 * dt, 2);
  start.covariance.diagonal().segment<3>(CameraError::kAngularVelocity).array() +=
      std::pow(noise.sigma_angular_acceleration_rps2 * dt, 2);
  return start;
}

bool knowsMore(const Ekf& filter, const AdjustedStart& start) {
  return depthSigma(filter, start.features) < kClearlyBetter * depthSigma(start);
}

}  // namespace active_matching_slam
