// How the map of a walk through the corridor is kept small.

#include <time.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/information/separator.h"
#include "active_matching_slam/math/quantile.h"
#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/slot.h"
#include "corridor_run.h"

namespace active_matching_slam {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Ids = std::vector<FeatureId>;

constexpr int kHardlyMeasured = 5;     // a submap of which fewer were is frozen as it was
constexpr int kFreezeInterval = 10;    // frames
constexpr int kActivationMargin = 30;  // features over the maximum: none are activated
constexpr int kSlack = 15;             // features over the maximum: freeze at once

}  // namespace

double CorridorRun::processorMs() {
  timespec now{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

bool CorridorRun::activate() {
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

bool CorridorRun::hasRoom(int leaf) {
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

bool CorridorRun::isFarOff(const Leaf& leaf) const {
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

void CorridorRun::bound() {
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

void CorridorRun::restSeparators() {
  Ids separators;
  for (const FeatureState& feature : filter_.features()) {
    if (tree_.isSeparator(feature.id) && isResting(feature.id)) separators.push_back(feature.id);
  }
  tree_.rest(active_, separators);
  for (FeatureId id : separators) frozen_.insert(point_of_.at(id));
}

void CorridorRun::returnUntouched() {
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

void CorridorRun::freezeOne() {
  Ids candidates;
  for (const FeatureState& feature : filter_.features()) {
    const FeatureId id = feature.id;
    const bool returns = std::any_of(activated_.begin(), activated_.end(), [&](const auto& leaf) {
      return leaf.members.count(id) > 0 && static_cast<int>(leaf.measured.size()) < kHardlyMeasured;
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

std::vector<FeatureId> CorridorRun::separatorOf(const Ids& members, SubmapBorders borders,
                                                const FreezeOptions& options) const {
  if (borders == SubmapBorders::kInformation) {
    return tree_.chooseSeparator(active_, members, options, nullptr);
  }
  Ids newest = members;
  std::sort(newest.rbegin(), newest.rend());
  if (static_cast<int>(newest.size()) > options.separator) newest.resize(slot(options.separator));
  return newest;
}

void CorridorRun::compare(const Ids& members) {
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

void CorridorRun::freeze(const Ids& members, const Ids& separator) {
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

std::vector<FeatureId> CorridorRun::linked(const Ids& candidates, int most) const {
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
    const Eigen::Matrix3d A = given.block<3, 3>(3 * a, 3 * a), B = given.block<3, 3>(3 * b, 3 * b);
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

}  // namespace active_matching_slam
