#include "active_matching_slam/visualisation/link_view.h"

#include <algorithm>
#include <cstdint>
#include <unordered_map>

namespace active_matching_slam {

std::vector<InformationLink> linksToShow(std::vector<InformationLink> links,
                                         const DrawOptions& options) {
  std::stable_sort(links.begin(), links.end(), [](const auto& a, const auto& b) {
    return a.information_bits > b.information_bits;
  });
  std::unordered_map<std::int64_t, int> stronger;  // how many links of a feature came before
  const auto isHidden = [&](const InformationLink& link) {
    const int before = std::min(stronger[link.first]++, stronger[link.second]++);
    return !link.in_tree && (before >= options.links_per_feature ||
                             link.information_bits < options.minimum_link_bits);
  };
  // In order, as std::remove_if doesn't promise.
  std::vector<InformationLink> shown;
  for (const InformationLink& link : links)
    if (!isHidden(link)) shown.push_back(link);
  std::reverse(shown.begin(), shown.end());
  return shown;
}

}  // namespace active_matching_slam
