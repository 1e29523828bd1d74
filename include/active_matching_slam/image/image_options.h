#pragma once

namespace active_matching_slam {

/// Settings of patches, correlation and corner detection. Lengths in pixels of the image as
/// tracked.
struct ImageOptions {
  int template_size_px = 11;      ///< odd, 5 to 31: side of the correlated template
  int source_patch_size_px = 31;  ///< odd: stored at first sight, large enough to be warped
  double match_threshold = 0.8;   ///< least ZNCC of a match, (0, 1)
  double corner_quality = 0.2;    ///< Shi-Tomasi: least fraction of the strongest response
  double minimum_contrast = 4.0;  ///< least standard deviation of a template [grey levels]
  int border_px = 8;              ///< features are not searched closer to the image border
  /// Images of more pixels than one of 4:3 of this width are reduced to as many, see WorkingSize.
  int working_width = 800;
};

void checkImageOptions(const ImageOptions& options);

}  // namespace active_matching_slam
