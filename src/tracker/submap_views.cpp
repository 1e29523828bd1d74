// Where features that were laid aside are now, which of them should be seen, and which submaps are
// worth a look.

#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/submaps/ekf_active_map.h"
#include "submap_keeper.h"

namespace active_matching_slam {
namespace {

/// Of these, in view, for it to be searched. Derivation: what a relocalisation must find.
constexpr int kLeastInView = 10;
/// Three sigma of a place relative to the camera, over its depth, up to which it is searched where
/// it is predicted. Derivation: the search region is then as wide as a tenth of a view of 90
/// degrees to either side, and templates are warped for a scale that is right to 20 %.
constexpr double kSearchableSigma3 = 0.2;

/// x_active as SubmapTree takes it, without the covariance.
PointGaussian activeMeans(const Ekf& filter) {
  PointGaussian means;
  for (const FeatureState& feature : filter.features())
    if (feature.kind == FeatureKind::kPoint) means.ids.push_back(feature.id);
  const CameraState& camera = filter.camera();
  means.mean.resize(CameraError::kCalibrationSize +
                    3 * static_cast<Eigen::Index>(means.ids.size()));
  means.mean.head<CameraError::kCalibrationSize>() << camera.readout_s, camera.lens.focal,
      camera.lens.radial, camera.lens.centre;
  Eigen::Index row = CameraError::kCalibrationSize;
  for (const FeatureState& feature : filter.features()) {
    if (feature.kind != FeatureKind::kPoint) continue;
    means.mean.segment<3>(row) = feature.point_world;
    row += 3;
  }
  return means;
}

void append(const Conditional& points, const Eigen::VectorXd& mean, PointGaussian* means) {
  means->ids.insert(means->ids.end(), points.ids.begin(), points.ids.end());
  Eigen::VectorXd joined(means->mean.size() + mean.size());
  joined << means->mean, mean;
  means->mean.swap(joined);
}

}  // namespace

std::map<FeatureId, Eigen::Vector3d> SubmapKeeper::positions(const Ekf& filter) const {
  std::map<FeatureId, Eigen::Vector3d> result;
  if (tree_.empty()) return result;
  const auto add = [&result](const std::vector<FeatureId>& ids, const Eigen::VectorXd& mean) {
    for (std::size_t i = 0; i < ids.size(); ++i)
      result[ids[i]] = mean.segment<3>(3 * static_cast<Eigen::Index>(i));
  };
  PointGaussian means = activeMeans(filter);
  if (!tree_.trunk().empty()) {
    const Conditional& trunk = tree_.trunk().conditional();
    const Eigen::VectorXd mean = trunk.meanAt(means);
    add(trunk.ids, mean);
    append(trunk, mean, &means);
  }
  for (const Leaf& leaf : tree_.leaves()) add(leaf.points.ids, leaf.points.meanAt(means));
  return result;
}

std::vector<FrozenView> SubmapKeeper::visible(const std::map<FeatureId, Eigen::Vector3d>& positions,
                                              const Ekf& filter, const CameraModel& camera,
                                              const MapOptions& options, double border_px) const {
  std::vector<FrozenView> views;
  const Eigen::Isometry3d T_world_camera = filter.camera().poseWorldCamera();
  const double maximum_angle = options.maximum_view_angle_deg * M_PI / 180.0;
  const auto look = [&](const std::vector<FeatureId>& ids, int leaf) {
    for (const FeatureId id : ids) {
      const auto feature = features_.find(id);
      const auto position = positions.find(id);
      if (feature == features_.end() || position == positions.end()) continue;
      const auto view = predictFlatView(feature->second.patch, camera, T_world_camera,
                                        position->second.homogeneous());
      if (view && camera.isInImage(view->pixel, border_px) &&
          view->view_angle_rad <= maximum_angle && view->scale >= options.minimum_scale &&
          view->scale <= options.maximum_scale)
        views.push_back({id, leaf, position->second, view->pixel});
    }
  };
  look(tree_.trunk().ids(), -1);
  for (const Leaf& leaf : tree_.leaves()) look(leaf.points.ids, leaf.id);
  return views;
}

namespace {

/// Whether most of the `views` lie where they are predicted relative to the camera.
bool areSearchable(const std::vector<const FrozenView*>& views, const Conditional& points,
                   const Ekf& filter) {
  const PointInsertion joint = pointInsertion(filter, points);
  const auto P = filter.covariance();
  std::size_t searchable = 0;
  for (const FrozenView* view : views) {
    for (std::size_t k = 0; k < joint.features.size(); ++k) {
      if (joint.features[k].id != view->id) continue;
      const auto row = 3 * static_cast<Eigen::Index>(k);
      const Eigen::Matrix3d cross = joint.cross_covariance.block<3, 3>(row, CameraError::kPosition);
      const Eigen::Matrix3d relative =
          joint.own_covariance.block<3, 3>(row, row) +
          P.block<3, 3>(CameraError::kPosition, CameraError::kPosition) - cross - cross.transpose();
      const double distance = (view->position_world - filter.camera().position_world).norm();
      // The largest variance, from above.
      if (9.0 * relative.trace() <= std::pow(kSearchableSigma3 * distance, 2)) ++searchable;
    }
  }
  return 2 * searchable > views.size();
}

}  // namespace

int SubmapKeeper::submapInView(const std::vector<FrozenView>& views, const Ekf& filter) const {
  std::map<int, std::vector<const FrozenView*>> of_leaf;
  for (const FrozenView& view : views)
    if (view.leaf >= 0 && mistrusted_.count(view.id) == 0) of_leaf[view.leaf].push_back(&view);
  std::vector<std::pair<std::size_t, int>> most;
  for (const auto& [leaf, seen] : of_leaf)
    if (seen.size() >= kLeastInView) most.emplace_back(seen.size(), leaf);
  if (most.empty()) return -1;
  const int best = std::max_element(most.begin(), most.end())->second;
  const Conditional points = tree_.givenActive(activePoints(filter), *tree_.find(best));
  return areSearchable(of_leaf[best], points, filter) ? best : -1;
}

std::vector<FeatureId> SubmapKeeper::separatorsInView(const std::vector<FrozenView>& views,
                                                      const Ekf& filter) const {
  std::vector<const FrozenView*> seen;
  std::vector<FeatureId> ids;
  for (const FrozenView& view : views) {
    if (view.leaf >= 0 || unsearched_.count(view.id) > 0) continue;
    seen.push_back(&view);
    ids.push_back(view.id);
  }
  if (ids.size() < kLeastSeparators) return {};
  const Conditional points = tree_.givenActive(activePoints(filter), ids);
  return areSearchable(seen, points, filter) ? ids : std::vector<FeatureId>();
}

namespace {

/// A submap as a ball, and where it was seen from.
struct Ball {
  FeatureId middle = -1;  ///< its feature nearest to the centre
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  double radius = 0.0;
  Eigen::Vector3d seen_from = Eigen::Vector3d::Zero();
};

/// Whether a ball, as far off its place as `sigma3`, may be in view from where it can be matched.
bool mayBeInView(const Ball& ball, double sigma3, const Ekf& filter, const CameraModel& camera,
                 const MapOptions& options) {
  const Eigen::Isometry3d T_world_camera = filter.camera().poseWorldCamera();
  const Eigen::Vector3d from_camera = ball.centre - T_world_camera.translation();
  const double distance = from_camera.norm(), reach = ball.radius + sigma3;
  const double first_distance = (ball.centre - ball.seen_from).norm();
  if (distance - reach > first_distance / options.minimum_scale ||
      distance + reach < first_distance / options.maximum_scale)
    return false;
  if (distance <= reach) return true;
  const double spread = std::asin(reach / distance);
  const auto angle = [](const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
    return std::atan2(a.cross(b).norm(), a.dot(b));
  };
  if (angle(-from_camera, ball.seen_from - ball.centre) - spread >
      options.maximum_view_angle_deg * M_PI / 180.0)
    return false;
  const double half_view =
      std::atan2(0.5 * std::hypot(camera.width(), camera.height()), camera.calibration().fx);
  return angle(from_camera, T_world_camera.linear().col(2)) - spread < half_view;
}

}  // namespace

std::vector<int> SubmapKeeper::loopCandidates(const std::map<FeatureId, Eigen::Vector3d>& positions,
                                              const Ekf& filter, const CameraModel& camera,
                                              const MapOptions& options, int most) {
  // Cost: of each, a product with the map's covariance; what changes slowly is asked for in turn.
  constexpr int kSigmasPerLook = 4;
  const std::vector<Leaf>& leaves = tree_.leaves();
  std::vector<Ball> balls;
  for (const Leaf& leaf : leaves) {
    Ball ball;
    const auto count = static_cast<double>(leaf.points.ids.size());
    for (const FeatureId id : leaf.points.ids) {
      ball.centre += positions.at(id) / count;
      ball.seen_from += features_.at(id).patch.T_world_camera.translation() / count;
    }
    double nearest = std::numeric_limits<double>::infinity();
    for (const FeatureId id : leaf.points.ids) {
      const double distance = (positions.at(id) - ball.centre).norm();
      ball.radius = std::max(ball.radius, distance);
      if (distance < nearest) ball.middle = id;
      nearest = std::min(nearest, distance);
    }
    balls.push_back(ball);
  }
  const PointGaussian active = activePoints(filter);
  const int asked = std::min(kSigmasPerLook, static_cast<int>(leaves.size()));
  for (int k = 0; k < asked; ++k) {
    const std::size_t i = static_cast<std::size_t>(next_sigma_++) % leaves.size();
    Leaf middle = leaves[i];
    middle.points = marginal(middle.points, {balls[i].middle});
    const PointInsertion joint = pointInsertion(filter, tree_.givenActive(active, middle));
    const Eigen::Matrix3d cross = joint.cross_covariance.middleCols<3>(CameraError::kPosition);
    const double variance =
        (joint.own_covariance + filter.cameraCovariance().topLeftCorner<3, 3>() - cross -
         cross.transpose())
            .trace();
    sigma_of_[leaves[i].id] = std::sqrt(std::max(variance, 0.0));
  }
  std::vector<std::pair<int, int>> found;  // when looked at, id
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const auto sigma = sigma_of_.find(leaves[i].id);
    if (sigma == sigma_of_.end()) continue;
    const double distance = (balls[i].centre - filter.camera().position_world).norm();
    const bool is_mistrusted = mistrusted_.count(balls[i].middle) > 0;
    if (3.0 * sigma->second <= kSearchableSigma3 * distance && !is_mistrusted) continue;
    if (mayBeInView(balls[i], 3.0 * sigma->second, filter, camera, options))
      found.emplace_back(looked_at_[leaves[i].id], leaves[i].id);
  }
  std::sort(found.begin(), found.end());
  std::vector<int> chosen;
  ++looks_;
  for (const auto& [looked_at, id] : found) {
    if (static_cast<int>(chosen.size()) == most) break;
    chosen.push_back(id);
    looked_at_[id] = looks_;
  }
  return chosen;
}

std::vector<int> SubmapKeeper::inTurn(int most) {
  const auto count = static_cast<int>(tree_.leaves().size());
  std::vector<int> chosen;
  for (int k = 0; k < std::min(most, count); ++k)
    chosen.push_back(
        tree_.leaves()[static_cast<std::size_t>(count - 1 - next_in_turn_++ % count)].id);
  return chosen;
}

std::vector<Landmark> SubmapKeeper::landmarks(
    int leaf, const std::map<FeatureId, Eigen::Vector3d>& positions) const {
  std::vector<Landmark> found;
  const Leaf* submap = tree_.find(leaf);
  if (!submap) return found;
  std::vector<FeatureId> ids = submap->points.ids;
  std::sort(ids.begin(), ids.end());
  for (const FeatureId id : ids) {
    Landmark landmark{&features_.at(id), {}};
    landmark.state.id = id;
    landmark.state.kind = FeatureKind::kPoint;
    landmark.state.point_world = positions.at(id);
    found.push_back(landmark);
  }
  return found;
}

void SubmapKeeper::movePatches(const std::map<FeatureId, Eigen::Vector3d>& before,
                               const Ekf& filter) {
  for (const auto& [id, position] : positions(filter)) {
    const auto old = before.find(id);
    if (old != before.end())
      features_.at(id).patch.T_world_camera.translation() += position - old->second;
  }
}

}  // namespace active_matching_slam
