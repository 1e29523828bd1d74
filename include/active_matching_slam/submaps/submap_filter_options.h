#pragma once

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// Whether, and how, the filter keeps what leaves a full map.
struct SubmapFilterOptions {
  bool enabled = false;         ///< what leaves a full map is kept in submaps, not deleted
  int leaf_features = 40;       ///< of a submap, at most
  int separator_features = 10;  ///< by which a submap hangs on the rest, at most
  /// Separator features that are out of view, at most; with more, nothing else is laid aside.
  int trunk_features = 300;

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void SubmapFilterOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("submaps/enabled", "",
                    "lay aside in submaps what leaves a full map, and find it again; false: it is "
                    "deleted")
            .atStartOnly(),
        o.enabled);
  visit(advancedOption("submaps/leaf_features", "",
                       "features of a submap that is laid aside, at most"),
        o.leaf_features, 20, 200);
  visit(advancedOption("submaps/separator_features", "",
                       "features by which it stays linked to the rest of the map, at most; the "
                       "fewer, the more the links cut knew"),
        o.separator_features, 1, 50);
  visit(advancedOption("submaps/trunk_features", "",
                       "such features out of view, at most; with more, what leaves the map is "
                       "deleted"),
        o.trunk_features, 0, 2000);
}

}  // namespace active_matching_slam
