#include "active_matching_slam/filter/measurement_model.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

/// Rows that the image runs while one is read, beyond which the row of a feature can't be
/// predicted. Derivation: each guess of the row multiplies its error by this; four leave a
/// sixteenth.
constexpr double kMostRowsPerRow = 0.5;

}  // namespace

RowPose poseOfRow(const CameraModel& model, const CameraState& camera, double v) {
  const double share = rowShare(model, v);
  const double after_s = share * camera.readout_s;
  const Eigen::Matrix3d R = camera.q_world_camera.toRotationMatrix();
  const Eigen::Vector3d turn = camera.angular_velocity_camera * after_s;
  RowPose row;
  row.position_world = camera.position_world + after_s * camera.velocity_world;
  row.R_world_camera = R * rotationFromVector(turn).toRotationMatrix();
  row.speed << camera.velocity_world, R * camera.angular_velocity_camera;
  auto& J = row.d_camera;
  J.setZero();
  J.block<3, 3>(0, CameraError::kPosition).setIdentity();
  J.block<3, 3>(0, CameraError::kVelocity) = after_s * Eigen::Matrix3d::Identity();
  J.block<3, 3>(3, CameraError::kRotation).setIdentity();
  J.block<3, 3>(3, CameraError::kAngularVelocity) = after_s * R * leftJacobian(turn);
  J.col(CameraError::kReadout) = share * row.speed;
  return row;
}

std::optional<FeatureProjection> projectFromPose(const CameraModel& model,
                                                 const Eigen::Vector3d& position_world,
                                                 const Eigen::Matrix3d& R_world_camera,
                                                 const FeatureState& feature,
                                                 Eigen::Matrix<double, 2, 6>* d_pose) {
  const bool is_point = feature.kind == FeatureKind::kPoint;
  const double rho = is_point ? 1.0 : feature.inverse_depth;
  const Eigen::Vector3d from_camera =
      (is_point ? feature.point_world : feature.anchor_world) - position_world;
  Eigen::Vector3d ray_world = from_camera;
  if (!is_point) ray_world = rho * from_camera + feature.bearing_world;

  Eigen::Matrix<double, 2, 3> d_pixel_d_point;
  const auto pixel = model.project(R_world_camera.transpose() * ray_world, &d_pixel_d_point);
  if (!pixel || !pixel->allFinite() || !d_pixel_d_point.allFinite()) return std::nullopt;

  FeatureProjection projection;
  projection.pixel = *pixel;
  projection.d_ray = d_pixel_d_point * R_world_camera.transpose();
  const auto& d_ray = projection.d_ray;
  *d_pose << -rho * d_ray, d_ray * skew(ray_world);
  if (is_point) {
    projection.d_feature << d_ray, Eigen::Matrix<double, 2, 3>::Zero();
  } else if (feature.anchored_at_origin) {
    projection.d_feature << d_ray * feature.tangentBasis(), d_ray * from_camera,
        Eigen::Matrix<double, 2, 3>::Zero();
  } else {
    projection.d_feature << rho * d_ray, d_ray * feature.tangentBasis(), d_ray * from_camera;
  }
  return projection;
}

std::optional<FeatureProjection> projectFeature(const CameraModel& model, const CameraState& camera,
                                                const FeatureState& feature) {
  // The row depends on the pose and the pose on the row; a row takes microseconds, so that few
  // guesses are good to thousandths of a pixel. Nothing is read outside the image.
  const int guesses = camera.readout_s == 0.0 ? 1 : 4;
  double v = 0.5 * model.height();
  RowPose row;
  Eigen::Matrix<double, 2, 6> d_pose;
  std::optional<FeatureProjection> projection;
  for (int guess = 0; guess < guesses; ++guess) {
    row = poseOfRow(model, camera, v);
    projection = projectFromPose(model, row.position_world, row.R_world_camera, feature, &d_pose);
    if (!projection) return projection;
    v = std::clamp(projection->pixel.y(), 0.0, static_cast<double>(model.height()));
  }
  if (guesses == 1) row = poseOfRow(model, camera, v);  // how it answers to the readout
  projection->d_camera = d_pose * row.d_camera;
  projection->d_camera.rightCols<4>() = model.pixelByCorrection(projection->pixel);
  if (v != projection->pixel.y()) return projection;
  // The pixel moves its own row.
  const Eigen::Vector2d by_row = d_pose * row.speed * (camera.readout_s / model.height());
  if (!(std::abs(by_row.y()) < kMostRowsPerRow)) return std::nullopt;
  Eigen::Matrix2d M = Eigen::Matrix2d::Identity();
  M.col(1) += by_row / (1.0 - by_row.y());
  projection->d_camera = M * projection->d_camera;
  projection->d_feature = M * projection->d_feature;
  projection->d_ray = M * projection->d_ray;
  return projection;
}

Eigen::Matrix4d relativeCovariance(const FeatureState& feature,
                                   const CovarianceMatrix& covariance) {
  const auto P = covariance.view();
  const int anchor = feature.offset, rho = feature.inverseDepthRow();
  Eigen::Matrix4d V;
  V.topLeftCorner<3, 3>() = P.block<3, 3>(CameraError::kPosition, CameraError::kPosition);
  V.topRightCorner<3, 1>() = -P.block<3, 1>(CameraError::kPosition, rho);
  if (feature.hasAnchorError()) {
    const Eigen::Matrix3d cross = P.block<3, 3>(anchor, CameraError::kPosition);
    V.topLeftCorner<3, 3>() += P.block<3, 3>(anchor, anchor) - cross - cross.transpose();
    V.topRightCorner<3, 1>() += P.block<3, 1>(anchor, rho);
  }
  V.bottomLeftCorner<1, 3>() = V.topRightCorner<3, 1>().transpose();
  V(3, 3) = P(rho, rho);
  return V;
}

Eigen::Matrix2d secondOrderNoise(const FeatureProjection& projection,
                                 const Eigen::Matrix4d& relative) {
  // var(x y) = var(x) var(y) + cov(x, y)^2 for zero means, Gaussian.
  const Eigen::Vector2d cross = projection.d_ray * relative.topRightCorner<3, 1>();
  const Eigen::Matrix2d along =
      projection.d_ray * relative.topLeftCorner<3, 3>() * projection.d_ray.transpose();
  return relative(3, 3) * along + cross * cross.transpose();
}

void MeasurementStack::clear() { blocks_.clear(); }

void MeasurementStack::add(const FeatureState& feature, const FeatureProjection& projection) {
  blocks_.push_back({feature.offset, feature.size(), projection});
}

Eigen::VectorXd MeasurementStack::pixels() const {
  Eigen::VectorXd z(rows());
  for (std::size_t i = 0; i < blocks_.size(); ++i)
    z.segment<2>(2 * i) = blocks_[i].projection.pixel;
  return z;
}

Eigen::MatrixXd MeasurementStack::times(const Eigen::Ref<const Eigen::MatrixXd>& X) const {
  Eigen::MatrixXd Y(rows(), X.cols());
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Block& b = blocks_[i];
    Y.middleRows<2>(2 * i) =
        b.projection.d_camera.lazyProduct(X.topRows<CameraError::kSize>()) +
        b.projection.d_feature.leftCols(b.size).lazyProduct(X.middleRows(b.offset, b.size));
  }
  return Y;
}

Eigen::MatrixXd MeasurementStack::cameraJacobian() const {
  Eigen::MatrixXd H(rows(), CameraError::kSize);
  for (std::size_t i = 0; i < blocks_.size(); ++i)
    H.middleRows<2>(2 * i) = blocks_[i].projection.d_camera;
  return H;
}

void MeasurementStack::crossCovariance(const CovarianceMatrix& covariance,
                                       Eigen::Ref<Eigen::MatrixXd> out) const {
  const auto P = covariance.view();
  out.noalias() = P.leftCols<CameraError::kSize>() * cameraJacobian().transpose();
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Block& b = blocks_[i];
    const auto& H = b.projection.d_feature;
    auto target = out.middleCols<2>(2 * i);
    if (b.size == 3) {
      target += P.middleCols<3>(b.offset).lazyProduct(H.leftCols<3>().transpose());
    } else {
      target += P.middleCols<6>(b.offset).lazyProduct(H.transpose());
    }
  }
}

Eigen::MatrixXd MeasurementStack::innovationCovariance(
    const Eigen::Ref<const Eigen::MatrixXd>& PHt) const {
  Eigen::MatrixXd S(rows(), rows());
  S.noalias() = cameraJacobian() * PHt.topRows<CameraError::kSize>();
  for (std::size_t i = 0; i < blocks_.size(); ++i) {
    const Block& b = blocks_[i];
    const auto& H = b.projection.d_feature;
    for (std::size_t j = 0; j <= i; ++j) {
      const auto cross = PHt.middleCols<2>(2 * j);
      auto target = S.block<2, 2>(2 * i, 2 * j);
      if (b.size == 3) {
        target += H.leftCols<3>().lazyProduct(cross.middleRows<3>(b.offset));
      } else {
        target += H.lazyProduct(cross.middleRows<6>(b.offset));
      }
    }
  }
  return S;
}

}  // namespace active_matching_slam
