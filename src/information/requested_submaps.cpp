#include "active_matching_slam/information/requested_submaps.h"

#include <algorithm>
#include <sstream>

#include "active_matching_slam/information/submap_cut.h"

namespace active_matching_slam {
namespace {

/// The most submaps that preserve `fraction`, as far as what is preserved falls with their number:
/// doubled until it is too little, then bisected.
SubmapPartition cutPreserving(const MutualInformationGraph& graph, const SubmapHierarchy& hierarchy,
                              double fraction) {
  const int features = static_cast<int>(hierarchy.ids.size());
  SubmapPartition best = cutIntoSubmaps(graph, hierarchy, 1);
  int enough = best.submaps, too_many = features;
  for (int count = 2 * enough; count < too_many; count *= 2) {
    SubmapPartition partition = cutIntoSubmaps(graph, hierarchy, count);
    if (partition.preserved < fraction) {
      too_many = count;
      break;
    }
    enough = count;
    best = std::move(partition);
  }
  while (too_many - enough > 1) {
    const int count = enough + (too_many - enough) / 2;
    SubmapPartition partition = cutIntoSubmaps(graph, hierarchy, count);
    if (partition.preserved < fraction) {
      too_many = count;
    } else {
      enough = count;
      best = std::move(partition);
    }
  }
  return best;
}

}  // namespace

void checkSubmapOptions(const SubmapOptions& options) {
  checkFields(options);
  std::ostringstream set;
  int requests = 0;
  const auto note = [&](const char* name, double value) {
    if (value > 0.0) set << (requests++ > 0 ? " and " : "") << name << " = " << value;
  };
  note("submaps/count", options.count);
  note("submaps/preserve", options.preserve);
  note("submaps/max_features", options.max_features);
  if (requests > 1) refuseOption(set.str() + " are set, of which one at most may be above 0");
}

SubmapPartition requestedSubmaps(const MutualInformationGraph& graph,
                                 const SubmapHierarchy& hierarchy, const SubmapOptions& options) {
  if (options.max_features > 0)
    return partitionLimitingSize(graph, hierarchy, options.max_features);
  if (options.preserve > 0.0) return cutPreserving(graph, hierarchy, options.preserve);
  return cutIntoSubmaps(graph, hierarchy, options.count);
}

}  // namespace active_matching_slam
