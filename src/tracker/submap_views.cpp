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

/// At most `most` of the views, spread evenly over them.
std::vector<const FrozenView*> someOf(const std::vector<const FrozenView*>& views,
                                      std::size_t most) {
  if (views.size() <= most) return views;
  std::vector<const FrozenView*> some;
  for (std::size_t k = 0; k < most; ++k) some.push_back(views[k * views.size() / most]);
  return some;
}

std::vector<FeatureId> idsOf(const std::vector<const FrozenView*>& views) {
  std::vector<FeatureId> ids;
  for (const FrozenView* view : views) ids.push_back(view->id);
  return ids;
}

/// Whether most of the `views`, whose points are given, lie where they are predicted relative to
/// the camera.
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
    if (view.leaf >= 0 && missed_.count(view.leaf) == 0) of_leaf[view.leaf].push_back(&view);
  std::vector<std::pair<std::size_t, int>> most;
  for (const auto& [leaf, seen] : of_leaf)
    if (seen.size() >= kLeastInView) most.emplace_back(seen.size(), leaf);
  if (most.empty()) return -1;
  const int best = std::max_element(most.begin(), most.end())->second;
  const std::vector<const FrozenView*> some = someOf(of_leaf[best], kLeastInView);
  Leaf seen = *tree_.find(best);
  seen.points = marginal(seen.points, idsOf(some));
  const Conditional points = tree_.givenActive(activePoints(filter), seen);
  return areSearchable(some, points, filter) ? best : -1;
}

bool SubmapKeeper::isPlaceKnown(const Ekf& filter, double stamp_s) const {
  return std::any_of(last_returned_.begin(), last_returned_.end(),
                     [&](FeatureId id) { return filter.find(id) && !isResting(id, stamp_s); });
}

std::vector<FeatureId> SubmapKeeper::separatorsInView(const std::vector<FrozenView>& views,
                                                      const Ekf& filter) const {
  std::vector<const FrozenView*> seen;
  std::vector<FeatureId> ids;
  for (const FrozenView& view : views) {
    if (view.leaf >= 0 || isUnsearched(view.id)) continue;
    seen.push_back(&view);
    ids.push_back(view.id);
  }
  if (ids.size() < kLeastSeparators) return {};
  const std::vector<const FrozenView*> some = someOf(seen, kLeastInView);
  const Conditional points = tree_.givenActive(activePoints(filter), idsOf(some));
  return areSearchable(some, points, filter) ? ids : std::vector<FeatureId>();
}

namespace {

/// Of a viewpoint, relative to the distance, or a turn [rad], up to which a look in vain need not
/// be made anew. Derivation: corners are described at scales that stand 1.26 apart: what has
/// changed by less is the same to them.
constexpr double kNewView = 0.26;

double angleBetween(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b));
}

/// Whether a feature, as far off its place as `sigma3`, may be in view from where its patch can be
/// matched.
bool mayBeInView(const Eigen::Vector3d& position, const SourcePatch& patch, double sigma3,
                 const Eigen::Isometry3d& T_world_camera, double half_view,
                 const MapOptions& options) {
  const Eigen::Vector3d from_camera = position - T_world_camera.translation();
  const Eigen::Vector3d to_first = patch.T_world_camera.translation() - position;
  const double distance = from_camera.norm(), first_distance = to_first.norm();
  if (distance - sigma3 > first_distance / options.minimum_scale ||
      distance + sigma3 < first_distance / options.maximum_scale)
    return false;
  if (distance <= sigma3) return true;
  const double spread = std::asin(sigma3 / distance);
  return angleBetween(-from_camera, to_first) - spread <=
             options.maximum_view_angle_deg * M_PI / 180.0 &&
         angleBetween(from_camera, T_world_camera.linear().col(2)) - spread < half_view;
}

/// Of a leaf: its centre, and the feature nearest to that.
struct Middle {
  FeatureId id = -1;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
};

Middle middleOf(const Leaf& leaf, const std::map<FeatureId, Eigen::Vector3d>& positions) {
  Middle middle;
  for (const FeatureId id : leaf.points.ids)
    middle.centre += positions.at(id) / static_cast<double>(leaf.points.ids.size());
  double nearest = std::numeric_limits<double>::infinity();
  for (const FeatureId id : leaf.points.ids) {
    const double distance = (positions.at(id) - middle.centre).norm();
    if (distance < nearest) middle.id = id;
    nearest = std::min(nearest, distance);
  }
  return middle;
}

}  // namespace

/// Standard deviation of a leaf's middle relative to the camera.
double SubmapKeeper::relativeSigma(const Leaf& leaf, FeatureId middle, const PointGaussian& active,
                                   const Ekf& filter) const {
  Leaf one = leaf;
  one.points = marginal(leaf.points, {middle});
  const PointInsertion joint = pointInsertion(filter, tree_.givenActive(active, one));
  const Eigen::Matrix3d cross = joint.cross_covariance.middleCols<3>(CameraError::kPosition);
  const double variance = (joint.own_covariance + filter.cameraCovariance().topLeftCorner<3, 3>() -
                           cross - cross.transpose())
                              .trace();
  return std::sqrt(std::max(variance, 0.0));
}

std::vector<int> SubmapKeeper::loopCandidates(const std::map<FeatureId, Eigen::Vector3d>& positions,
                                              const Ekf& filter, const CameraModel& camera,
                                              const MapOptions& options, int most) {
  // Cost: of each, a product with the map's covariance; what changes slowly is asked for in turn.
  constexpr int kSigmasPerLook = 4;
  const std::vector<Leaf>& leaves = tree_.leaves();
  const PointGaussian active = activePoints(filter);
  const int asked = std::min(kSigmasPerLook, static_cast<int>(leaves.size()));
  for (int k = 0; k < asked; ++k) {
    const Leaf& leaf = leaves[static_cast<std::size_t>(next_sigma_++) % leaves.size()];
    sigma_of_[leaf.id] = relativeSigma(leaf, middleOf(leaf, positions).id, active, filter);
  }
  const Eigen::Isometry3d T_world_camera = filter.camera().poseWorldCamera();
  const double half_view =
      std::atan2(0.5 * std::hypot(camera.width(), camera.height()), camera.calibration().fx);
  std::vector<std::pair<int, int>> found;  // when looked at, id
  for (const Leaf& leaf : leaves) {
    const auto sigma = sigma_of_.find(leaf.id);
    if (sigma == sigma_of_.end()) continue;
    const Middle middle = middleOf(leaf, positions);
    const double distance = (middle.centre - T_world_camera.translation()).norm();
    if (3.0 * sigma->second <= kSearchableSigma3 * distance && missed_.count(leaf.id) == 0)
      continue;
    const auto last = looked_from_.find(leaf.id);
    if (last != looked_from_.end()) {
      const Eigen::Isometry3d T_last_now = last->second.inverse() * T_world_camera;
      if (T_last_now.translation().norm() < kNewView * distance &&
          Eigen::AngleAxisd(T_last_now.linear()).angle() < kNewView)
        continue;
    }
    std::size_t in_view = 0;
    for (const FeatureId id : leaf.points.ids)
      if (mayBeInView(positions.at(id), features_.at(id).patch, 3.0 * sigma->second, T_world_camera,
                      half_view, options))
        ++in_view;
    if (in_view >= kLeastInView) found.emplace_back(looked_at_[leaf.id], leaf.id);
  }
  std::sort(found.begin(), found.end());
  std::vector<int> chosen;
  ++looks_;
  for (const auto& [looked_at, id] : found) {
    if (static_cast<int>(chosen.size()) == most) break;
    chosen.push_back(id);
    looked_at_[id] = looks_;
    looked_from_[id] = T_world_camera;
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
