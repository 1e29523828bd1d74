#include "map_joiner.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/math/chi_square.h"
#include "active_matching_slam/math/pixel_scale.h"
#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/math/rotation.h"
#include "found_pose.h"
#include "known_depth.h"

namespace active_matching_slam {
namespace {

/// Distance in the image within which two landmarks are taken to be at one depth, of an image 640
/// wide [px]. Cost: farther, more of them lie on other surfaces, which shows in the spread.
constexpr double kNeighbourPx = 80.0;
/// Of the standard deviation of a Gaussian, its median absolute deviation, and of the mean's the
/// median's, as they are for Gaussians.
constexpr double kDeviationsOfMedian = 1.4826, kMedianOverMean = 1.2533;
/// Cost: of one right pair of looks in ten thousand another is taken.
constexpr double kAgreementProbability = 0.9999;

/// Adds `weight` times the derivative of log |x - p| by a filter's state.
void addLogDistance(const Ekf& filter, const FeatureState& feature, double weight,
                    Eigen::VectorXd* gradient) {
  if (feature.kind != FeatureKind::kPoint) {
    // The camera is near where such a one was seen first, or it would be a point.
    (*gradient)[feature.inverseDepthRow()] -= weight / feature.inverse_depth;
    return;
  }
  const Eigen::Vector3d ray = feature.point_world - filter.camera().position_world;
  const Eigen::Vector3d slope = weight / ray.squaredNorm() * ray;
  gradient->segment<3>(feature.offset) += slope;
  gradient->segment<3>(CameraError::kPosition) -= slope;
}

/// Of a camera that was found in a map, in its own frame.
Matrix6 covarianceInCamera(const CameraModel& camera, const Ekf& map, const Relocalisation& found) {
  std::vector<Eigen::Vector3d> points;
  for (const FeatureMeasurement& inlier : found.inliers)
    if (const FeatureState* feature = map.find(inlier.id)) points.push_back(feature->position());
  return foundPoseCovariance(camera, found, points);
}

/// Of positions and rotations, those of a camera in which another has a relative pose, by errors in
/// the frame of the first: rotated into that of the second, with the lever between.
Matrix6 carriedAlong(const Matrix6& covariance, const Eigen::Isometry3d& T_first_second) {
  Matrix6 J = Matrix6::Zero();
  const Eigen::Matrix3d R = T_first_second.linear().transpose();
  J.topLeftCorner<3, 3>() = R;
  J.topRightCorner<3, 3>() = -R * skew(T_first_second.translation());
  J.bottomRightCorner<3, 3>() = R;
  return J * covariance * J.transpose();
}

}  // namespace

std::optional<UnitRatio> unitRatio(const CameraModel& camera, const Ekf& map, const Ekf& other,
                                   const std::vector<FeatureMeasurement>& sights) {
  struct Seen {
    const FeatureState* feature;
    Eigen::Vector2d pixel;
    double distance;
  };
  std::vector<Seen> seen;
  const Eigen::Isometry3d T_camera_other = other.camera().poseWorldCamera().inverse();
  for (const FeatureState& feature : other.features()) {
    if (other.sigmaInverseDepth(feature) > kKnownDepthSigma * std::abs(feature.inverse_depth))
      continue;
    const Eigen::Vector3d point = T_camera_other * feature.position();
    const auto pixel = camera.project(point);
    if (pixel && camera.isInImage(*pixel)) seen.push_back({&feature, *pixel, point.norm()});
  }
  struct Pair {
    const FeatureState* mine;
    const FeatureState* others;
    double log_ratio;
  };
  std::vector<Pair> pairs;
  const double radius_px = kNeighbourPx * pixelScale(camera.width(), camera.height());
  for (const FeatureMeasurement& sight : sights) {
    const FeatureState* feature = map.find(sight.id);
    if (!feature || seen.empty()) continue;
    const auto nearest =
        std::min_element(seen.begin(), seen.end(), [&](const Seen& a, const Seen& b) {
          return (a.pixel - sight.pixel).squaredNorm() < (b.pixel - sight.pixel).squaredNorm();
        });
    const double distance = (feature->position() - map.camera().position_world).norm();
    if ((nearest->pixel - sight.pixel).norm() > radius_px || !(distance > 0.0)) continue;
    pairs.push_back({feature, nearest->feature, std::log(distance / nearest->distance)});
  }
  if (static_cast<std::ptrdiff_t>(pairs.size()) < kNeighbours) return std::nullopt;
  std::vector<double> ratios, deviations;
  for (const Pair& pair : pairs) ratios.push_back(pair.log_ratio);
  const double median = medianOf(ratios);
  for (const double ratio : ratios) deviations.push_back(std::abs(ratio - median));
  const double n = static_cast<double>(pairs.size());
  const double spread = kDeviationsOfMedian * medianOf(deviations);
  Eigen::VectorXd of_map = Eigen::VectorXd::Zero(map.stateSize());
  Eigen::VectorXd of_other = Eigen::VectorXd::Zero(other.stateSize());
  for (const Pair& pair : pairs) {
    addLogDistance(map, *pair.mine, 1.0 / n, &of_map);
    addLogDistance(other, *pair.others, 1.0 / n, &of_other);
  }
  const double variance = kMedianOverMean * kMedianOverMean * spread * spread / n +
                          of_map.dot(map.covariance() * of_map) +
                          of_other.dot(other.covariance() * of_other);
  if (!(variance >= 0.0) || !std::isfinite(median)) return std::nullopt;
  return UnitRatio{std::exp(median), std::sqrt(variance)};
}

bool agree(const CameraModel& camera, const Ekf& map, const Relocalisation& first,
           const Relocalisation& second, const Eigen::Isometry3d& T_first_second,
           const UnitRatio& unit) {
  Eigen::Isometry3d expected = T_first_second;
  expected.translation() *= unit.factor;
  const Eigen::Isometry3d found = first.T_world_camera.inverse() * second.T_world_camera;
  const Eigen::Isometry3d rest = expected.inverse() * found;
  Vector6 difference;
  difference << rest.translation(), vectorFromRotation(Eigen::Quaterniond(rest.linear()));
  Matrix6 covariance = covarianceInCamera(camera, map, second) +
                       carriedAlong(covarianceInCamera(camera, map, first), expected);
  const Eigen::Vector3d along =
      unit.log_sigma * (expected.linear().transpose() * expected.translation());
  covariance.topLeftCorner<3, 3>() += along * along.transpose();
  constexpr int kFreedoms = 6;
  return squaredDistance(difference, covariance) <=
         chiSquareQuantile(kFreedoms, kAgreementProbability);
}

JoinedFeatures joinFeatures(const Ekf& other, const std::vector<FeatureId>& ids,
                            const UnitRatio& unit, Ekf* filter) {
  JoinedFeatures joined;
  joined.factor = unit.factor;
  const Eigen::Isometry3d T_map_camera = filter->camera().poseWorldCamera();
  Eigen::Isometry3d T_camera_other = other.camera().poseWorldCamera().inverse();
  T_camera_other.translation() *= unit.factor;
  joined.T_map_other = T_map_camera * T_camera_other;
  const Eigen::Matrix3d R = joined.T_map_other.linear();
  std::vector<const FeatureState*> sources;
  for (const FeatureId id : ids) {
    const FeatureState* feature = other.find(id);
    if (!feature || !(homogeneousPosition(*feature).w() > 0.0)) continue;
    joined.ids.push_back(id);
    sources.push_back(feature);
  }
  constexpr int kSize = 6;  // of a feature's error, as of that of a camera's pose
  const auto rows = kSize * static_cast<Eigen::Index>(sources.size());
  // Of errors of the other map, first their covariance with all of that map.
  const auto P_other = other.covariance();
  std::vector<Eigen::Matrix<double, kSize, Eigen::Dynamic>> by_other;
  std::vector<std::vector<int>> columns;
  Eigen::MatrixXd others(rows, P_other.cols());
  Eigen::MatrixXd of_camera = Eigen::MatrixXd::Zero(rows, kSize);
  Eigen::VectorXd of_unit = Eigen::VectorXd::Zero(rows);
  std::vector<FeatureState> features = filter->features();
  FeatureId next_id = std::max(filter->nextId(), other.nextId());
  for (std::size_t i = 0; i < sources.size(); ++i) {
    const auto row = kSize * static_cast<Eigen::Index>(i);
    const FeatureState& source = *sources[i];
    const Eigen::Vector4d point = homogeneousPosition(source);
    const double w = point.w();
    const Eigen::Vector3d h = point.head<3>() - w * other.camera().position_world;
    const Eigen::Vector3d g = R * h;
    const double length = g.norm();
    FeatureState feature;
    feature.id = next_id++;
    feature.kind = FeatureKind::kInverseDepth;
    feature.anchor_world = T_map_camera.translation();
    feature.bearing_world = g / length;
    feature.tangent_world = feature.bearing_world.unitOrthogonal();
    feature.inverse_depth = w / (unit.factor * length);
    // Bearing and inverse depth by g, and by w.
    Eigen::Matrix3d D;
    D << feature.tangentBasis().transpose() / length,
        -feature.inverse_depth / length * feature.bearing_world.transpose();
    const Eigen::Vector3d by_w(0.0, 0.0, 1.0 / (unit.factor * length));
    // By errors of the other camera's position and rotation, and of the other feature.
    Eigen::Matrix<double, kSize, Eigen::Dynamic> J =
        Eigen::Matrix<double, kSize, Eigen::Dynamic>::Zero(kSize, kSize + source.size());
    J.block<3, 3>(3, 0) = -w * D * R;
    J.block<3, 3>(3, 3) = D * R * skew(h);
    if (source.kind == FeatureKind::kPoint) {
      J.block<3, 3>(3, kSize) = D * R;
    } else {
      const int bearing = kSize + (source.hasAnchorError() ? 3 : 0);
      if (source.hasAnchorError()) J.block<3, 3>(3, kSize) = w * D * R;
      J.block<3, 2>(3, bearing) = D * R * source.tangentBasis();
      J.col(bearing + 2).tail<3>() =
          D * R * (source.anchor_world - other.camera().position_world) + by_w;
    }
    std::vector<int> own;
    for (int k = 0; k < kSize; ++k) own.push_back(CameraError::kPosition + k);
    for (int k = 0; k < source.size(); ++k) own.push_back(source.offset + k);
    others.middleRows<kSize>(row).setZero();
    for (std::size_t k = 0; k < own.size(); ++k)
      others.middleRows<kSize>(row) += J.col(static_cast<Eigen::Index>(k)) * P_other.row(own[k]);
    of_camera.block<3, 3>(row, CameraError::kPosition).setIdentity();
    of_camera.block<3, 3>(row + 3, CameraError::kRotation) = -D * skew(g);
    of_unit[row + 5] = -feature.inverse_depth;
    by_other.push_back(std::move(J));
    columns.push_back(std::move(own));
    features.push_back(feature);
  }
  const Eigen::MatrixXd P = filter->savedCovariance();
  const Eigen::MatrixXd cross = of_camera * P.topRows<kSize>();
  Eigen::MatrixXd own = cross.leftCols<kSize>() * of_camera.transpose();
  own += unit.log_sigma * unit.log_sigma * of_unit * of_unit.transpose();
  for (std::size_t i = 0; i < sources.size(); ++i)
    for (std::size_t k = 0; k < columns[i].size(); ++k)
      own.middleCols<kSize>(kSize * static_cast<Eigen::Index>(i)) +=
          others.col(columns[i][k]) * by_other[i].col(static_cast<Eigen::Index>(k)).transpose();
  Eigen::MatrixXd all(P.rows() + rows, P.cols() + rows);
  all << P, cross.transpose(), cross, 0.5 * (own + own.transpose());
  filter->restore(filter->camera(), features, all, next_id);
  return joined;
}

}  // namespace active_matching_slam
