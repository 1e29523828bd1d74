#include "corridor_run.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/evaluation/consistency.h"
#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;

// Of a new point, relative: what of a ray is known when it becomes a point. (With a tenth, points
// of three coordinates make the filter too sure by themselves: NEES 12 in place of 6.)
constexpr double kNewDepthSigma = 0.02;
constexpr double kStartDepthSigma = 0.01;  // of the first ones, which give the map its unit
constexpr double kApart_px = 20.0;         // from a frozen point, of a new one
constexpr int kLoopFrames = 300;           // out of view for so long: a loop

CameraCalibration corridorCamera() {
  CameraCalibration calibration;
  calibration.width = 640;
  calibration.height = 480;
  calibration.fx = calibration.fy = 500.0;
  calibration.cx = 319.5;
  calibration.cy = 239.5;
  return calibration;
}

FilterOptions corridorFilter(double sigma_px) {
  FilterOptions options;
  options.sigma_px = sigma_px;
  options.sigma_acceleration_mps2 = 2.0;
  options.sigma_angular_acceleration_rps2 = 2.5;
  options.initial_sigma_velocity_mps = 1.0;
  options.initial_sigma_readout_s = 0.0;  // a global shutter
  options.landmark_noise_px = 0.0;
  return options;
}

/// Points of known covariance with the state, put into it under new ids.
void append(Ekf& filter, const std::vector<Vector3d>& points, const MatrixXd& cross,
            const MatrixXd& own) {
  std::vector<FeatureState> features = filter.features();
  FeatureId next = filter.nextId();
  for (const Vector3d& point : points) {
    FeatureState feature;
    feature.id = next++;
    feature.kind = FeatureKind::kPoint;
    feature.point_world = point;
    features.push_back(feature);
  }
  const Index before = filter.stateSize(), added = own.rows();
  MatrixXd P(before + added, before + added);
  P << filter.covariance(), cross.transpose(), cross, own;
  filter.restore(filter.camera(), features, P, next);
}

}  // namespace

CorridorRun::CorridorRun(const CorridorOptions& options, std::uint64_t seed)
    : options_(options),
      world_(options.points, seed),
      random_(seed + 1000),
      model_(corridorCamera()),
      filter_(corridorFilter(options.sigma_px)),
      active_(filter_) {
  LensCorrection lens;
  const CalibrationVector sigmas = calibrationSigmas(filter_.options());
  lens.focal = sigmas[1] * normal();
  lens.radial = sigmas[2] * normal();
  lens.centre << sigmas[3] * normal(), sigmas[4] * normal();
  true_model_ = std::make_unique<CameraModel>(model_.corrected(lens));
  CameraState camera;
  truth_ = world_.camera(0.0, 0.0);
  camera.setPoseWorldCamera(truth_);
  MotionCovariance P = MotionCovariance::Zero();
  P.diagonal() << Vector3d::Constant(1e-8), Vector3d::Constant(1e-8), Vector3d::Constant(1.0),
      Vector3d::Constant(0.25);
  filter_.reset(camera, P);
  look();
  startPoints();
}

void CorridorRun::look() {
  seen_.clear();
  for (int i = 0; i < options_.points; ++i) {
    const auto pixel = world_.project(*true_model_, truth_, i);
    if (pixel) seen_[i] = *pixel;
  }
}

void CorridorRun::step() {
  look();
  filter_.predict(1.0 / kRate);
  const double before = positionError();
  int returned = 0;
  const bool activated = options_.bound == MapBound::kSubmaps && activate();
  std::vector<FeatureMeasurement> measurements;
  for (const FeatureState& feature : filter_.features()) {
    const auto found = seen_.find(point_of_.at(feature.id));
    if (found == seen_.end()) continue;
    const bool is_loop = frame_ - last_seen_.at(feature.id) > kLoopFrames;
    last_seen_[feature.id] = frame_;
    if (static_cast<int>(measurements.size()) >= options_.measured) continue;
    const double u = normal(), v = normal();
    measurements.push_back(
        {feature.id, found->second + options_.sigma_px * Vector2d(u, v), options_.sigma_px});
    returned += is_loop;
    for (Activated& leaf : activated_) {
      if (leaf.members.count(feature.id) > 0) leaf.measured.insert(feature.id);
    }
  }
  FilterOptions options = filter_.options();
  options.update_iterations = activated ? 8 : 1;
  filter_.setOptions(options);
  const UpdateReport report = filter_.update(model_, measurements);
  result_.healthy = result_.healthy && report.healthy;
  if (!loop_seen_ && returned >= kSeenToActivate) {
    loop_seen_ = true;
    result_.error_before_loop_m = before;
    result_.error_after_loop_m = positionError();
  }
  startPoints();
}

void CorridorRun::startPoints() {
  int in_view = 0;
  std::set<int> in_map;
  for (const FeatureState& feature : filter_.features()) {
    const int point = point_of_.at(feature.id);
    in_map.insert(point);
    in_view += seen_.count(point) > 0;
  }
  std::vector<Vector2d> frozen_px;
  for (const auto& [id, point] : point_of_) {
    if (frozen_.count(point) == 0) continue;
    const auto found = seen_.find(point);
    if (found != seen_.end()) frozen_px.push_back(found->second);
  }
  std::vector<int> candidates;
  for (const auto& [point, pixel] : seen_) {
    if (in_map.count(point) > 0 || frozen_.count(point) > 0) continue;
    const bool apart = std::all_of(frozen_px.begin(), frozen_px.end(), [&p = pixel](const auto& f) {
      return (f - p).norm() >= kApart_px;
    });
    if (apart) candidates.push_back(point);
  }
  std::shuffle(candidates.begin(), candidates.end(), random_);
  const int wanted = std::max(0, options_.measured - in_view);
  if (static_cast<int>(candidates.size()) > wanted) candidates.resize(slot(wanted));
  addPoints(candidates);
}

double CorridorRun::relativeScale(Eigen::VectorXd* functional) const {
  const int n = filter_.stateSize();
  *functional = Eigen::VectorXd::Zero(n);
  if (filter_.features().empty()) return 0.0;
  CovarianceMatrix P;
  P.assign(filter_.covariance());
  *functional = gaugeFunctionals(filter_.camera(), filter_.features(), P).col(3);
  Eigen::VectorXd error = Eigen::VectorXd::Zero(n);
  error.head<6>() = poseError(filter_.camera().poseWorldCamera(), truth_);
  for (const FeatureState& feature : filter_.features()) {
    error.segment<3>(feature.offset) =
        world_.points()[slot(point_of_.at(feature.id))] - feature.point_world;
  }
  return functional->dot(error);
}

void CorridorRun::addPoints(const std::vector<int>& world_points) {
  if (world_points.empty()) return;
  Eigen::VectorXd scale;
  const double scale_error = relativeScale(&scale);
  const CameraState& camera = filter_.camera();
  const Eigen::Matrix3d R = camera.q_world_camera.toRotationMatrix();
  const Index size = filter_.stateSize(), count = static_cast<Index>(world_points.size());
  MatrixXd J = MatrixXd::Zero(3 * count, size);
  MatrixXd own = MatrixXd::Zero(3 * count, 3 * count);
  const double depth_sigma = frame_ == 0 ? kStartDepthSigma : kNewDepthSigma;
  std::vector<Vector3d> points;
  std::vector<int> started;
  for (int point : world_points) {
    const double u = normal(), v = normal(), d = normal();
    const Vector2d pixel = seen_.at(point) + options_.sigma_px * Vector2d(u, v);
    const auto ray = [&](const LensCorrection& lens, const Vector2d& at) {
      return model_.corrected(lens).unproject(at).value_or(Vector3d::UnitZ()).normalized();
    };
    const Vector3d bearing = ray(camera.lens, pixel);
    const double distance = (world_.points()[slot(point)] - truth_.translation()).norm() *
                            (1.0 - scale_error) / (1.0 + depth_sigma * d);
    const Vector3d offset = R * bearing * distance;
    const Index row = 3 * static_cast<Index>(points.size());
    auto block = J.middleRows(row, 3);
    block.middleCols<3>(CameraError::kPosition).setIdentity();
    block.middleCols<3>(CameraError::kRotation) = -skew(offset);
    constexpr double kStep = 1e-6;
    for (int i = 0; i < 4; ++i) {
      LensCorrection lens = camera.lens;
      (i == 0 ? lens.focal : i == 1 ? lens.radial : lens.centre(i - 2)) += kStep;
      block.col(CameraError::kFocal + i) = R * (ray(lens, pixel) - bearing) / kStep * distance;
    }
    block += offset * scale.transpose();
    Eigen::Matrix<double, 3, 2> by_pixel;
    for (int i = 0; i < 2; ++i) {
      by_pixel.col(i) =
          R * (ray(camera.lens, pixel + kStep * Vector2d::Unit(i)) - bearing) / kStep * distance;
    }
    own.block<3, 3>(row, row) = std::pow(options_.sigma_px, 2) * by_pixel * by_pixel.transpose() +
                                std::pow(depth_sigma, 2) * offset * offset.transpose();
    points.push_back(camera.position_world + offset);
    started.push_back(point);
  }
  const MatrixXd cross = J * filter_.covariance();
  own += cross * J.transpose();
  const FeatureId first = filter_.nextId();
  append(filter_, points, cross, 0.5 * (own + own.transpose()));
  for (std::size_t i = 0; i < started.size(); ++i) {
    const FeatureId id = first + static_cast<FeatureId>(i);
    point_of_[id] = started[i];
    last_seen_[id] = frame_;
  }
}

}  // namespace active_matching_slam
