#pragma once

#include <vector>

#include "active_matching_slam/information/mutual_information_graph.h"
#include "active_matching_slam/visualisation/draw_options.h"

namespace active_matching_slam {

/// Which of `links` to show, the weakest first, so that the strong ones are drawn over them. In a
/// graph nearly all features are linked with one another: drawn whole, it hides itself. So of the
/// links of at least `minimum_link_bits` those are left that are among the `links_per_feature`
/// strongest of either end; and those of the tree, always.
std::vector<InformationLink> linksToShow(std::vector<InformationLink> links,
                                         const DrawOptions& options);

}  // namespace active_matching_slam
