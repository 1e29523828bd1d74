#include "active_matching_slam/submaps/submap_tree.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <unordered_set>

#include "active_matching_slam/information/separator.h"
#include "active_matching_slam/math/row_selection.h"
#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Ids = std::vector<FeatureId>;
using IdSet = std::unordered_set<FeatureId>;

IdSet setOf(const Ids& ids) { return IdSet(ids.begin(), ids.end()); }

/// Those of `ids` that are, or are not, in `others`, in their order.
Ids chosen(const Ids& ids, const IdSet& others, bool in) {
  Ids result;
  for (FeatureId id : ids) {
    if ((others.count(id) > 0) == in) result.push_back(id);
  }
  return result;
}

/// The `count` points that are nearest to the centre of others.
Ids nearest(const Ids& points, const Eigen::VectorXd& mean, const Eigen::Vector3d& centre,
            int count) {
  std::vector<std::pair<double, FeatureId>> distances;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d position = mean.segment<3>(static_cast<Index>(3 * i));
    distances.emplace_back((position - centre).squaredNorm(), points[i]);
  }
  std::sort(distances.begin(), distances.end());
  if (static_cast<int>(distances.size()) > count) distances.resize(slot(count));
  Ids ids;
  for (const auto& [distance, id] : distances) ids.push_back(id);
  return ids;
}

Eigen::Vector3d centreOf(const PointGaussian& points, const Ids& ids) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int i : indicesOf(ids, points.ids)) sum += points.mean.segment<3>(points.firstRow(i));
  return sum / std::max<double>(1.0, static_cast<double>(ids.size()));
}

/// Where, in the covariance of the whole state, some rows of points() are.
std::vector<int> stateRows(const std::vector<int>& rows, const std::vector<int>& of_points) {
  std::vector<int> result;
  for (int row : of_points) result.push_back(rows[slot(row)]);
  return result;
}

}  // namespace

const Leaf* SubmapTree::find(int id) const {
  for (const Leaf& leaf : leaves_) {
    if (leaf.id == id) return &leaf;
  }
  return nullptr;
}

const Leaf* SubmapTree::leafOf(FeatureId id) const {
  for (const Leaf& leaf : leaves_) {
    if (std::count(leaf.points.ids.begin(), leaf.points.ids.end(), id) > 0) return &leaf;
  }
  return nullptr;
}

int SubmapTree::frozenCount() const {
  std::size_t count = trunk_.ids().size();
  for (const Leaf& leaf : leaves_) count += leaf.points.ids.size();
  return static_cast<int>(count);
}

void SubmapTree::clear() {
  trunk_.clear();
  leaves_.clear();
  separators_.clear();
  next_leaf_ = 0;
}

void SubmapTree::restore(const Conditional& trunk, const std::vector<Leaf>& leaves, int next_leaf) {
  const IdSet in_trunk = setOf(trunk.ids), given = setOf(trunk.given_ids);
  int previous = -1;
  for (const Leaf& leaf : leaves) {
    if (leaf.id <= previous || leaf.id >= next_leaf) {
      throw std::invalid_argument("leaf " + std::to_string(leaf.id) +
                                  ", allowed: " + std::to_string(previous + 1) + " to " +
                                  std::to_string(next_leaf - 1));
    }
    previous = leaf.id;
    for (FeatureId id : leaf.points.ids) {
      if (in_trunk.count(id) > 0 || given.count(id) > 0) {
        throw std::invalid_argument("point " + std::to_string(id) + " of leaf " +
                                    std::to_string(leaf.id) + " is in the trunk too");
      }
    }
  }
  clear();
  trunk_.restore(trunk);
  leaves_ = leaves;
  next_leaf_ = next_leaf;
  for (const Leaf& leaf : leaves_) pin(leaf, 1);
}

void SubmapTree::pin(const Leaf& leaf, int count) {
  for (FeatureId id : leaf.points.given_ids) {
    int& leaves = separators_[id];
    leaves += count;
    if (leaves == 0) separators_.erase(id);
  }
}

Ids SubmapTree::chooseSeparator(const ActiveMap& active, const Ids& points,
                                const FreezeOptions& options, double* bits) const {
  const PointGaussian gaussian = active.points();
  const std::vector<int> rows = active.rows();
  const MatrixXd state = active.covariance();
  const Index state_size = state.rows();
  const int calibration = gaussian.calibrationSize();

  // The whole state, and behind it what of the trunk is near.
  const Conditional& trunk = trunk_.conditional();
  const Ids near = trunk_.empty() ? Ids()
                                  : nearest(trunk.ids, trunk.meanAt(gaussian),
                                            centreOf(gaussian, points), options.trunk_neighbours);
  const Conditional beside = trunk_.givenActive(gaussian, near);
  const Index added = beside.mean.size();
  MatrixXd P(state_size + added, state_size + added);
  P.topLeftCorner(state_size, state_size) = state;
  if (added > 0) {
    std::vector<int> all(slot(static_cast<int>(state_size)));
    for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<int>(i);
    const MatrixXd cross = beside.K * selectBlock(state, rows, all);
    P.bottomLeftCorner(added, state_size) = cross;
    P.topRightCorner(state_size, added) = cross.transpose();
    P.bottomRightCorner(added, added) = beside.ownCovariance(cross, rows);
  }

  SeparatorCandidates candidates;
  std::unordered_map<int, FeatureId> id_of_row;
  std::vector<char> named(slot(static_cast<int>(state_size)), 0);
  for (int row = 0; row < calibration; ++row) {
    candidates.given.push_back(rows[slot(row)]);
    named[slot(rows[slot(row)])] = 1;
  }
  const IdSet inside = setOf(points);
  const auto offer = [&](FeatureId id, int first, bool is_inside) {
    id_of_row[first] = id;
    (is_inside ? candidates.inside : candidates.outside).push_back(first);
    if (isSeparator(id)) candidates.preferred.push_back(first);
  };
  for (int i = 0; i < gaussian.pointCount(); ++i) {
    const FeatureId id = gaussian.ids[slot(i)];
    const int first = rows[slot(gaussian.firstRow(i))];
    offer(id, first, inside.count(id) > 0);
    for (int axis = 0; axis < 3; ++axis) named[slot(first + axis)] = 1;
  }
  for (std::size_t i = 0; i < near.size(); ++i) {
    offer(near[i], static_cast<int>(state_size) + 3 * static_cast<int>(i), false);
  }
  for (int row = 0; row < state_size; ++row) {
    if (!named[slot(row)]) candidates.others.push_back(row);
  }

  SeparatorLimits limits;
  limits.maximum_points = options.separator;
  limits.enough_bits = options.enough_bits;
  limits.preference_bits = options.preference_bits;
  const Separator separator = active_matching_slam::chooseSeparator(P, candidates, limits);
  if (bits != nullptr) *bits = separator.bits.back();
  Ids ids;
  for (int first : separator.points) ids.push_back(id_of_row[first]);
  return ids;
}

int SubmapTree::freeze(ActiveMap& active, const Ids& points, const Ids& separator,
                       const Ids& resting, const FreezeOptions& options) {
  const IdSet C = setOf(separator);
  const Ids J = chosen(points, C, false);
  activateTrunk(active, chosen(separator, setOf(trunk_.ids()), true));

  const PointGaussian gaussian = active.points();
  const std::vector<int> rows = active.rows();
  const MatrixXd state = active.covariance();
  const int calibration = gaussian.calibrationSize();
  Leaf leaf;
  leaf.points = Conditional::of(gaussian, J, separator);
  const MatrixXd A = leaf.points.Q;

  // The link to the rest of the state. Calibration and separator are given.
  const std::vector<int> own = stateRows(rows, rowsOf(calibration, indicesOf(J, gaussian.ids)));
  std::vector<int> given(rows.begin(), rows.begin() + calibration);
  const std::vector<int> of_separator =
      stateRows(rows, rowsOf(calibration, indicesOf(separator, gaussian.ids)));
  given.insert(given.end(), of_separator.begin(), of_separator.end());
  std::vector<int> not_rest = own;
  not_rest.insert(not_rest.end(), given.begin(), given.end());
  const std::vector<int> rest = othersOf(not_rest, static_cast<int>(state.rows()));
  const GivenSeparator link = givenSeparator(state, own, rest, given);
  const ConservativeCut from_state = conservativeCut(A, link.outside, link.across);

  // The link to the trunk beyond the active map: what is left of both once the latter is given.
  trunk_.take(gaussian, J);
  const Index leaf_size = A.rows(), trunk_size = trunk_.conditional().Q.rows() - leaf_size;
  const ConservativeCut from_trunk =
      conservativeCut(A, trunk_.conditional().Q.topLeftCorner(trunk_size, trunk_size),
                      trunk_.conditional().Q.bottomLeftCorner(leaf_size, trunk_size));
  trunk_.forget(J);
  leaf.lost_bits = explainedInformation(A, from_state.explained + from_trunk.explained);

  if (options.conservative) {
    leaf.points.Q += from_state.inside + from_trunk.inside;
    trunk_.inflate(from_trunk.outside);
    MatrixXd added = MatrixXd::Zero(state.rows(), state.cols());
    for (Index k = 0; k < from_state.outside.cols(); ++k) {
      for (Index i = 0; i < from_state.outside.rows(); ++i) {
        added(rest[slot(static_cast<int>(i))], rest[slot(static_cast<int>(k))]) =
            from_state.outside(i, k);
      }
    }
    active.inflate(added);
  }
  active.remove(J);
  leaf.id = next_leaf_++;
  pin(leaf, 1);
  leaves_.push_back(std::move(leaf));
  this->rest(active, chosen(separator, setOf(resting), true));
  return leaves_.back().id;
}

Ids SubmapTree::activate(ActiveMap& active, int id) {
  const auto found = std::find_if(leaves_.begin(), leaves_.end(),
                                  [id](const Leaf& leaf) { return leaf.id == id; });
  if (found == leaves_.end()) {
    throw std::invalid_argument("there is no leaf " + std::to_string(id));
  }
  const Leaf leaf = std::move(*found);
  leaves_.erase(found);
  activateTrunk(active, chosen(leaf.points.given_ids, setOf(trunk_.ids()), true));
  active.insert(leaf.points);
  pin(leaf, -1);
  return leaf.points.ids;
}

void SubmapTree::putBack(ActiveMap& active, const Leaf& leaf, const Ids& resting) {
  remove(active, leaf.points.ids);
  const auto place = std::lower_bound(leaves_.begin(), leaves_.end(), leaf.id,
                                      [](const Leaf& a, int id) { return a.id < id; });
  leaves_.insert(place, leaf);
  pin(leaf, 1);
  rest(active, resting);
}

void SubmapTree::activateTrunk(ActiveMap& active, const Ids& ids) {
  if (!ids.empty()) active.insert(trunk_.give(active.points(), ids));
}

void SubmapTree::rest(ActiveMap& active, const Ids& ids) {
  if (ids.empty()) return;
  trunk_.take(active.points(), ids);
  active.remove(ids);
}

void SubmapTree::remove(ActiveMap& active, const Ids& ids) {
  if (ids.empty()) return;
  // Most that leave for good are new, and nothing depends on them.
  const bool is_needed =
      std::any_of(ids.begin(), ids.end(), [this](FeatureId id) { return trunk_.dependsOn(id); });
  trunk_.marginalise(is_needed ? active.points() : PointGaussian(), ids);
  active.remove(ids);
}

Conditional SubmapTree::givenActive(const PointGaussian& active, const Leaf& leaf) const {
  const Conditional& points = leaf.points;
  const Ids in_trunk = chosen(points.given_ids, setOf(trunk_.ids()), true);
  const Conditional separator = givenActive(active, in_trunk);
  const int calibration = points.calibrationSize();
  Conditional result;
  result.ids = points.ids;
  result.given_ids = active.ids;
  result.given_mean = active.mean;
  result.K = MatrixXd::Zero(points.K.rows(), active.mean.size());
  result.K.leftCols(calibration) = points.K.leftCols(calibration);
  Eigen::VectorXd separator_mean = points.given_mean;
  separator_mean.head(calibration) = active.mean.head(calibration);
  MatrixXd K_trunk(points.K.rows(), separator.mean.size());
  const std::unordered_map<FeatureId, int> where = indicesOf(active.ids);
  const std::unordered_map<FeatureId, int> in_trunk_at = indicesOf(in_trunk);
  for (std::size_t i = 0; i < points.given_ids.size(); ++i) {
    const Index column = calibration + 3 * static_cast<Index>(i);
    const auto in_active = where.find(points.given_ids[i]);
    if (in_active != where.end()) {
      const Index row = active.firstRow(in_active->second);
      result.K.middleCols(row, 3) = points.K.middleCols(column, 3);
      separator_mean.segment<3>(column) = active.mean.segment<3>(row);
    } else {
      const Index row = 3 * in_trunk_at.at(points.given_ids[i]);
      K_trunk.middleCols(row, 3) = points.K.middleCols(column, 3);
      separator_mean.segment<3>(column) = separator.mean.segment<3>(row);
    }
  }
  result.K.noalias() += K_trunk * separator.K;
  result.mean = points.mean + points.K * (separator_mean - points.given_mean);
  result.Q = points.Q;
  result.Q.noalias() += K_trunk * separator.Q * K_trunk.transpose();
  return result;
}

Conditional SubmapTree::givenActive(const PointGaussian& active, const Ids& ids) const {
  return trunk_.givenActive(active, ids);
}

void SubmapTree::rescale(double factor) {
  trunk_.rescale(factor);
  for (Leaf& leaf : leaves_) leaf.points.rescale(factor);
}

}  // namespace active_matching_slam
