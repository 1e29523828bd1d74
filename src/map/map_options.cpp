#include "active_matching_slam/map/map_options.h"

namespace active_matching_slam {

void checkMapOptions(const MapOptions& options) {
  checkFields(options);
  if (options.maximum_features < options.features_per_frame)
    refuseOption(
        "map/maximum_features = " + std::to_string(options.maximum_features) +
        " is less than map/features_per_frame = " + std::to_string(options.features_per_frame));
}

}  // namespace active_matching_slam
