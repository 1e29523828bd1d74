#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

/// Of a point, or of p = a + m / rho, by the feature's error, 3 x size().
Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 6> positionJacobian(const FeatureState& feature) {
  if (feature.kind == FeatureKind::kPoint) return Eigen::Matrix3d::Identity();
  const double depth = 1.0 / feature.inverse_depth;
  Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 6> J(3, feature.size());
  J.rightCols<3>() << depth * feature.tangentBasis(), -depth * depth * feature.bearing_world;
  if (feature.hasAnchorError()) J.leftCols<3>().setIdentity();
  return J;
}

/// Linearity index of the depth error as the camera sees it now (Civera 2008, eq. 22).
double linearityIndex(const FeatureState& feature, double sigma_inverse_depth,
                      const Eigen::Vector3d& camera_position) {
  const Eigen::Vector3d from_camera = feature.position() - camera_position;
  const double distance = from_camera.norm();
  const double sigma_depth = sigma_inverse_depth / (feature.inverse_depth * feature.inverse_depth);
  const double cos_parallax = feature.bearing_world.dot(from_camera) / distance;
  return 4.0 * sigma_depth * std::abs(cos_parallax) / distance;
}

}  // namespace

FeatureState& Ekf::appendFeature(FeatureKind kind) {
  FeatureState feature;
  feature.id = next_id_++;
  feature.kind = kind;
  feature.offset = covariance_.size();
  features_.push_back(feature);
  covariance_.extend(feature.size());
  return features_.back();
}

void Ekf::assignOffsets() {
  int offset = cameraErrorSize(camera_);
  for (FeatureState& feature : features_) {
    feature.offset = offset;
    offset += feature.size();
  }
}

FeatureId Ekf::addInverseDepthFeature(const CameraModel& camera, const Eigen::Vector2d& pixel,
                                      double inverse_depth, double sigma_inverse_depth,
                                      double sigma_px) {
  if (!pixel.allFinite()) return -1;
  Eigen::Matrix<double, 3, 2> d_bearing_d_pixel;
  const CameraModel lens = camera.corrected(camera_.lens);
  const auto bearing = lens.unproject(pixel, &d_bearing_d_pixel);
  if (!bearing || !bearing->allFinite() || !d_bearing_d_pixel.allFinite()) return -1;

  FeatureState& feature = appendFeature(FeatureKind::kInverseDepth);
  const RowPose row = poseOfRow(camera, camera_, pixel.y());
  const Eigen::Matrix3d& R = row.R_world_camera;
  feature.anchor_world = row.position_world;
  feature.bearing_world = (R * *bearing).normalized();
  const Eigen::Vector3d axis = R.col(std::abs(bearing->x()) < 0.9 ? 0 : 1);
  feature.tangent_world =
      (axis - feature.bearing_world * feature.bearing_world.dot(axis)).normalized();
  feature.inverse_depth = inverse_depth > 0.0 ? inverse_depth : options_.initial_inverse_depth;
  const double sigma_rho =
      sigma_inverse_depth > 0.0 ? sigma_inverse_depth : options_.initial_sigma_inverse_depth;

  if (!(sigma_px > 0.0)) sigma_px = options_.sigma_px;

  // The anchor is the camera's place, the bearing turns with the camera and goes with the lens;
  // only the pixel's noise and the depth are new.
  const Eigen::Matrix<double, 2, 2> d_error_d_pixel =
      feature.tangentBasis().transpose() * R * d_bearing_d_pixel;
  const Eigen::Matrix<double, 2, 3> N = bearingGauge(feature);
  const int o = feature.offset, bearing_row = feature.bearingRow() - o;
  using CameraJacobian = Eigen::Matrix<double, 6, CameraError::kSize>;
  CameraJacobian A = CameraJacobian::Zero();
  A.topRows<3>() = row.d_camera.topRows<3>();
  A.middleRows<2>(bearing_row) = N * row.d_camera.bottomRows<3>();
  A.block<2, 4>(bearing_row, CameraError::kFocal) -=
      d_error_d_pixel * lens.pixelByCorrection(pixel);
  auto P = covariance_.view();
  P.middleRows<6>(o).leftCols(o).noalias() = A * P.topLeftCorner(CameraError::kSize, o);
  P.topRightCorner(o, 6) = P.bottomLeftCorner(6, o).transpose();
  P.block<6, 6>(o, o) = P.block<6, CameraError::kSize>(o, 0) * A.transpose();
  // The pixel's noise turns the bearing, and it is another row that would have shown the feature.
  Eigen::Matrix<double, 6, 2> B = Eigen::Matrix<double, 6, 2>::Zero();
  B.middleRows<2>(bearing_row) = d_error_d_pixel;
  const double row_s = camera_.readout_s / camera.height();
  B.col(1).head<3>() += row_s * row.speed.head<3>();
  B.col(1).segment<2>(bearing_row) += row_s * N * row.speed.tail<3>();
  P.block<6, 6>(o, o) += sigma_px * sigma_px * B * B.transpose();
  const int rho = feature.inverseDepthRow();
  P(rho, rho) += sigma_rho * sigma_rho;
  const Eigen::Matrix<double, 6, 6> own = P.block<6, 6>(o, o);
  P.block<6, 6>(o, o) = 0.5 * (own + own.transpose());
  return feature.id;
}

FeatureId Ekf::addPointFeature(const Eigen::Vector3d& position_world,
                               const Eigen::Matrix3d& covariance) {
  FeatureState& feature = appendFeature(FeatureKind::kPoint);
  feature.point_world = position_world;
  covariance_.view().bottomRightCorner<3, 3>() = 0.5 * (covariance + covariance.transpose());
  return feature.id;
}

void Ekf::addLandmarkNoise(const CameraModel& camera, double interval_s, double sigma_px) {
  if (!(interval_s > 0.0) || !std::isfinite(interval_s) || !(sigma_px > 0.0)) return;
  const double sigma_rad = sigma_px / camera.calibration().fx;
  for (const FeatureState& feature : features_) {
    const Eigen::Vector3d from_camera = feature.position() - camera_.position_world;
    const double distance = from_camera.norm();
    if (!(distance > 0.0)) continue;
    const Eigen::Vector3d ray = from_camera / distance;
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray * ray.transpose();
    const double turned_rad = (across * camera_.velocity_world).norm() * interval_s / distance;
    addAcrossRay(feature, across, distance, sigma_rad * sigma_rad * turned_rad);
  }
}

void Ekf::loosenLandmark(const CameraModel& camera, FeatureId id, double sigma_px) {
  const FeatureState* feature = find(id);
  if (!feature || !(sigma_px > 0.0) || !std::isfinite(sigma_px)) return;
  const double sigma_rad = sigma_px / camera.calibration().fx;
  const Eigen::Vector3d from_camera = feature->position() - camera_.position_world;
  const double distance = from_camera.norm();
  if (!(distance > 0.0)) return;
  const Eigen::Vector3d ray = from_camera / distance;
  addAcrossRay(*feature, Eigen::Matrix3d::Identity() - ray * ray.transpose(), distance,
               sigma_rad * sigma_rad);
}

/// Adds variance_rad2 across the ray, along which `across` is zero; to the bearing of an inverse
/// depth, whose anchor is taken to be as far off as the camera.
void Ekf::addAcrossRay(const FeatureState& feature, const Eigen::Matrix3d& across, double distance,
                       double variance_rad2) {
  auto P = covariance_.view();
  if (feature.kind == FeatureKind::kPoint)
    P.block<3, 3>(feature.offset, feature.offset) += variance_rad2 * distance * distance * across;
  else
    P.diagonal().segment<2>(feature.bearingRow()).array() += variance_rad2;
}

void Ekf::removeFeatures(const std::vector<FeatureId>& ids) {
  std::vector<FeatureId> gone(ids);
  std::sort(gone.begin(), gone.end());
  std::vector<FeatureState> kept;
  std::vector<std::pair<int, int>> ranges{{0, cameraErrorSize(camera_)}};
  for (const FeatureState& feature : features_) {
    if (std::binary_search(gone.begin(), gone.end(), feature.id)) continue;
    kept.push_back(feature);
    ranges.emplace_back(feature.offset, feature.size());
  }
  if (kept.size() == features_.size()) return;
  features_.swap(kept);
  covariance_.keep(ranges);
  assignOffsets();
}

void Ekf::insertFeatures(const std::vector<FeatureState>& features, const Eigen::MatrixXd& own,
                         const Eigen::MatrixXd& cross) {
  const auto rows = 3 * static_cast<Eigen::Index>(features.size());
  const int n = covariance_.size();
  const auto refuse = [](const std::string& what) {
    throw std::invalid_argument("features to insert: " + what);
  };
  if (own.rows() != rows || own.cols() != rows || cross.rows() != rows || cross.cols() != n)
    refuse("covariances of " + std::to_string(own.rows()) + " x " + std::to_string(own.cols()) +
           " and " + std::to_string(cross.rows()) + " x " + std::to_string(cross.cols()) + " for " +
           std::to_string(features.size()) + " points and a state of " + std::to_string(n));
  if (!own.allFinite() || !cross.allFinite()) refuse("a covariance is not finite");
  for (std::size_t i = 0; i < features.size(); ++i) {
    const std::string name = "feature " + std::to_string(features[i].id);
    if (features[i].kind != FeatureKind::kPoint || !features[i].point_world.allFinite())
      refuse(name + " is not a point");
    if (features[i].id < 0 || features[i].id >= next_id_) refuse(name + " was never in the state");
    if (find(features[i].id)) refuse(name + " is in the state");
    if (i > 0 && features[i].id <= features[i - 1].id) refuse("ids are not ascending");
  }
  if (features.empty()) return;

  std::vector<FeatureState> merged;
  std::vector<Eigen::Index> place;  // of each row of the joint: what is there now, then `own`
  for (int i = 0; i < cameraErrorSize(camera_); ++i) place.push_back(i);
  std::size_t next = 0;
  const auto insertBelow = [&](FeatureId id) {
    for (; next < features.size() && features[next].id < id; ++next) {
      merged.push_back(features[next]);
      for (int k = 0; k < 3; ++k) place.push_back(n + 3 * static_cast<Eigen::Index>(next) + k);
    }
  };
  for (const FeatureState& feature : features_) {
    insertBelow(feature.id);
    merged.push_back(feature);
    for (int k = 0; k < feature.size(); ++k) place.push_back(feature.offset + k);
  }
  insertBelow(next_id_);

  const auto size = static_cast<Eigen::Index>(place.size());
  const auto P = covariance_.view();
  Eigen::MatrixXd joint(size, size);
  for (Eigen::Index j = 0; j < size; ++j) {
    for (Eigen::Index i = j; i < size; ++i) {
      const Eigen::Index a = place[i], b = place[j];
      joint(i, j) = a < n ? (b < n ? P(a, b) : cross(b - n, a))
                          : (b < n ? cross(a - n, b) : own(a - n, b - n));
    }
  }
  covariance_.assign(joint);
  features_.swap(merged);
  assignOffsets();
}

void Ekf::inflate(const Eigen::MatrixXd& added) {
  const int n = covariance_.size();
  if (added.rows() != n || added.cols() != n || !added.allFinite())
    throw std::invalid_argument("inflation of " + std::to_string(added.rows()) + " x " +
                                std::to_string(added.cols()) + ", or not finite, for a state of " +
                                std::to_string(n));
  covariance_.view() += 0.5 * (added + added.transpose());
  impulse_.reset();
}

std::vector<FeatureId> Ekf::convertToPoints() {
  std::vector<FeatureId> linear;
  for (const FeatureState& feature : features_) {
    if (feature.kind == FeatureKind::kInverseDepth &&
        feature.inverse_depth > options_.minimum_inverse_depth &&
        linearityIndex(feature, sigmaInverseDepth(feature), camera_.position_world) <
            options_.linearity_threshold)
      linear.push_back(feature.id);
  }
  convertToPoints(linear);
  return linear;
}

void Ekf::convertToPoints(const std::vector<FeatureId>& ids) {
  if (ids.empty()) return;
  std::vector<std::pair<int, int>> ranges{{0, cameraErrorSize(camera_)}};
  auto P = covariance_.view();
  for (FeatureState& feature : features_) {
    if (feature.kind == FeatureKind::kInverseDepth &&
        std::find(ids.begin(), ids.end(), feature.id) != ids.end()) {
      const int o = feature.offset;
      const Eigen::Matrix3d own = positionCovariance(feature);
      const auto J = positionJacobian(feature);
      P.middleCols<3>(o) = (P.middleCols(o, feature.size()) * J.transpose()).eval();
      P.middleRows<3>(o) = P.middleCols<3>(o).transpose().eval();
      P.block<3, 3>(o, o) = own;
      feature.point_world = feature.position();
      feature.kind = FeatureKind::kPoint;
      feature.anchored_at_origin = false;
    }
    ranges.emplace_back(feature.offset, feature.size());
  }
  covariance_.keep(ranges);
  assignOffsets();
}

Eigen::Matrix3d Ekf::positionCovariance(const FeatureState& feature) const {
  const auto J = positionJacobian(feature);
  const int o = feature.offset, size = feature.size();
  const Eigen::Matrix3d covariance = J * covariance_.view().block(o, o, size, size) * J.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

double Ekf::sigmaInverseDepth(const FeatureState& feature) const {
  if (feature.kind == FeatureKind::kPoint) return 0.0;
  const int row = feature.inverseDepthRow();
  return std::sqrt(std::max(0.0, covariance_.view()(row, row)));
}

}  // namespace active_matching_slam
