#include <algorithm>
#include <limits>

#include "active_matching_slam/math/chi_square.h"
#include "active_matching_slam/math/slot.h"
#include "baseline_matchers.h"
#include "gate_search.h"
#include "modelled_cost.h"

namespace active_matching_slam {
namespace {

/// Depth-first branch and bound over the features in index order. The Cholesky factor of the paired
/// features' covariance grows and shrinks with the branch; it depends on which features are paired,
/// not on where, so all matches of a feature share its rows.
class BranchAndBound {
 public:
  BranchAndBound(const ProperPrior& prior, BudgetedSearch& budgeted,
                 const std::vector<std::vector<int>>& gates, const MatchOptions& options)
      : prior_(prior), search_(budgeted), gates_(gates), options_(options), size_(prior.size()) {
    for (int n = 1; n <= size_; ++n)
      limits_.push_back(chiSquareQuantile(2 * n, options.jcbb_confidence));
    open_gates_.assign(static_cast<std::size_t>(size_) + 1, 0);
    for (int f = size_ - 1; f >= 0; --f)
      open_gates_[slot(f)] = open_gates_[slot(f + 1)] + !gates[slot(f)].empty();
    rows_.resize(static_cast<std::size_t>(size_));
    assigned_.assign(static_cast<std::size_t>(size_), -1);
    best_ = assigned_;
    level_.resize(static_cast<std::size_t>(size_));
  }

  void run() { visit(0, 0, 0.0); }

  const std::vector<int>& best() const { return best_; }
  double bestDistance2() const { return best_pairings_ > 0 ? best_distance2_ : 0.0; }
  std::int64_t nodes() const { return nodes_; }
  bool cutShort() const { return cut_short_; }

 private:
  /// One pairing of the branch. `stamp` identifies the covariance of the branch up to here.
  struct Level {
    int feature = -1;
    std::int64_t stamp = 0;
    Eigen::Matrix2d chol_inverse;  // of the conditional covariance of the feature
    Eigen::Vector2d y;             // whitened innovation
  };
  /// L^-1 S_{branch, f}, as far as computed, and for which branch.
  struct Rows {
    std::vector<Eigen::Matrix2d> w;
    std::vector<std::int64_t> stamp;
  };
  struct Choice {
    double distance2;
    int match;
    Eigen::Vector2d y;
  };

  bool isOutOfBudget() {
    if (options_.jcbb_max_nodes > 0 && nodes_ >= options_.jcbb_max_nodes) cut_short_ = true;
    if ((nodes_ & 255) == 0 && options_.max_milliseconds > 0.0 &&
        search_.spentMilliseconds() >= options_.max_milliseconds)
      cut_short_ = true;
    return cut_short_;
  }

  bool canBeat(int feature, int pairings, double distance2) const {
    const int reachable = pairings + open_gates_[slot(feature)];
    return reachable > best_pairings_ ||
           (reachable == best_pairings_ && distance2 < best_distance2_);
  }

  /// Brings rows_[feature] up to the `depth` pairings of the branch.
  const Rows& updatedRows(int feature, int depth) {
    Rows& rows = rows_[slot(feature)];
    int good = 0;
    while (good < std::min(depth, static_cast<int>(rows.w.size())) &&
           rows.stamp[slot(good)] == level_[slot(good)].stamp)
      ++good;
    rows.w.resize(slot(depth));
    rows.stamp.resize(slot(depth));
    for (int j = good; j < depth; ++j) {
      const Level& level = level_[slot(j)];
      const Rows& other = rows_[slot(level.feature)];
      Eigen::Matrix2d cross = prior_.S().block<2, 2>(2 * level.feature, 2 * feature);
      for (int i = 0; i < j; ++i) cross.noalias() -= other.w[slot(i)].transpose() * rows.w[slot(i)];
      rows.w[slot(j)] = level.chol_inverse * cross;
      rows.stamp[slot(j)] = level.stamp;
    }
    return rows;
  }

  /// The matches that are compatible with the branch, nearest first.
  std::vector<Choice> compatibleChoices(int feature, int depth, double distance2) {
    std::vector<Choice> choices;
    if (gates_[slot(feature)].empty()) return choices;
    const Rows& rows = updatedRows(feature, depth);
    search_.charge(kConditionedMs * depth);
    Eigen::Matrix2d conditional = prior_.covariance(feature);
    Eigen::Vector2d expected = prior_.mean(feature);
    for (int j = 0; j < depth; ++j) {
      conditional.noalias() -= rows.w[slot(j)].transpose() * rows.w[slot(j)];
      expected.noalias() += rows.w[slot(j)].transpose() * level_[slot(j)].y;
    }
    const double l00 = std::sqrt(conditional(0, 0)), l10 = conditional(1, 0) / l00;
    const double l11 = std::sqrt(conditional(1, 1) - l10 * l10);
    if (!(l00 > 0.0 && l11 > 0.0)) return choices;
    Level& level = level_[slot(depth)];
    level.feature = feature;
    level.stamp = ++last_stamp_;
    level.chol_inverse << 1.0 / l00, 0.0, -l10 / (l00 * l11), 1.0 / l11;
    for (const int m : gates_[slot(feature)]) {
      const Eigen::Vector2d y =
          level.chol_inverse * (search_.matches(feature)[slot(m)].pixel - expected);
      const double total = distance2 + y.squaredNorm();
      ++nodes_;
      search_.charge(kNodeMs);
      if (total <= limits_[slot(depth)]) choices.push_back({total, m, y});
    }
    std::stable_sort(choices.begin(), choices.end(),
                     [](const Choice& a, const Choice& b) { return a.distance2 < b.distance2; });
    return choices;
  }

  void visit(int feature, int depth, double distance2) {
    if (!canBeat(feature, depth, distance2)) return;
    // Out of budget, a branch that already pairs more than the best leaf is the better answer.
    // The first leaf is always reached.
    const bool stop = best_pairings_ >= 0 && isOutOfBudget();
    if (stop && depth <= best_pairings_) return;
    if (stop || feature == size_) {
      best_ = assigned_;
      best_pairings_ = depth;
      best_distance2_ = distance2;
      return;
    }
    for (const Choice& choice : compatibleChoices(feature, depth, distance2)) {
      level_[slot(depth)].y = choice.y;
      assigned_[slot(feature)] = choice.match;
      visit(feature + 1, depth + 1, choice.distance2);
    }
    assigned_[slot(feature)] = -1;
    visit(feature + 1, depth, distance2);
  }

  const ProperPrior& prior_;
  BudgetedSearch& search_;
  const std::vector<std::vector<int>>& gates_;
  const MatchOptions& options_;
  const int size_;
  std::vector<double> limits_;   // chi-square of n pairings at [n - 1]
  std::vector<int> open_gates_;  // features from f on that have a match
  std::vector<Rows> rows_;
  std::vector<Level> level_;
  std::vector<int> assigned_, best_;
  int best_pairings_ = -1;
  double best_distance2_ = std::numeric_limits<double>::infinity();
  std::int64_t nodes_ = 0, last_stamp_ = 0;
  bool cut_short_ = false;
};

}  // namespace

MatchResult JcbbMatcher::match(const MeasurementPrior& given, FeatureSearch& search,
                               const MatchOptions& options) {
  const ProperPrior prior(given);
  BudgetedSearch budgeted(prior, search, options);
  MatchResult result = budgeted.begin("jcbb");
  const auto gates = searchFullGates(prior, budgeted, &result.statistics.cut_short);
  BranchAndBound branch_and_bound(prior, budgeted, gates, options);
  branch_and_bound.run();
  for (int f = 0; f < prior.size(); ++f)
    result.match_of_feature[static_cast<std::size_t>(prior.original(f))] =
        branch_and_bound.best()[static_cast<std::size_t>(f)];
  result.statistics.nodes = branch_and_bound.nodes();
  result.statistics.mahalanobis2 = branch_and_bound.bestDistance2();
  result.statistics.cut_short |= branch_and_bound.cutShort();
  budgeted.finish(result);
  return result;
}

}  // namespace active_matching_slam
