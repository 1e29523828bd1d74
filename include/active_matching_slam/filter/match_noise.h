#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "active_matching_slam/filter/filter_options.h"

namespace active_matching_slam {

/// How much more or less noisy the matches of one feature are than most: some corners are cleaner
/// than others, and where something near hides something far there is no point to be found. Over
/// about the last hundred matches; one, until there are enough to tell.
class FeatureNoise {
 public:
  /// `residual_px` as MatchNoise::learn() has it, `shown_px` > 0 what it returned for that frame.
  void learn(const Eigen::Vector2d& residual_px, double shown_px);

  /// Standard deviation of this feature's matches, in that of most.
  double factor() const;

 private:
  double sum_ = 0.0;    ///< of squared residuals per axis, in what their frames showed
  double count_ = 0.0;  ///< of matches
};

/// The noise of matches as updates show it: what they leave between matches and map, by its median
/// (so that the few that are wrong don't count), averaged over a second or two. It is for the
/// update only; gates and mutual information keep FilterOptions::sigma_px, which must hold for what
/// has not been matched yet.
class MatchNoise {
 public:
  /// Nothing is known yet: it is taken to be FilterOptions::sigma_px.
  void reset() { variance_px2_.reset(); }

  /// `residuals_px`: each match fused, less the feature's projection after the update. Too few tell
  /// nothing. Returns what they show, as a standard deviation per axis [px]; 0: nothing.
  double learn(const FilterOptions& options, const std::vector<Eigen::Vector2d>& residuals_px);

  /// Standard deviation per axis [px] for most matches, not above FilterOptions::sigma_px and,
  /// where that allows it, not below FilterOptions::minimum_sigma_px.
  double sigma_px(const FilterOptions& options) const;
  /// The same for matches of a feature whose noise is known, but without the upper bound.
  double sigma_px(const FilterOptions& options, const FeatureNoise& feature) const;

 private:
  std::optional<double> variance_px2_;
};

}  // namespace active_matching_slam
