#include "submap_keeper.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/submaps/ekf_active_map.h"

namespace active_matching_slam {
namespace {

/// Standard deviation of an inverse depth, relative, up to which a ray becomes a point to be laid
/// aside. Derivation: the depth's mean is then off, for its being no Gaussian, by as large a part
/// of its standard deviation.
constexpr double kPointSigma = 0.06;
/// Features of a submap at least. Derivation: twice what a relocalisation must find
/// (relocaliser/minimum_inliers), of which half may be hidden or have changed.
constexpr int kLeastLeaf = 20;
/// Of these, in view, for it to be searched. Derivation: what a relocalisation must find.
constexpr int kLeastInView = 10;
/// Out of view for so long a feature may be laid aside [s]. Cost: less, and a glance aside moves
/// features to and fro; more, and a full map waits.
constexpr double kRestS = 1.5;
/// Between two times that features are laid aside [s]. Cost: it takes as long as some frames.
constexpr double kFreezePeriodS = 1.0;
/// Separators that go to the trunk or come back together at least. Cost: each time is a
/// factorisation of the map's covariance.
constexpr std::size_t kLeastSeparators = 4;
/// Three sigma of a place relative to the camera, over its depth, up to which it is searched where
/// it is predicted. Derivation: the search region is then as wide as a tenth of a view of 90
/// degrees to either side, and templates are warped for a scale that is right to 20 %.
constexpr double kSearchableSigma3 = 0.2;
/// Matches by which a submap that was made active has been found. Derivation: a pose takes three
/// points; chance does not match as many again.
constexpr int kFoundMatches = 6;

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

/// 2 log2 e times the information of two positions: logarithms of determinants.
double logDeterminant(const Eigen::Ref<const Eigen::MatrixXd>& P) {
  const Eigen::LLT<Eigen::MatrixXd> factor(P);
  if (factor.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
  return 2.0 * Eigen::MatrixXd(factor.matrixL()).diagonal().array().log().sum();
}

/// `count` of the candidates that hang together: the first one, and then ever the one that shares
/// most information, given the camera, with one that is taken (Prim's way through the maximum
/// spanning tree of the graph of mutual information).
std::vector<FeatureId> relatedTo(const std::vector<FeatureId>& candidates, std::size_t count,
                                 const Ekf& filter) {
  if (candidates.size() <= count) return candidates;
  const auto n = static_cast<Eigen::Index>(candidates.size());
  constexpr int kMotion = CameraError::kMotionSize;
  const auto P = filter.covariance();
  Eigen::MatrixXd own(3 * n, 3 * n), by_camera(3 * n, kMotion);
  for (Eigen::Index i = 0; i < n; ++i) {
    const int a = filter.find(candidates[static_cast<std::size_t>(i)])->offset;
    by_camera.middleRows<3>(3 * i) = P.block<3, kMotion>(a, 0);
    for (Eigen::Index j = 0; j < n; ++j)
      own.block<3, 3>(3 * i, 3 * j) =
          P.block<3, 3>(a, filter.find(candidates[static_cast<std::size_t>(j)])->offset);
  }
  const Eigen::LDLT<MotionCovariance> camera(filter.cameraCovariance());
  own -= by_camera * camera.solve(by_camera.transpose());
  std::vector<double> alone(candidates.size());
  for (Eigen::Index i = 0; i < n; ++i)
    alone[static_cast<std::size_t>(i)] = logDeterminant(own.block<3, 3>(3 * i, 3 * i));
  std::vector<double> shared(candidates.size(), -1.0);
  std::vector<char> is_taken(candidates.size(), 0);
  std::vector<FeatureId> taken;
  std::size_t next = 0;
  while (true) {
    is_taken[next] = 1;
    taken.push_back(candidates[next]);
    if (taken.size() == count) return taken;
    const auto a = static_cast<Eigen::Index>(next);
    std::size_t best = candidates.size();
    for (std::size_t k = 0; k < candidates.size(); ++k) {
      if (is_taken[k]) continue;
      const auto b = static_cast<Eigen::Index>(k);
      Eigen::Matrix<double, 6, 6> both;
      both << own.block<3, 3>(3 * a, 3 * a), own.block<3, 3>(3 * a, 3 * b),
          own.block<3, 3>(3 * b, 3 * a), own.block<3, 3>(3 * b, 3 * b);
      const double information = alone[next] + alone[k] - logDeterminant(both);
      if (std::isfinite(information)) shared[k] = std::max(shared[k], information);
      if (best == candidates.size() || shared[k] > shared[best]) best = k;
    }
    next = best;
  }
}

bool isWellKnown(const FeatureState& feature, const Ekf& filter) {
  return feature.kind == FeatureKind::kPoint ||
         filter.sigmaInverseDepth(feature) < kPointSigma * feature.inverse_depth;
}

/// Makes points of rays, to first order: what is laid aside are points.
void makePoints(const std::vector<FeatureId>& ids, Ekf* filter) {
  std::vector<FeatureState> points;
  std::vector<FeatureId> rays;
  std::vector<int> kept;  // rows of the state without the rays
  for (int row = 0; row < cameraErrorSize(filter->camera()); ++row) kept.push_back(row);
  for (const FeatureState& feature : filter->features()) {
    const bool is_asked = std::find(ids.begin(), ids.end(), feature.id) != ids.end();
    if (feature.kind == FeatureKind::kPoint || !is_asked) {
      for (int k = 0; k < feature.size(); ++k) kept.push_back(feature.offset + k);
      continue;
    }
    points.push_back(feature);
    rays.push_back(feature.id);
  }
  if (rays.empty()) return;
  const auto rows = 3 * static_cast<Eigen::Index>(points.size());
  Eigen::MatrixXd J = Eigen::MatrixXd::Zero(rows, filter->stateSize());
  for (std::size_t i = 0; i < points.size(); ++i) {
    FeatureState& ray = points[i];
    const double depth = 1.0 / ray.inverse_depth;
    auto own = J.middleRows<3>(3 * static_cast<Eigen::Index>(i));
    if (ray.hasAnchorError()) own.middleCols<3>(ray.offset).setIdentity();
    own.middleCols<2>(ray.bearingRow()) = depth * ray.tangentBasis();
    own.col(ray.inverseDepthRow()) = -depth * depth * ray.bearing_world;
    ray.point_world = ray.position();
    ray.kind = FeatureKind::kPoint;
    ray.anchored_at_origin = false;
  }
  const Eigen::MatrixXd JP = J * filter->covariance();
  const Eigen::MatrixXd covariance = JP * J.transpose();
  Eigen::MatrixXd cross(rows, static_cast<Eigen::Index>(kept.size()));
  for (std::size_t k = 0; k < kept.size(); ++k)
    cross.col(static_cast<Eigen::Index>(k)) = JP.col(kept[k]);
  filter->removeFeatures(rays);
  filter->insertFeatures(points, 0.5 * (covariance + covariance.transpose()), cross);
}

}  // namespace

void SubmapKeeper::clear() {
  const SubmapFilterOptions options = options_;
  *this = SubmapKeeper(options);
}

void SubmapKeeper::rescale(double factor) {
  tree_.rescale(factor);
  for (auto& [id, feature] : features_) feature.patch.T_world_camera.translation() *= factor;
}

void SubmapKeeper::openTrunk(Ekf* filter) {
  opened_ = tree_.trunk().ids();
  if (opened_.empty()) return;
  EkfActiveMap active(*filter);
  tree_.activateTrunk(active, std::vector<FeatureId>(opened_));
}

void SubmapKeeper::closeTrunk(Ekf* filter) {
  if (opened_.empty()) return;
  EkfActiveMap active(*filter);
  tree_.rest(active, opened_);
  opened_.clear();
}

void SubmapKeeper::observe(const std::vector<VisibleFeature>& visible,
                           const std::vector<FeatureId>& behind_mask, const FeatureMap& map,
                           double stamp_s) {
  if (!isEnabled()) return;
  for (const VisibleFeature& feature : visible) last_in_view_s_[feature.id] = stamp_s;
  for (const FeatureId id : behind_mask) last_in_view_s_[id] = stamp_s;
  for (const MapFeature& feature : map.features()) last_in_view_s_.emplace(feature.id, stamp_s);
  const auto isFound = [&map](const Returned& returned) {
    int matched = 0, left = 0;
    for (const auto& [id, successes] : returned.successes) {
      const MapFeature* feature = map.find(id);
      if (!feature) continue;
      ++left;
      if (feature->successes > successes) ++matched;
    }
    return matched >= kFoundMatches || left == 0;
  };
  returned_.erase(std::remove_if(returned_.begin(), returned_.end(), isFound), returned_.end());
}

std::vector<FeatureId> SubmapKeeper::remove(const std::vector<FeatureId>& ids, Ekf* filter,
                                            const FeatureMap& map) {
  std::vector<FeatureId> gone, points, rays;
  for (const FeatureId id : ids) {
    const FeatureState* state = filter->find(id);
    if (!state || !map.find(id)) continue;
    const bool is_on_trial =
        std::any_of(returned_.begin(), returned_.end(),
                    [id](const Returned& returned) { return returned.successes.count(id) > 0; });
    if (is_on_trial) mistrusted_.insert(id);
    if (is_on_trial || isPinned(id)) {
      unsearched_.insert(id);
      continue;
    }
    gone.push_back(id);
    (state->kind == FeatureKind::kPoint ? points : rays).push_back(id);
    last_in_view_s_.erase(id);
    unsearched_.erase(id);
  }
  filter->removeFeatures(rays);
  if (tree_.trunk().empty()) {
    filter->removeFeatures(points);
  } else {
    EkfActiveMap active(*filter);
    tree_.remove(active, points);
  }
  return gone;
}

bool SubmapKeeper::isResting(FeatureId id, double stamp_s) const {
  const auto last = last_in_view_s_.find(id);
  return last != last_in_view_s_.end() && stamp_s - last->second >= kRestS;
}

/// Features that may be laid aside, those out of view for longest first.
std::vector<FeatureId> SubmapKeeper::candidates(double stamp_s, const Ekf& filter,
                                                const FeatureMap& map) const {
  std::vector<std::pair<double, FeatureId>> found;
  for (const MapFeature& feature : map.features()) {
    if (feature.known || isPinned(feature.id) || !isResting(feature.id, stamp_s)) continue;
    if (!isWellKnown(*filter.find(feature.id), filter)) continue;
    found.emplace_back(last_in_view_s_.at(feature.id), feature.id);
  }
  std::sort(found.begin(), found.end());
  std::vector<FeatureId> ids;
  for (const auto& [since, id] : found) ids.push_back(id);
  return ids;
}

/// After the tree has moved features: what is in the filter is in the map, and the rest here.
void SubmapKeeper::exchange(double stamp_s, Ekf* filter, FeatureMap* map) {
  std::vector<FeatureId> gone;
  for (const MapFeature& feature : map->features())
    if (!filter->find(feature.id)) gone.push_back(feature.id);
  for (MapFeature& feature : map->take(gone)) {
    last_in_view_s_.erase(feature.id);
    features_.insert_or_assign(feature.id, std::move(feature));
  }
  for (auto it = features_.begin(); it != features_.end();) {
    if (!filter->find(it->first)) {
      ++it;
      continue;
    }
    it->second.information_bits = -1.0;  // of the camera, as it is now, they have told nothing yet
    it->second.behind_mask = false;
    last_in_view_s_[it->first] = stamp_s;
    map->add(std::move(it->second));
    it = features_.erase(it);
  }
}

bool SubmapKeeper::layAside(double stamp_s, Ekf* filter, FeatureMap* map) {
  if (!isEnabled() || stamp_s - last_freeze_s_ < kFreezePeriodS ||
      static_cast<int>(tree_.trunk().ids().size()) >= options_.trunk_features)
    return false;
  const std::vector<FeatureId> resting = candidates(stamp_s, *filter, *map);
  if (static_cast<int>(resting.size()) < kLeastLeaf) return false;
  last_freeze_s_ = stamp_s;
  makePoints(resting, filter);
  const std::vector<FeatureId> chosen =
      relatedTo(resting, static_cast<std::size_t>(options_.leaf_features), *filter);
  FreezeOptions cut;
  cut.separator = options_.separator_features;
  EkfActiveMap active(*filter);
  const std::vector<FeatureId> separator = tree_.chooseSeparator(active, chosen, cut, nullptr);
  std::vector<FeatureId> points, out_of_view;
  for (const FeatureId id : chosen)
    if (std::find(separator.begin(), separator.end(), id) == separator.end()) points.push_back(id);
  if (static_cast<int>(points.size()) < kLeastLeaf) return false;
  for (const FeatureId id : separator)
    if (!filter->find(id) || isResting(id, stamp_s)) out_of_view.push_back(id);
  tree_.freeze(active, points, separator, out_of_view, cut);
  for (const FeatureId id : points) unsearched_.erase(id);
  exchange(stamp_s, filter, map);
  ++frozen_;
  return true;
}

void SubmapKeeper::restSeparators(double stamp_s, Ekf* filter, FeatureMap* map) {
  if (!isEnabled() || stamp_s - last_rest_s_ < kFreezePeriodS) return;
  std::vector<FeatureId> resting;
  for (const MapFeature& feature : map->features())
    if (isPinned(feature.id) && !feature.known && isResting(feature.id, stamp_s))
      resting.push_back(feature.id);
  if (resting.size() < kLeastSeparators) return;
  last_rest_s_ = stamp_s;
  EkfActiveMap active(*filter);
  tree_.rest(active, resting);
  exchange(stamp_s, filter, map);
}

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

bool SubmapKeeper::activate(int leaf, double stamp_s, int most_features, Ekf* filter,
                            FeatureMap* map) {
  const Leaf* found = tree_.find(leaf);
  if (!found) return false;
  int added = static_cast<int>(found->points.ids.size());
  for (const FeatureId id : found->points.given_ids)
    if (!filter->find(id)) ++added;
  if (map->size() + added > most_features + kSlack) {
    layAside(stamp_s, filter, map);
    if (map->size() + added > most_features + kSlack) return false;
    if (!tree_.find(leaf)) return false;
  }
  EkfActiveMap active(*filter);
  const std::vector<FeatureId> ids = tree_.activate(active, leaf);
  exchange(stamp_s, filter, map);
  Returned returned;
  for (const FeatureId id : ids) {
    unsearched_.erase(id);
    returned.successes[id] = map->find(id)->successes;
  }
  returned_.push_back(std::move(returned));
  ++found_;
  return true;
}

void SubmapKeeper::activateSeparators(const std::vector<FeatureId>& ids, double stamp_s,
                                      Ekf* filter, FeatureMap* map) {
  EkfActiveMap active(*filter);
  tree_.activateTrunk(active, ids);
  exchange(stamp_s, filter, map);
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

namespace {

StoredSubmap stored(const Conditional& points, int id, double lost_bits) {
  return {id,          lost_bits,         points.ids, points.given_ids,
          points.mean, points.given_mean, points.K,   points.Q};
}

Conditional conditionalOf(const StoredSubmap& stored) {
  return {stored.ids, stored.mean, stored.given_ids, stored.given_mean, stored.K, stored.Q};
}

}  // namespace

void SubmapKeeper::save(const Ekf& filter, MapFileContent* content) const {
  if (tree_.empty()) return;
  Trunk trunk = tree_.trunk();
  trunk.refresh(activePoints(filter));
  content->trunk = stored(trunk.conditional(), -1, 0.0);
  if (trunk.empty()) content->trunk = {};
  for (const Leaf& leaf : tree_.leaves())
    content->submaps.push_back(stored(leaf.points, leaf.id, leaf.lost_bits));
  content->next_submap = tree_.nextLeaf();
  for (const auto& [id, feature] : features_) content->frozen.push_back(feature);
}

void SubmapKeeper::restore(const MapFileContent& content) {
  clear();
  if (content.frozen.empty()) return;
  std::vector<Leaf> leaves;
  for (const StoredSubmap& submap : content.submaps) {
    Leaf leaf;
    leaf.id = submap.id;
    leaf.points = conditionalOf(submap);
    leaf.lost_bits = submap.lost_bits;
    leaves.push_back(leaf);
  }
  tree_.restore(conditionalOf(content.trunk), leaves, content.next_submap);
  for (const MapFeature& feature : content.frozen) features_.emplace(feature.id, feature);
  frozen_ = static_cast<int>(leaves.size());
}

std::shared_ptr<const FrozenMap> SubmapKeeper::describe(const Ekf& filter) const {
  auto description = std::make_shared<FrozenMap>();
  std::map<FeatureId, int> leaf_of;
  for (const Leaf& leaf : tree_.leaves()) {
    for (const FeatureId id : leaf.points.ids) leaf_of[id] = leaf.id;
    description->lost_bits += leaf.lost_bits;
  }
  for (const auto& [id, position] : positions(filter)) {
    const auto leaf = leaf_of.find(id);
    description->features.push_back(
        {id, leaf == leaf_of.end() ? -1 : leaf->second, isPinned(id), position});
  }
  for (const FeatureState& feature : filter.features())
    if (isPinned(feature.id)) description->active_separators.push_back(feature.id);
  description->submaps = static_cast<int>(tree_.leaves().size());
  description->trunk_features = static_cast<int>(tree_.trunk().ids().size());
  description->frozen = frozen_;
  description->found = found_;
  return description;
}

}  // namespace active_matching_slam
