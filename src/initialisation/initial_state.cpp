#include "initial_state.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

/// Rows of the two cameras and of the calibration in bundleCovariance().
constexpr int kBefore = 0, kLast = 6, kCalibration = 12,
              kFirstFeature = kCalibration + CameraError::kCalibrationSize;
using CameraJacobian = Eigen::Matrix<double, CameraError::kSize, kFirstFeature>;

CameraState lastCamera(const Bundle& bundle, double interval_s) {
  CameraState camera = bundle.cameras.back();
  const CameraState& before = bundle.cameras[bundle.cameras.size() - 2];
  camera.velocity_world = (camera.position_world - before.position_world) / interval_s;
  camera.angular_velocity_camera =
      vectorFromRotation(before.q_world_camera.conjugate() * camera.q_world_camera) / interval_s;
  camera.readout_s = bundle.calibration[0];
  camera.lens = {bundle.calibration[1], bundle.calibration[2], bundle.calibration.tail<2>()};
  return camera;
}

/// Derivative of lastCamera()'s error by those of the two cameras and of the calibration.
CameraJacobian lastCameraJacobian(const CameraState& camera, double interval_s) {
  const Eigen::Matrix3d by_interval = Eigen::Matrix3d::Identity() / interval_s;
  const Eigen::Matrix3d R_camera_world = camera.q_world_camera.toRotationMatrix().transpose();
  CameraJacobian J = CameraJacobian::Zero();
  J.block<3, 3>(CameraError::kPosition, kLast).setIdentity();
  J.block<3, 3>(CameraError::kRotation, kLast + 3).setIdentity();
  J.block<3, 3>(CameraError::kVelocity, kBefore) = -by_interval;
  J.block<3, 3>(CameraError::kVelocity, kLast) = by_interval;
  J.block<3, 3>(CameraError::kAngularVelocity, kBefore + 3) = -R_camera_world * by_interval;
  J.block<3, 3>(CameraError::kAngularVelocity, kLast + 3) = R_camera_world * by_interval;
  J.bottomRightCorner<CameraError::kCalibrationSize, CameraError::kCalibrationSize>().setIdentity();
  return J;
}

}  // namespace

std::optional<InitialState> makeInitialState(
    const CameraModel& model, const Ekf& filter, const BundleOptions& options,
    double correlation_inflation, const MotionHypothesis& hypothesis,
    const Eigen::VectorXd& scale_weights, const Accelerations& accelerations, double interval_s) {
  const Bundle& bundle = hypothesis.bundle;
  BundleOptions with_lens = options;
  with_lens.sigma_calibration = calibrationSigmas(filter.options());
  const int before_last = static_cast<int>(bundle.cameras.size()) - 2;
  if (before_last < 1 || !(interval_s > 0.0)) return std::nullopt;
  const Eigen::MatrixXd joint =
      bundleCovariance(model, with_lens, bundle, before_last, correlation_inflation, scale_weights,
                       Ekf::kFreeScaleSigma);
  if (joint.size() == 0 || !joint.allFinite()) return std::nullopt;

  InitialState state;
  state.camera = lastCamera(bundle, interval_s);
  std::vector<int> kept;
  for (std::size_t i = 0; i < hypothesis.ids.size(); ++i)
    if (filter.find(hypothesis.ids[i]) != nullptr) kept.push_back(static_cast<int>(i));
  const int F = static_cast<int>(kept.size());
  const CameraJacobian J = lastCameraJacobian(state.camera, interval_s);
  const int size = CameraError::kSize + 3 * F;
  Eigen::MatrixXd rows(size, joint.cols());
  rows.topRows<CameraError::kSize>() = J * joint.topRows<kFirstFeature>();
  for (int i = 0; i < F; ++i)
    rows.middleRows<3>(CameraError::kSize + 3 * i) =
        joint.middleRows<3>(kFirstFeature + 3 * kept[i]);
  state.covariance.resize(size, size);
  state.covariance.leftCols<CameraError::kSize>() = rows.leftCols<kFirstFeature>() * J.transpose();
  for (int i = 0; i < F; ++i) {
    FeatureState feature = bundle.features[kept[i]];
    feature.id = hypothesis.ids[kept[i]];
    feature.offset = CameraError::kSize + 3 * i;
    state.features.push_back(feature);
    state.covariance.middleCols<3>(feature.offset) =
        rows.middleCols<3>(kFirstFeature + 3 * kept[i]);
  }
  state.covariance = 0.5 * (state.covariance + state.covariance.transpose()).eval();
  const Eigen::Matrix<double, 6, 1> impulse = impulseVariance(accelerations, interval_s);
  state.covariance.diagonal().segment<3>(CameraError::kVelocity) += impulse.head<3>();
  state.covariance.diagonal().segment<3>(CameraError::kAngularVelocity) += impulse.tail<3>();
  return state;
}

void dropOutliers(const CameraModel& model, const BundleOptions& options,
                  MotionHypothesis* hypothesis) {
  Bundle& bundle = hypothesis->bundle;
  const std::vector<double> errors_px = featureErrors(model, bundle);
  const double limit_px = options.loss_scale_sigmas * options.sigma_px;
  std::vector<int> place(errors_px.size(), -1);
  int kept = 0;
  for (std::size_t i = 0; i < errors_px.size(); ++i) {
    if (errors_px[i] > limit_px) continue;
    place[i] = kept;
    bundle.features[kept] = bundle.features[i];
    hypothesis->ids[kept++] = hypothesis->ids[i];
  }
  bundle.features.resize(kept);
  hypothesis->ids.resize(kept);
  for (auto& observations : bundle.observations) {
    std::vector<BundleObservation> remaining;
    for (BundleObservation o : observations) {
      o.feature = place[o.feature];
      if (o.feature >= 0) remaining.push_back(o);
    }
    observations.swap(remaining);
  }
}

}  // namespace active_matching_slam
