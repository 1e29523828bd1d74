#include "active_matching_slam/image/image_options.h"

#include <sstream>
#include <stdexcept>

#include "active_matching_slam/image/template.h"

namespace active_matching_slam {
namespace {

template <typename T>
void require(bool allowed, const char* name, T value, const char* range) {
  if (allowed) return;
  std::ostringstream message;
  message << "image/" << name << " = " << value << " is not " << range;
  throw std::invalid_argument(message.str());
}

}  // namespace

void checkImageOptions(const ImageOptions& o) {
  static_assert(Template::kMaximumSize == 31, "the messages below name it");
  require(o.template_size_px % 2 == 1 && o.template_size_px >= 5 && o.template_size_px <= 31,
          "template_size_px", o.template_size_px, "an odd number from 5 to 31");
  require(o.source_patch_size_px % 2 == 1 && o.source_patch_size_px >= o.template_size_px + 2 &&
              o.source_patch_size_px <= 101,
          "source_patch_size_px", o.source_patch_size_px,
          "an odd number from template_size_px + 2 to 101");
  require(o.match_threshold > 0.0 && o.match_threshold < 1.0, "match_threshold", o.match_threshold,
          "inside (0, 1)");
  require(o.corner_quality > 0.0 && o.corner_quality <= 1.0, "corner_quality", o.corner_quality,
          "inside (0, 1]");
  require(o.minimum_contrast >= 0.0 && o.minimum_contrast <= 128.0, "minimum_contrast",
          o.minimum_contrast, "inside [0, 128]");
  require(o.working_width >= 160 && o.working_width <= 10000, "working_width", o.working_width,
          "inside [160, 10000]");
  require(o.border_px >= 0 && o.border_px <= 10000, "border_px", o.border_px, "inside [0, 10000]");
}

}  // namespace active_matching_slam
