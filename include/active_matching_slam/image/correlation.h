#pragma once

#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/image/template.h"
#include "active_matching_slam/matching/pixel_mask.h"

namespace active_matching_slam {

struct CorrelationKernels;

/// Zero-mean normalised cross-correlation of a template with an 8-bit grey image,
///   (n sum tI - sum t sum I) / sqrt((n sum t^2 - (sum t)^2) (n sum I^2 - (sum I)^2)),
/// at runs of positions (template centres). All sums are exact integers, so the scores are the same
/// bit for bit whatever instruction set is chosen at run time. Keeps scratch memory between calls.
class Correlator {
 public:
  enum class Kernel { kAutomatic, kPortable, kSse2, kAvx2 };

  /// `minimum_contrast`: image windows of a lower standard deviation [grey levels] score 0.
  /// `kernel`: kAutomatic takes the fastest this machine has; one that it lacks falls back to
  /// kPortable.
  explicit Correlator(double minimum_contrast = 1.0, Kernel kernel = Kernel::kAutomatic);

  /// Scores of all positions of `runs`, one after another, into `scores` (resized). The template
  /// must lie wholly inside the image at every position. `runs` by ascending v. An empty or flat
  /// template scores 0 everywhere.
  void correlate(const cv::Mat& image, const Template& patch, const std::vector<PixelRun>& runs,
                 std::vector<float>* scores);

 private:
  void prepareTemplate(const Template& patch);
  void prepareWindow(const cv::Mat& image, int begin_u, int end_u, int first_v, int last_v);
  void scoreRuns(const Template& patch, const std::vector<PixelRun>& runs, int begin_u,
                 float* scores);

  double minimum_contrast_;
  const CorrelationKernels* kernels_;

  // Scratch of one call.
  std::vector<std::int16_t> taps_, window_;
  std::vector<std::int32_t> column_sums_, column_squares_;
  double tap_sum_ = 0.0;
  int width_ = 0;
  std::ptrdiff_t stride_ = 0;
};

}  // namespace active_matching_slam
