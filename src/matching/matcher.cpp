#include "active_matching_slam/matching/matcher.h"

#include <stdexcept>

#include "active_matching_slam/math/option_field.h"
#include "baseline_matchers.h"
#include "mixture_matchers.h"

namespace active_matching_slam {

const std::vector<std::string>& matcherNames() {
  static const std::vector<std::string> names = {
      "active_search", "jcbb", "one_point_ransac", "active", "fast_active", "chow_liu", "auto"};
  return names;
}

std::unique_ptr<Matcher> createMatcher(const std::string& name) {
  if (name == "active_search") return std::make_unique<ActiveSearchMatcher>();
  if (name == "jcbb") return std::make_unique<JcbbMatcher>();
  if (name == "one_point_ransac") return std::make_unique<OnePointRansacMatcher>();
  if (name == "active") return std::make_unique<ActiveMatcher>();
  if (name == "fast_active") return std::make_unique<FastActiveMatcher>();
  if (name == "chow_liu") return std::make_unique<ChowLiuMatcher>();
  if (name == "auto") return std::make_unique<AutoMatcher>();
  checkChoice("matcher", name, matcherNames());
  throw std::logic_error("a matcher is named that can't be made");
}

}  // namespace active_matching_slam
