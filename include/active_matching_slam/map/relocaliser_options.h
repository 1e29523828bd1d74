#pragma once

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// When a camera counts as found again.
struct RelocaliserOptions {
  int minimum_inliers = 10;            ///< features that must be found where they should be
  double minimum_visible_share = 0.5;  ///< of the features that should be seen and are searched
  double maximum_depth_sigma = 0.25;   ///< relative: features of vaguer depth are not used

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void RelocaliserOptions::visitFields(Self& o, Visitor&& visit) {
  visit(advancedOption("relocaliser/minimum_inliers", "",
                       "a lost camera is found when so many features match where they should be"),
        o.minimum_inliers, 6, 1000);
  visit(advancedOption("relocaliser/minimum_visible_share", "",
                       "... and this fraction of those that should be seen"),
        o.minimum_visible_share, 0.2, 1.0);
  visit(advancedOption("relocaliser/maximum_depth_sigma", "",
                       "features whose depth is vaguer, relative, are not used for that"),
        o.maximum_depth_sigma, 0.0, 1.0);
}

}  // namespace active_matching_slam
