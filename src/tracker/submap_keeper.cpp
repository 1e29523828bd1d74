#include "submap_keeper.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

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
/// Out of view for so long a feature may be laid aside [s]. Cost: less, and a glance aside moves
/// features to and fro; more, and a full map waits.
constexpr double kRestS = 1.5;
/// Between two times that features are laid aside [s]. Cost: it takes as long as some frames.
constexpr double kFreezePeriodS = 1.0;

/// log |P|; NaN where P is not positive definite.
template <int kSize>
double logDeterminant(const Eigen::Matrix<double, kSize, kSize>& P) {
  const Eigen::LLT<Eigen::Matrix<double, kSize, kSize>> factor(P);
  if (factor.info() != Eigen::Success) return std::numeric_limits<double>::quiet_NaN();
  return 2.0 * factor.matrixLLT().diagonal().array().log().sum();
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
    alone[static_cast<std::size_t>(i)] = logDeterminant<3>(own.block<3, 3>(3 * i, 3 * i));
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
      const double information = alone[next] + alone[k] - logDeterminant<6>(both);
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

}  // namespace

void SubmapKeeper::clear() {
  const SubmapFilterOptions options = options_;
  *this = SubmapKeeper(options);
}

void SubmapKeeper::rescale(double factor) {
  tree_.rescale(factor);
  for (auto& [id, feature] : features_) feature.patch.T_world_camera.translation() *= factor;
  if (trial_) {
    trial_->leaf.points.rescale(factor);
    for (MapFeature& feature : trial_->features)
      feature.patch.T_world_camera.translation() *= factor;
  }
  looked_from_.clear();
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
  for (const MapFeature& feature : map.features()) {
    last_in_view_s_.emplace(feature.id, stamp_s);
    if (isPinned(feature.id) && isResting(feature.id, stamp_s)) waiting_.insert(feature.id);
  }
}

void SubmapKeeper::trust() { missed_.clear(); }

std::vector<FeatureId> SubmapKeeper::remove(const std::vector<FeatureId>& ids, Ekf* filter,
                                            const FeatureMap& map) {
  std::vector<FeatureId> gone, points, rays;
  for (const FeatureId id : ids) {
    const FeatureState* state = filter->find(id);
    if (!state || !map.find(id)) continue;
    if (isOnTrial(id) || isPinned(id)) {
      unsearched_.insert(id);
      continue;
    }
    gone.push_back(id);
    (state->kind == FeatureKind::kPoint ? points : rays).push_back(id);
    last_in_view_s_.erase(id);
    unsearched_.erase(id);
    waiting_.erase(id);
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
    waiting_.erase(feature.id);
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
  if (!isEnabled() || trial_ || stamp_s - last_freeze_s_ < kFreezePeriodS ||
      static_cast<int>(tree_.trunk().ids().size()) >= options_.trunk_features)
    return false;
  const std::vector<FeatureId> resting = candidates(stamp_s, *filter, *map);
  if (static_cast<int>(resting.size()) < std::max(kLeastLeaf, least_resting_)) return false;
  last_freeze_s_ = stamp_s;
  filter->convertToPoints(resting);  // what is laid aside are points
  const std::vector<FeatureId> chosen =
      relatedTo(resting, static_cast<std::size_t>(options_.leaf_features), *filter);
  FreezeOptions cut;
  cut.separator = options_.separator_features;
  EkfActiveMap active(*filter);
  const std::vector<FeatureId> separator = tree_.chooseSeparator(active, chosen, cut, nullptr);
  std::vector<FeatureId> points, out_of_view;
  for (const FeatureId id : chosen)
    if (std::find(separator.begin(), separator.end(), id) == separator.end()) points.push_back(id);
  // The separator takes some of them: so many more will do.
  least_resting_ = static_cast<int>(resting.size()) + kLeastLeaf - static_cast<int>(points.size());
  if (static_cast<int>(points.size()) < kLeastLeaf) return false;
  least_resting_ = 0;
  for (const FeatureId id : separator)
    if (!filter->find(id) || isResting(id, stamp_s)) out_of_view.push_back(id);
  tree_.freeze(active, points, separator, out_of_view, cut);
  for (const FeatureId id : points) unsearched_.erase(id);
  exchange(stamp_s, filter, map);
  ++frozen_;
  return true;
}

void SubmapKeeper::restSeparators(double stamp_s, Ekf* filter, FeatureMap* map) {
  if (!isEnabled() || trial_ || stamp_s - last_rest_s_ < kFreezePeriodS) return;
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

/// Makes a submap active, whether it was found or not.
bool SubmapKeeper::bringBack(int leaf, double stamp_s, int most_features, Ekf* filter,
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
  for (const FeatureId id : ids) unsearched_.erase(id);
  return true;
}

void SubmapKeeper::countFound(const std::vector<FeatureId>& ids) {
  last_returned_ = ids;
  ++found_;
}

bool SubmapKeeper::activate(int leaf, double stamp_s, int most_features, Ekf* filter,
                            FeatureMap* map) {
  const Leaf* found = tree_.find(leaf);
  if (!found) return false;
  const std::vector<FeatureId> ids = found->points.ids;
  if (!bringBack(leaf, stamp_s, most_features, filter, map)) return false;
  countFound(ids);
  return true;
}

void SubmapKeeper::activateSeparators(const std::vector<FeatureId>& ids, double stamp_s,
                                      Ekf* filter, FeatureMap* map) {
  EkfActiveMap active(*filter);
  tree_.activateTrunk(active, ids);
  exchange(stamp_s, filter, map);
}

}  // namespace active_matching_slam
