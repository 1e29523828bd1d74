#pragma once

#include "active_matching_slam/information/submap_partition.h"

namespace active_matching_slam {

/// `submaps` (1 or more) parts of the hierarchy's tree that preserve as much information as can be
/// found: links of the tree are cut one by one, each time the one that costs least, and then
/// exchanged as long as that gains. What remains in one piece alone preserves the more the larger
/// it is, so no cut leaves a part with less than 1 / (3 submaps - 2) of the features: a quarter for
/// two submaps, a third of an equal part for many. (Only where no such cut is left may parts be
/// half as large, and so on.)
///
/// partitionIntoSubmaps() takes the tree's links in the order of the hierarchy instead, so that its
/// partitions contain the levels and one another; but a cluster that took its strongest link in an
/// early round is bound by it, however much a later one would hold together.
///
/// Parts of the graph that are not connected are kept together by links without information, where
/// one feature was initialised after the other: they come apart first, but what is too small for a
/// submap of its own goes with its neighbours in time. No more submaps than features are returned.
/// Throws std::invalid_argument as partitionIntoSubmaps() does. O(submaps (links + features
/// submaps)) for each sweep of exchanges, of which there are few.
SubmapPartition cutIntoSubmaps(const MutualInformationGraph& graph,
                               const SubmapHierarchy& hierarchy, int submaps);

/// A cut as a level, with what the naive partition into as many parts preserves of the graph.
/// Throws as levelOfLabels() does.
SubmapLevel levelOf(SubmapPartition cut, const MutualInformationGraph& graph);

}  // namespace active_matching_slam
