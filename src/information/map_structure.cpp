#include "active_matching_slam/information/map_structure.h"

#include <utility>

#include "active_matching_slam/information/submap_cut.h"

namespace active_matching_slam {

void MapStructure::addFrame(const std::vector<std::int64_t>& ids,
                            const Eigen::Ref<const Eigen::MatrixXd>& S) {
  if (is_outdated_) accumulator_.clear();
  is_outdated_ = false;
  accumulator_.addFrame(ids, S);
}

void MapStructure::forgetWeakest(const std::vector<std::int64_t>& ids, int most) {
  accumulator_.forgetWeakest(ids, most);
}

void MapStructure::clear() {
  accumulator_.clear();
  tracker_.clear();
  is_outdated_ = false;
}

MapStructure::Snapshot MapStructure::snapshot(const SubmapOptions& options) {
  auto graph = std::make_shared<MutualInformationGraph>(accumulator_.links());
  auto submaps = std::make_shared<SubmapHierarchy>(buildSubmapHierarchy(*graph));
  if (options.isRequest())
    submaps->requested = levelOf(requestedSubmaps(*graph, *submaps, options), *graph);
  tracker_.relabel(*submaps);
  return {std::move(graph), std::move(submaps)};
}

void MapStructure::restore(const MutualInformationGraph& graph) {
  accumulator_ = MutualInformationAccumulator(graph);
  tracker_.clear();
  is_outdated_ = false;
}

}  // namespace active_matching_slam
