#pragma once

#include <optional>
#include <vector>

#include "active_matching_slam/filter/filter_options.h"

namespace active_matching_slam {

/// The noise of matches as updates show it: what they leave between matches and map, by its median
/// (so that the few that are wrong don't count), averaged over a second or two. It is for the
/// update only; gates and mutual information keep FilterOptions::sigma_px, which must hold for what
/// has not been matched yet.
class MatchNoise {
 public:
  /// Nothing is known yet: it is taken to be FilterOptions::sigma_px.
  void reset() { variance_px2_.reset(); }

  /// `residuals_px`: both coordinates of each match fused, less those of the feature's projection
  /// after the update. Too few tell nothing.
  void learn(const FilterOptions& options, std::vector<double> residuals_px);

  /// Standard deviation per axis [px], not above FilterOptions::sigma_px and, where that allows it,
  /// not below FilterOptions::minimum_sigma_px.
  double sigma_px(const FilterOptions& options) const;

 private:
  std::optional<double> variance_px2_;
};

}  // namespace active_matching_slam
