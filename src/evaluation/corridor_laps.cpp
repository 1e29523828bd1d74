#include "active_matching_slam/evaluation/corridor_laps.h"

#include <time.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>
#include <memory>
#include <random>
#include <set>

#include "active_matching_slam/evaluation/consistency.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/filter/state_error.h"
#include "active_matching_slam/information/separator.h"
#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/math/rotation.h"
#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/slot.h"
#include "active_matching_slam/submaps/ekf_active_map.h"
#include "corridor_world.h"

namespace active_matching_slam {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector2d;
using Eigen::Vector3d;
using Ids = std::vector<FeatureId>;

constexpr double kSpeed = 0.9, kRate = 10.0;  // [m/s], [Hz]
// Of a new point, relative: what of a ray is known when it becomes a point. (With a tenth, points
// of three coordinates make the filter too sure by themselves: NEES 12 in place of 6.)
constexpr double kNewDepthSigma = 0.02;
constexpr double kStartDepthSigma = 0.01;  // of the first ones, which give the map its unit
constexpr double kApart_px = 20.0;         // from a frozen point, of a new one
constexpr int kSeenToActivate = 10;        // points of a submap in view
constexpr int kHardlyMeasured = 5;         // a submap of which fewer were is frozen as it was
constexpr int kFreezeInterval = 10;        // frames
constexpr int kActivationMargin = 30;      // features over the maximum: none are activated
constexpr int kSlack = 15;                 // features over the maximum: freeze at once
constexpr int kLoopFrames = 300;           // out of view for so long: a loop

double processorMs() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

double meanValue(const std::vector<double>& values) {
  double sum = 0.0;
  for (double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

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

class CorridorRun {
 public:
  CorridorRun(const CorridorOptions& options, std::uint64_t seed)
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

  CorridorResult run() {
    const double length = CorridorWorld::lapLength();
    const int frames = static_cast<int>(std::round(options_.laps * length / kSpeed * kRate));
    std::vector<double> nees, error, ms;
    int lap = 0;
    LapSummary summary;
    const auto finishLap = [&]() {
      summary.nees = meanValue(nees);
      summary.nees_median = medianOf(nees);
      summary.error_m = meanValue(error);
      summary.frame_ms = medianOf(ms);
      summary.points = static_cast<int>(filter_.features().size()) + tree_.frozenCount();
      summary.trunk = static_cast<int>(tree_.trunk().ids().size());
      summary.leaves = static_cast<int>(tree_.leaves().size());
      result_.laps.push_back(summary);
      summary = {};
      nees.clear();
      error.clear();
      ms.clear();
    };
    for (frame_ = 1; frame_ <= frames; ++frame_) {
      const double walked = kSpeed * frame_ / kRate;
      if (static_cast<int>(walked / length) != lap) {
        finishLap();
        lap = static_cast<int>(walked / length);
      }
      lap_ = lap;
      truth_ = world_.camera(walked, frame_ / kRate);
      const double start = processorMs();
      step();
      ms.push_back(processorMs() - start);
      bound();
      const auto off = poseError(filter_.camera().poseWorldCamera(), truth_);
      error.push_back(off.head<3>().norm());
      const auto value =
          normalisedErrorSquared(off, filter_.cameraCovariance().topLeftCorner<6, 6>());
      nees.push_back(value.value_or(1e9));
      summary.active_most =
          std::max(summary.active_most, static_cast<int>(filter_.features().size()));
    }
    finishLap();
    result_.freeze_ms = medianOf(freeze_ms_);
    result_.activate_ms = medianOf(activate_ms_);
    return result_;
  }

 private:
  double normal() { return normal_(random_); }
  double positionError() const {
    return (filter_.camera().position_world - truth_.translation()).norm();
  }

  /// What is in view, by point of the world.
  void look() {
    seen_.clear();
    for (int i = 0; i < options_.points; ++i) {
      const auto pixel = world_.project(*true_model_, truth_, i);
      if (pixel) seen_[i] = *pixel;
    }
  }

  void step() {
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

  /// New points where few are in view: their directions as measured, their depths known relative
  /// to the scale of what is in the map, so that nothing is told of scale as such.
  void startPoints() {
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
      const bool apart =
          std::all_of(frozen_px.begin(), frozen_px.end(),
                      [&p = pixel](const auto& f) { return (f - p).norm() >= kApart_px; });
      if (apart) candidates.push_back(point);
    }
    std::shuffle(candidates.begin(), candidates.end(), random_);
    const int wanted = std::max(0, options_.measured - in_view);
    if (static_cast<int>(candidates.size()) > wanted) candidates.resize(slot(wanted));
    addPoints(candidates);
  }

  /// How the mean logarithm of lengths in the map differs from the truth, and what it answers to.
  double relativeScale(Eigen::VectorXd* functional) const {
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

  void addPoints(const std::vector<int>& world_points) {
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

  bool isResting(FeatureId id) const { return frame_ - last_seen_.at(id) >= options_.rest_frames; }

  /// The submap of which most is in view, if that is enough.
  bool activate() {
    int most = kSeenToActivate - 1, chosen = -1;
    for (const Leaf& leaf : tree_.leaves()) {
      int in_view = 0;
      for (FeatureId id : leaf.points.ids) in_view += seen_.count(point_of_.at(id)) > 0;
      if (in_view > most) {
        most = in_view;
        chosen = leaf.id;
      }
    }
    if (chosen < 0 || !hasRoom(chosen)) return false;
    const double start = processorMs();
    const Leaf leaf = *tree_.find(chosen);
    // Where much drift is to be taken out, rotation and scale of all that hangs on the active map
    // are transported with it.
    if (isFarOff(leaf)) tree_.activateTrunk(active_, tree_.trunk().ids());
    const Ids members = tree_.activate(active_, chosen);
    activate_ms_.push_back(processorMs() - start);
    activated_.push_back({{members.begin(), members.end()}, leaf.points.given_ids, {}});
    for (FeatureId id : members) frozen_.erase(point_of_.at(id));
    for (FeatureId id : leaf.points.given_ids) frozen_.erase(point_of_.at(id));
    return true;
  }

  /// Whether the active map may take a submap and its separator; makes room if it can.
  bool hasRoom(int leaf) {
    const auto fits = [this, leaf]() {
      const Conditional& points = tree_.find(leaf)->points;
      int size = static_cast<int>(filter_.features().size() + points.ids.size());
      for (FeatureId id : points.given_ids) size += filter_.find(id) == nullptr;
      return size <= options_.maximum_features + kActivationMargin;
    };
    if (fits()) return true;
    restSeparators();
    returnUntouched();
    if (!fits()) freezeOne();
    return fits();
  }

  /// Whether three standard deviations of its place, seen from the camera, exceed a fifth of its
  /// distance.
  bool isFarOff(const Leaf& leaf) const {
    const PointInsertion points =
        pointInsertion(filter_, tree_.givenActive(activePoints(filter_), leaf));
    const Eigen::Matrix3d P_camera = filter_.cameraCovariance().topLeftCorner<3, 3>();
    std::vector<double> ratio;
    for (Index i = 0; i < static_cast<Index>(points.features.size()); ++i) {
      const Eigen::Matrix3d cross = points.cross_covariance.block<3, 3>(3 * i, 0);
      const Eigen::Matrix3d relative =
          points.own_covariance.block<3, 3>(3 * i, 3 * i) + P_camera - cross - cross.transpose();
      const double distance =
          (points.features[slot(static_cast<int>(i))].point_world - filter_.camera().position_world)
              .norm();
      ratio.push_back(3.0 * std::sqrt(relative.diagonal().maxCoeff()) / distance);
    }
    return medianOf(ratio) > 0.2;
  }

  /// Keeps the active map small.
  void bound() {
    if (options_.bound == MapBound::kNone) return;
    const auto excess = [this]() {
      return static_cast<int>(filter_.features().size()) - options_.maximum_features;
    };
    if (excess() <= 0) return;
    if (options_.bound == MapBound::kDelete) {
      std::vector<std::pair<int, FeatureId>> order;
      for (const FeatureState& feature : filter_.features())
        order.emplace_back(last_seen_.at(feature.id), feature.id);
      std::sort(order.begin(), order.end());
      Ids deleted;
      for (int i = 0; i < excess(); ++i) deleted.push_back(order[slot(i)].second);
      for (FeatureId id : deleted) point_of_.erase(id);
      filter_.removeFeatures(deleted);
      return;
    }
    restSeparators();
    if (excess() <= 0) return;
    returnUntouched();
    if (excess() <= 0) return;
    if (frame_ - last_freeze_ >= kFreezeInterval || excess() > kSlack) freezeOne();
  }

  void restSeparators() {
    Ids separators;
    for (const FeatureState& feature : filter_.features()) {
      if (tree_.isSeparator(feature.id) && isResting(feature.id)) separators.push_back(feature.id);
    }
    tree_.rest(active_, separators);
    for (FeatureId id : separators) frozen_.insert(point_of_.at(id));
  }

  /// Submaps that were activated and of which hardly anything was measured go back as they were;
  /// of the others the points are free.
  void returnUntouched() {
    std::vector<Activated> kept;
    for (Activated& leaf : activated_) {
      if (static_cast<int>(leaf.measured.size()) >= kHardlyMeasured) continue;
      const bool all_rest = std::all_of(leaf.members.begin(), leaf.members.end(), [this](auto id) {
        return filter_.find(id) != nullptr && isResting(id) && !tree_.isSeparator(id);
      });
      if (!all_rest) {
        kept.push_back(leaf);
        continue;
      }
      freeze({leaf.members.begin(), leaf.members.end()}, leaf.separator);
    }
    activated_ = kept;
  }

  void freezeOne() {
    Ids candidates;
    for (const FeatureState& feature : filter_.features()) {
      const FeatureId id = feature.id;
      const bool returns = std::any_of(activated_.begin(), activated_.end(), [&](const auto& leaf) {
        return leaf.members.count(id) > 0 &&
               static_cast<int>(leaf.measured.size()) < kHardlyMeasured;
      });
      if (isResting(id) && !tree_.isSeparator(id) && !returns) candidates.push_back(id);
    }
    if (static_cast<int>(candidates.size()) < options_.leaf_minimum) return;
    const int most = options_.leaf_maximum + options_.freeze.separator / 2;
    Ids members =
        options_.borders == SubmapBorders::kInformation ? linked(candidates, most) : candidates;
    if (static_cast<int>(members.size()) > most) members.resize(slot(most));
    const Ids separator = separatorOf(members, options_.borders, options_.freeze);
    const std::set<FeatureId> given(separator.begin(), separator.end());
    Ids left;
    for (FeatureId id : members) {
      if (given.count(id) == 0) left.push_back(id);
    }
    if (static_cast<int>(left.size()) < options_.leaf_minimum) return;
    if (options_.compared_separators > 0) compare(members);
    last_freeze_ = frame_;
    freeze(left, separator);
  }

  Ids separatorOf(const Ids& members, SubmapBorders borders, const FreezeOptions& options) const {
    if (borders == SubmapBorders::kInformation) {
      return tree_.chooseSeparator(active_, members, options, nullptr);
    }
    Ids newest = members;
    std::sort(newest.rbegin(), newest.rend());
    if (static_cast<int>(newest.size()) > options.separator) newest.resize(slot(options.separator));
    return newest;
  }

  /// What the same submap would lose by either separator.
  void compare(const Ids& members) {
    FreezeOptions options;
    options.separator = options_.compared_separators;
    options.enough_bits = options.preference_bits = 0.0;
    ComparedBits bits;
    bits.lap = lap_;
    for (SubmapBorders borders : {SubmapBorders::kInformation, SubmapBorders::kNaive}) {
      Ekf filter = filter_;
      EkfActiveMap map(filter);
      SubmapTree tree = tree_;
      const Ids separator = separatorOf(members, borders, options);
      const int id = tree.freeze(map, members, separator, {}, options);
      (borders == SubmapBorders::kInformation ? bits.information_bits : bits.naive_bits) =
          tree.find(id)->lost_bits;
    }
    result_.compared.push_back(bits);
  }

  void freeze(const Ids& members, const Ids& separator) {
    const double start = processorMs();
    Ids resting;
    for (FeatureId id : separator) {
      if (isResting(id)) resting.push_back(id);
    }
    const int id = tree_.freeze(active_, members, separator, resting, options_.freeze);
    freeze_ms_.push_back(processorMs() - start);
    result_.lost_bits.push_back(tree_.find(id)->lost_bits);
    result_.frozen_in_lap.push_back(lap_);
    for (FeatureId member : members) frozen_.insert(point_of_.at(member));
    for (FeatureId member : resting) frozen_.insert(point_of_.at(member));
    for (FeatureId member : separator) {
      if (filter_.find(member) != nullptr) frozen_.erase(point_of_.at(member));
    }
  }

  /// From the one out of view for longest on, always the one with the strongest link to those taken
  /// (Prim's spanning tree): information of pairs given the camera.
  Ids linked(const Ids& candidates, int most) const {
    const MatrixXd P = filter_.covariance();
    std::vector<int> camera, rows;
    for (int row = 0; row < CameraError::kMotionSize; ++row) camera.push_back(row);
    for (FeatureId id : candidates) {
      for (int axis = 0; axis < 3; ++axis) rows.push_back(filter_.find(id)->offset + axis);
    }
    const MatrixXd given = givenSeparator(P, rows, {}, camera).inside;
    const int n = static_cast<int>(candidates.size());
    const auto bits = [&](int a, int b) {
      Eigen::Matrix<double, 6, 6> both;
      const Eigen::Matrix3d A = given.block<3, 3>(3 * a, 3 * a),
                            B = given.block<3, 3>(3 * b, 3 * b);
      const Eigen::Matrix3d X = given.block<3, 3>(3 * a, 3 * b);
      both << A, X, X.transpose(), B;
      return 0.5 * std::log2(A.determinant() * B.determinant() / both.determinant());
    };
    const auto older = [this](FeatureId a, FeatureId b) {
      return std::make_pair(last_seen_.at(a), a) < std::make_pair(last_seen_.at(b), b);
    };
    int next = static_cast<int>(std::min_element(candidates.begin(), candidates.end(), older) -
                                candidates.begin());
    std::vector<double> link(slot(n), -1.0);
    std::vector<char> taken(slot(n), 0);
    Ids result;
    while (next >= 0 && static_cast<int>(result.size()) < most) {
      taken[slot(next)] = 1;
      result.push_back(candidates[slot(next)]);
      int best = -1;
      for (int i = 0; i < n; ++i) {
        if (taken[slot(i)]) continue;
        link[slot(i)] = std::max(link[slot(i)], bits(next, i));
        if (best < 0 || link[slot(i)] > link[slot(best)]) best = i;
      }
      next = best;
    }
    return result;
  }

  struct Activated {
    std::set<FeatureId> members;
    Ids separator;
    std::set<FeatureId> measured;
  };

  CorridorOptions options_;
  CorridorWorld world_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  CameraModel model_;
  std::unique_ptr<CameraModel> true_model_;
  Ekf filter_;
  EkfActiveMap active_;
  SubmapTree tree_;
  Eigen::Isometry3d truth_;
  int frame_ = 0, lap_ = 0, last_freeze_ = 0;
  bool loop_seen_ = false;
  std::map<int, Vector2d> seen_;        ///< in view, by point of the world
  std::map<FeatureId, int> point_of_;   ///< of the world
  std::map<FeatureId, int> last_seen_;  ///< frame
  std::set<int> frozen_;                ///< points of the world in trunk and leaves
  std::vector<Activated> activated_;
  std::vector<double> freeze_ms_, activate_ms_;
  CorridorResult result_;
};

}  // namespace

CorridorResult runCorridorLaps(const CorridorOptions& options, std::uint64_t seed) {
  return CorridorRun(options, seed).run();
}

}  // namespace active_matching_slam
