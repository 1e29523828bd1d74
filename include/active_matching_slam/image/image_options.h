#pragma once

#include "active_matching_slam/math/option_field.h"

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

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void ImageOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("image/template_size_px", "px", "side of the correlated template, odd")
            .atStartOnly(),
        o.template_size_px, 5, 31);
  visit(basicOption("image/match_threshold", "",
                    "least zero-mean normalised cross-correlation of a match"),
        o.match_threshold, 0.1, 0.999);
  visit(
      basicOption("image/corner_quality", "",
                  "least response of a new feature's corner, as a fraction of the strongest one's"),
      o.corner_quality, 1e-6, 1.0);
  visit(basicOption("image/minimum_contrast", "grey levels",
                    "least standard deviation of a template"),
        o.minimum_contrast, 0.0, 128.0);
  visit(basicOption("image/working_width", "px",
                    "images of more pixels than one of 4:3 of this width are tracked reduced to as "
                    "many")
            .atStartOnly(),
        o.working_width, 160, 10000);
  visit(
      advancedOption("image/source_patch_size_px", "px",
                     "side of the patch stored at first sight, odd, larger than the template by 2")
          .atStartOnly(),
      o.source_patch_size_px, 7, 101);
  visit(advancedOption("image/border_px", "px",
                       "features are not searched closer to the image border"),
        o.border_px, 0, 200);
}

/// Throws std::invalid_argument with name, value and what is allowed.
void checkImageOptions(const ImageOptions& options);

}  // namespace active_matching_slam
