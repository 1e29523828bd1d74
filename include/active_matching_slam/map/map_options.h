#pragma once

namespace active_matching_slam {

/// Settings of map maintenance.
struct MapOptions {
  int features_per_frame = 60;  ///< wanted measured features in a frame
  int maximum_features = 150;   ///< the map never holds more
  /// A new feature keeps from every predicted one [px of an image of 640 x 480].
  double minimum_distance_px = 20;
  double maximum_view_angle_deg = 60.0;
  double minimum_scale = 0.5, maximum_scale = 2.0;  ///< scale change since the first view
  int retire_after_attempts = 10;                   ///< a feature searched this often ...
  double retire_success_ratio = 0.5;                ///< ... is retired when it matched less often
};

void checkMapOptions(const MapOptions& options);

}  // namespace active_matching_slam
