#include "active_matching_slam/matching/match_options.h"

#include <algorithm>
#include <sstream>
#include <stdexcept>

namespace active_matching_slam {
namespace {

void require(bool ok, const char* name, double value, const char* range) {
  if (ok) return;
  std::ostringstream text;
  text << name << " is " << value << ", must be in " << range;
  throw std::invalid_argument(text.str());
}

bool isProbability(double p) { return p > 0.0 && p < 1.0; }

}  // namespace

double fractionOfBudget(const MatchOptions& options, std::int64_t pixels, double milliseconds) {
  double fraction = 0.0;
  if (options.max_pixels > 0)
    fraction = static_cast<double>(pixels) / static_cast<double>(options.max_pixels);
  if (options.max_milliseconds > 0.0)
    fraction = std::max(fraction, milliseconds / options.max_milliseconds);
  return fraction;
}

void checkMatchOptions(const MatchOptions& o) {
  require(isProbability(o.default_rates.true_positive), "default_rates.true_positive",
          o.default_rates.true_positive, "(0, 1)");
  require(isProbability(o.default_rates.false_positive), "default_rates.false_positive",
          o.default_rates.false_positive, "(0, 1)");
  require(o.prune_weight >= 0.0 && o.prune_weight < 1.0, "prune_weight", o.prune_weight, "[0, 1)");
  require(o.deferred_pruning_weight >= 0.0 && o.deferred_pruning_weight <= 1.0,
          "deferred_pruning_weight", o.deferred_pruning_weight, "[0, 1]");
  require(o.k_best >= 0, "k_best", o.k_best, "[0, inf)");
  require(o.max_gaussians >= 0, "max_gaussians", o.max_gaussians, "[0, inf)");
  require(o.merge_sigmas >= 0.0, "merge_sigmas", o.merge_sigmas, "[0, inf)");
  require(o.merge_probability >= 0.0 && o.merge_probability <= 1.0, "merge_probability",
          o.merge_probability, "[0, 1]");
  require(o.latch_information_bits >= 0.0, "latch_information_bits", o.latch_information_bits,
          "[0, inf)");
  require(o.finish_weight >= 0.0 && o.finish_weight <= 1.0, "finish_weight", o.finish_weight,
          "[0, 1]");
  require(o.ambiguous_below_weight >= 0.0 && o.ambiguous_below_weight <= 1.0,
          "ambiguous_below_weight", o.ambiguous_below_weight, "[0, 1]");
  require(o.fast_candidates >= 1, "fast_candidates", o.fast_candidates, "[1, inf)");
  require(o.fast_latch_bits >= 0.0, "fast_latch_bits", o.fast_latch_bits, "[0, inf)");
  require(o.fast_accept_weight >= 0.0 && o.fast_accept_weight <= 1.0, "fast_accept_weight",
          o.fast_accept_weight, "[0, 1]");
  require(o.max_pixels >= 0, "max_pixels", static_cast<double>(o.max_pixels), "[0, inf)");
  require(o.max_milliseconds >= 0.0, "max_milliseconds", o.max_milliseconds, "[0, inf)");
  require(o.jcbb_max_nodes >= 0, "jcbb_max_nodes", static_cast<double>(o.jcbb_max_nodes),
          "[0, inf)");
  require(isProbability(o.jcbb_confidence), "jcbb_confidence", o.jcbb_confidence, "(0, 1)");
  require(o.ransac_inlier_chi2 > 0.0, "ransac_inlier_chi2", o.ransac_inlier_chi2, "(0, inf)");
  require(o.ransac_rescue_chi2 > 0.0, "ransac_rescue_chi2", o.ransac_rescue_chi2, "(0, inf)");
  require(o.ransac_max_hypotheses >= 0, "ransac_max_hypotheses", o.ransac_max_hypotheses,
          "[0, inf)");
}

}  // namespace active_matching_slam
