#include "active_matching_slam/image/correlation.h"

#include <algorithm>
#include <cmath>

#include "correlation_kernels.h"

namespace active_matching_slam {
namespace {

const CorrelationKernels* chooseKernels(Correlator::Kernel kernel) {
  using Kernel = Correlator::Kernel;
  if (kernel == Kernel::kAvx2 || kernel == Kernel::kAutomatic)
    if (const CorrelationKernels* kernels = avx2Kernels()) return kernels;
  if (kernel == Kernel::kSse2 || kernel == Kernel::kAutomatic)
    if (const CorrelationKernels* kernels = sse2Kernels()) return kernels;
  return &portableKernels();
}

/// A column is summed over rows of the window; sums wait here for the first.
constexpr int kNothingSummed = -1;

}  // namespace

Correlator::Correlator(double minimum_contrast, Kernel kernel)
    : minimum_contrast_(minimum_contrast), kernels_(chooseKernels(kernel)) {}

void Correlator::correlate(const cv::Mat& image, const Template& patch,
                           const std::vector<PixelRun>& runs, std::vector<float>* scores) {
  std::size_t positions = 0;
  int begin_u = 0, end_u = 0;
  for (const PixelRun& run : runs) {
    begin_u = positions == 0 ? run.begin_u : std::min(begin_u, run.begin_u);
    end_u = positions == 0 ? run.end_u : std::max(end_u, run.end_u);
    positions += run.end_u - run.begin_u;
  }
  if (positions == 0 || patch.size == 0 || patch.energy <= 0) {
    scores->assign(positions, 0.0f);
    return;
  }
  const int half = patch.size / 2;
  prepareTemplate(patch);
  prepareWindow(image, begin_u - half, end_u + half, runs.front().v - half, runs.back().v + half);
  scores->resize(positions + kKernelOverrun);
  scoreRuns(patch, runs, begin_u, scores->data());
  scores->resize(positions);
}

/// Taps are the template less its rounded mean, which keeps the products small; the score is the
/// same.
void Correlator::prepareTemplate(const Template& patch) {
  const int size = patch.size, n = size * size;
  const int mean = static_cast<int>((2 * patch.sum + n) / (2 * n));
  taps_.assign(size * (size + 1), 0);
  for (int row = 0; row < size; ++row)
    for (int column = 0; column < size; ++column)
      taps_[row * (size + 1) + column] = static_cast<std::int16_t>(patch.at(row, column) - mean);
  tap_sum_ = static_cast<double>(patch.sum - static_cast<std::int64_t>(n) * mean);
}

/// Copies the part of the image that the template touches, widened to 16 bits. What stands in the
/// overrun of a row from earlier frames does no harm.
void Correlator::prepareWindow(const cv::Mat& image, int begin_u, int end_u, int first_v,
                               int last_v) {
  width_ = end_u - begin_u;
  stride_ = width_ + kKernelOverrun;
  window_.resize(static_cast<std::size_t>(stride_) * (last_v - first_v + 1));
  for (int v = first_v; v <= last_v; ++v) {
    const std::uint8_t* from = image.ptr<std::uint8_t>(v) + begin_u;
    std::copy(from, from + width_, &window_[static_cast<std::size_t>(v - first_v) * stride_]);
  }
  column_sums_.resize(stride_);
  column_squares_.resize(stride_);
}

void Correlator::scoreRuns(const Template& patch, const std::vector<PixelRun>& runs, int begin_u,
                           float* scores) {
  KernelTemplate t;
  t.size = patch.size;
  t.taps = taps_.data();
  t.tap_sum = tap_sum_;
  t.inverse_norm = 1.0 / std::sqrt(static_cast<double>(patch.energy));
  const double n = patch.size * patch.size;
  t.least_energy = std::max(1.0, minimum_contrast_ * minimum_contrast_ * n * n);

  const auto rowAt = [&](int row) { return &window_[static_cast<std::size_t>(row) * stride_]; };
  std::int32_t *sums = column_sums_.data(), *squares = column_squares_.data();
  int summed_row = kNothingSummed;  // columns are summed from here over the template's height
  for (const PixelRun& run : runs) {
    const int row = run.v - runs.front().v, first = run.begin_u - begin_u;
    if (summed_row == kNothingSummed || row - summed_row >= patch.size) {
      std::fill(column_sums_.begin(), column_sums_.end(), 0);
      std::fill(column_squares_.begin(), column_squares_.end(), 0);
      for (int i = 0; i < patch.size; ++i) kernels_->addRow(rowAt(row + i), width_, sums, squares);
      summed_row = row;
    }
    for (; summed_row < row; ++summed_row)
      kernels_->exchangeRow(rowAt(summed_row + patch.size), rowAt(summed_row), width_, sums,
                            squares);
    const KernelRun input{rowAt(row) + first, stride_, sums + first, squares + first,
                          run.end_u - run.begin_u};
    kernels_->scoreRun(t, input, scores);
    scores += input.count;
  }
}

}  // namespace active_matching_slam
