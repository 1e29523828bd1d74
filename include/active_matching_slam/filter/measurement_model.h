#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/filter/covariance_matrix.h"
#include "active_matching_slam/filter/feature_state.h"

namespace active_matching_slam {

/// Where a feature is seen and how that answers to the error state.
struct FeatureProjection {
  Eigen::Vector2d pixel;
  Eigen::Matrix<double, 2, CameraError::kSize> d_camera =
      Eigen::Matrix<double, 2, CameraError::kSize>::Zero();
  Eigen::Matrix<double, 2, 6> d_feature;  ///< by the feature's error, its first size() columns
  Eigen::Matrix<double, 2, 3> d_ray;      ///< by the world vector that is projected
};

/// (Chli 2009, eq. 3.9-3.13), inverse depth in the homogeneous form h(R_CW (rho (anchor - r) + m)),
/// through the lens as `camera` has it and from where the camera is while the row that shows the
/// feature is exposed. Empty when the feature is behind the camera or outside the field of the lens
/// model.
std::optional<FeatureProjection> projectFeature(const CameraModel& model, const CameraState& camera,
                                                const FeatureState& feature);

/// The same by a plain lens model from a pose that the rows share: all but d_camera, in place of
/// which `d_pose` receives the Jacobian by position and world-frame rotation.
std::optional<FeatureProjection> projectFromPose(const CameraModel& model,
                                                 const Eigen::Vector3d& position_world,
                                                 const Eigen::Matrix3d& R_world_camera,
                                                 const FeatureState& feature,
                                                 Eigen::Matrix<double, 2, 6>* d_pose);

/// Where the camera is while row `v` is exposed, and how that pose (position, world-frame rotation)
/// answers to the camera's error state.
struct RowPose {
  Eigen::Vector3d position_world;
  Eigen::Matrix3d R_world_camera;
  Eigen::Matrix<double, 6, CameraError::kSize> d_camera;
  Eigen::Matrix<double, 6, 1> speed;  ///< of position and rotation, both in the world [1/s]
};
/// By which share of the readout row `v` is exposed after the middle one, -0.5 to 0.5.
inline double rowShare(const CameraModel& model, double v) { return v / model.height() - 0.5; }
RowPose poseOfRow(const CameraModel& model, const CameraState& camera, double v);

/// Covariance of (anchor - camera position, inverse depth), 4 x 4.
Eigen::Matrix4d relativeCovariance(const FeatureState& feature, const CovarianceMatrix& P);

/// What linearisation leaves out [px^2]: the ray rho (a - r) + m has the second-order term
/// d_rho d_(a - r), whose variance for Gaussian errors of `relative` covariance follows from their
/// fourth moments. It matters while a depth is vague and the camera's move uncertain: unaccounted
/// for, it is taken for parallax.
Eigen::Matrix2d secondOrderNoise(const FeatureProjection& projection,
                                 const Eigen::Matrix4d& relative);

/// Projections of several features on top of each other: a Jacobian H of which only the columns of
/// the camera and of each row's own feature are not zero.
class MeasurementStack {
 public:
  void clear();
  void add(const FeatureState& feature, const FeatureProjection& projection);

  const FeatureProjection& projection(int i) const { return blocks_[i].projection; }
  int rows() const { return 2 * static_cast<int>(blocks_.size()); }
  Eigen::VectorXd pixels() const;

  /// The camera's columns of H, rows() x CameraError::kSize.
  Eigen::MatrixXd cameraJacobian() const;
  /// H X.
  Eigen::MatrixXd times(const Eigen::Ref<const Eigen::MatrixXd>& X) const;
  /// out = P H^T, state size x rows().
  void crossCovariance(const CovarianceMatrix& P, Eigen::Ref<Eigen::MatrixXd> out) const;
  /// Lower triangle of H P H^T from P H^T.
  Eigen::MatrixXd innovationCovariance(const Eigen::Ref<const Eigen::MatrixXd>& PHt) const;

 private:
  struct Block {
    int offset, size;
    FeatureProjection projection;
  };
  std::vector<Block> blocks_;
};

}  // namespace active_matching_slam
