#include "active_matching_slam/matching/match_options.h"

#include <algorithm>

namespace active_matching_slam {
namespace {

/// Cost of a search and of a pixel [ms], on one core of about 3 GHz.
constexpr double kSearchMs = 8e-3, kPixelMs = 5e-6;

}  // namespace

double modelledSearch_ms(double pixels) { return kSearchMs + kPixelMs * pixels; }

double fractionOfBudget(const MatchOptions& options, std::int64_t pixels, double milliseconds) {
  double fraction = 0.0;
  if (options.max_pixels > 0)
    fraction = static_cast<double>(pixels) / static_cast<double>(options.max_pixels);
  if (options.max_milliseconds > 0.0)
    fraction = std::max(fraction, milliseconds / options.max_milliseconds);
  return fraction;
}

std::string updateRuleName(UpdateRule rule) {
  return rule == UpdateRule::kThesis ? "thesis" : "incremental";
}

UpdateRule updateRuleFromName(const std::string& name) {
  checkChoice("matching/update_rule", name, {"incremental", "thesis"});
  return name == "thesis" ? UpdateRule::kThesis : UpdateRule::kIncremental;
}

}  // namespace active_matching_slam
