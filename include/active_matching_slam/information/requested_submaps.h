#pragma once

#include "active_matching_slam/information/submap_partition.h"
#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// How coarse the submaps are that a user wants; at most one of the first three is set. And how
/// much of the graph is kept.
struct SubmapOptions {
  int count = 0;            ///< so many submaps; 0: not asked for
  double preserve = 0.0;    ///< the most that preserve this fraction of the information; 0: not
  int max_features = 0;     ///< of so many features each at most; 0: not
  int kept_features = 500;  ///< that have left the map stay in the graph

  bool isRequest() const { return count > 0 || preserve > 0.0 || max_features > 0; }

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void SubmapOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("submaps/count", "",
                    "cut the map into so many submaps; 0: submaps are a level of the hierarchy"),
        o.count, 0, 10000);
  visit(basicOption("submaps/preserve", "",
                    "... or into the most that preserve this fraction of the mutual information; "
                    "0: not"),
        o.preserve, 0.0, 1.0);
  visit(basicOption("submaps/max_features", "",
                    "... or into submaps of so many features each at most; 0: not"),
        o.max_features, 0, 100000);
  visit(advancedOption("submaps/kept_features", "",
                       "features that have left the map and stay in the graph of mutual "
                       "information; the weakest go first"),
        o.kept_features, 0, 100000);
}

/// Throws std::invalid_argument with name, value and what is allowed.
void checkSubmapOptions(const SubmapOptions& options);

/// The partition that is asked for, by cutIntoSubmaps() or partitionLimitingSize(). `options` must
/// ask for one; throws std::invalid_argument as these do.
SubmapPartition requestedSubmaps(const MutualInformationGraph& graph,
                                 const SubmapHierarchy& hierarchy, const SubmapOptions& options);

}  // namespace active_matching_slam
