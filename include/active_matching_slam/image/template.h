#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>

namespace active_matching_slam {

/// Square 8-bit grey template with the sums that its correlation needs. The reference point is the
/// centre of its middle pixel. A plain value: copying allocates nothing.
struct Template {
  static constexpr int kMaximumSize = 31;

  int size = 0;  ///< odd side [px], 1 to kMaximumSize; 0: empty, matches nowhere
  std::array<std::uint8_t, kMaximumSize * kMaximumSize> pixels{};  ///< row by row, size * size used
  std::int64_t sum = 0;                                            ///< sum of t
  std::int64_t energy = 0;  ///< n * sum of t^2 - (sum of t)^2, n = size^2: n^2 times the variance

  std::uint8_t at(int row, int column) const { return pixels[row * size + column]; }
  /// Standard deviation [grey levels]; 0 when empty.
  double contrast() const;
  /// 8-bit copy, for drawing.
  cv::Mat image() const;
};

/// Recomputes sum and energy from the pixels.
void updateSums(Template* patch);

/// Template of a square 8-bit grey image of odd side up to Template::kMaximumSize; empty when the
/// image is none.
std::optional<Template> makeTemplate(const cv::Mat& image);

}  // namespace active_matching_slam
