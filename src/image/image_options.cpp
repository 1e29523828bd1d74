#include "active_matching_slam/image/image_options.h"

#include "active_matching_slam/image/template.h"

namespace active_matching_slam {

void checkImageOptions(const ImageOptions& o) {
  checkFields(o);
  static_assert(Template::kMaximumSize == 31, "the range of template_size_px ends there");
  if (o.template_size_px % 2 == 0)
    refuseOption("image/template_size_px = " + std::to_string(o.template_size_px) + " is not odd");
  if (o.source_patch_size_px % 2 == 0 || o.source_patch_size_px < o.template_size_px + 2)
    refuseOption("image/source_patch_size_px = " + std::to_string(o.source_patch_size_px) +
                 " is not an odd number from image/template_size_px + 2 = " +
                 std::to_string(o.template_size_px + 2));
}

}  // namespace active_matching_slam
