#pragma once

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// Settings of map maintenance.
struct MapOptions {
  int features_per_frame = 60;  ///< wanted measured features in a frame
  int maximum_features = 150;   ///< the map never holds more
  /// Features are measured by what they tell; else spread over the image.
  bool choose_by_information = false;
  /// Those leave a full map that tell least of the camera; else by a rule of thumb.
  bool retire_by_information = true;
  /// A new feature keeps from every predicted one [px of an image of 640 x 480].
  double minimum_distance_px = 20;
  double maximum_view_angle_deg = 60.0;
  double minimum_scale = 0.5, maximum_scale = 2.0;  ///< scale change since the first view
  int retire_after_attempts = 10;                   ///< a feature searched this often ...
  double retire_success_ratio = 0.5;                ///< ... is retired when it matched less often

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void MapOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("map/features_per_frame", "", "features measured in a frame"),
        o.features_per_frame, 4, 1000);
  visit(basicOption("map/maximum_features", "", "the map never holds more"), o.maximum_features, 4,
        5000);
  visit(advancedOption("map/choose_by_information", "",
                       "measure the features that tell most for their time; false: those "
                       "spread over the image"),
        o.choose_by_information);
  visit(
      advancedOption("map/retire_by_information", "",
                     "the features that told least of the camera of late leave a full map; false: "
                     "those far off the axis, seen from elsewhere, or failing"),
      o.retire_by_information);
  visit(basicOption("map/minimum_distance_px", "px",
                    "between a new feature and every other in an image of 640 x 480; in others by "
                    "the root of the number of pixels"),
        o.minimum_distance_px, 2.0, 500.0);
  visit(advancedOption("map/maximum_view_angle_deg", "deg",
                       "a feature is searched while its direction has turned less since first "
                       "sight"),
        o.maximum_view_angle_deg, 1.0, 89.0);
  visit(
      advancedOption("map/minimum_scale", "",
                     "a feature is searched while it appears at least so large as at first sight"),
      o.minimum_scale, 0.05, 1.0);
  visit(advancedOption("map/maximum_scale", "", "... and at most so large"), o.maximum_scale, 1.0,
        20.0);
  visit(advancedOption("map/retire_after_attempts", "",
                       "a feature searched this often may be retired"),
        o.retire_after_attempts, 1, 100000);
  visit(advancedOption("map/retire_success_ratio", "",
                       "... when it was matched in less than this fraction"),
        o.retire_success_ratio, 0.0, 1.0);
}

/// Throws std::invalid_argument with name, value and what is allowed.
void checkMapOptions(const MapOptions& options);

}  // namespace active_matching_slam
