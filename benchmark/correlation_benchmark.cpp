// Cost of searching elliptical windows: the package's correlation of runs of pixels against
// cv::matchTemplate on the ellipse's bounding box, and against the least that any search must do:
// read its window of the image once (`readWindow`, in the cache and from memory). `per_px` is the
// time per pixel of the ellipse in all.

#include <benchmark/benchmark.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/correlation.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/image/subpixel.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

constexpr int kSize = 11;
const PixelBox kBox{20, 20, 619, 459};

cv::Mat texturedImage() {
  std::mt19937 generator(1);
  cv::Mat image(480, 640, CV_8UC1);
  for (int v = 0; v < image.rows; ++v)
    for (int u = 0; u < image.cols; ++u) image.at<std::uint8_t>(v, u) = generator() % 256;
  cv::GaussianBlur(image, image, cv::Size(9, 9), 2.0);
  cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
  return image;
}

Template cutTemplate(const cv::Mat& image, int u, int v) {
  return *makeTemplate(image(cv::Rect(u - kSize / 2, v - kSize / 2, kSize, kSize)));
}

SearchEllipse ellipseOf(double sigma_px) {
  // Twice as long as wide and inclined, of the area of a circle of sigma_px.
  const Eigen::Rotation2Dd rotation(0.5);
  const Eigen::Vector2d variances(2.0 * sigma_px * sigma_px, 0.5 * sigma_px * sigma_px);
  return {{320.3, 240.7},
          rotation.toRotationMatrix() * variances.asDiagonal() *
              rotation.toRotationMatrix().transpose()};
}

void reportPerPixel(benchmark::State& state, double pixels) {
  state.counters["px"] = pixels;
  state.counters["per_px"] = benchmark::Counter(
      pixels, benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void correlateRuns(benchmark::State& state, Correlator::Kernel kernel) {
  const cv::Mat image = texturedImage();
  const Template patch = cutTemplate(image, 322, 240);
  std::vector<PixelRun> runs;
  forEachEllipseRun(ellipseOf(state.range(0)), kBox,
                    [&](const PixelRun& run) { runs.push_back(run); });
  Correlator correlator(1.0, kernel);
  std::vector<float> scores;
  for (auto _ : state) {
    correlator.correlate(image, patch, runs, &scores);
    benchmark::DoNotOptimize(scores.data());
  }
  reportPerPixel(state, static_cast<double>(scores.size()));
}

void matchTemplateOnBox(benchmark::State& state) {
  const cv::Mat image = texturedImage();
  const cv::Mat patch = cutTemplate(image, 322, 240).image();
  int pixels = 0;
  PixelBox box{1000, 1000, 0, 0};
  forEachEllipseRun(ellipseOf(state.range(0)), kBox, [&](const PixelRun& run) {
    pixels += run.end_u - run.begin_u;
    box = {std::min(box.min_u, run.begin_u), std::min(box.min_v, run.v),
           std::max(box.max_u, run.end_u - 1), std::max(box.max_v, run.v)};
  });
  const cv::Rect window(box.min_u - kSize / 2, box.min_v - kSize / 2, box.max_u - box.min_u + kSize,
                        box.max_v - box.min_v + kSize);
  cv::setNumThreads(1);
  cv::Mat scores;
  for (auto _ : state) {
    cv::matchTemplate(image(window), patch, scores, cv::TM_CCOEFF_NORMED);
    benchmark::DoNotOptimize(scores.data);
  }
  reportPerPixel(state, pixels);
}

/// Reads the window of an ellipse once: of one image, which stays in the cache, or of so many in
/// turn that each comes from memory.
void readWindow(benchmark::State& state, int images) {
  const cv::Mat image = texturedImage();
  std::vector<cv::Mat> copies;
  for (int i = 0; i < images; ++i) copies.push_back(image.clone());
  int pixels = 0, reach = 0;
  const SearchEllipse ellipse = ellipseOf(static_cast<double>(state.range(0)));
  forEachEllipseRun(ellipse, kBox, [&](const PixelRun& run) {
    pixels += run.end_u - run.begin_u;
    reach = std::max({reach, 320 - run.begin_u, run.end_u - 320, std::abs(run.v - 240)});
  });
  reach += kSize / 2 + 1;
  const cv::Rect window(320 - reach, 240 - reach, 2 * reach + 1, 2 * reach + 1);
  std::size_t next = 0;
  for (auto _ : state) {
    benchmark::DoNotOptimize(cv::sum(copies[next](window)));
    if (++next == copies.size()) next = 0;
  }
  reportPerPixel(state, pixels);
}

/// A whole search: ellipse, mask, scores, maxima, refined matches.
void searchEllipse(benchmark::State& state) {
  const cv::Mat image = texturedImage();
  ImageFeatureSearch search{ImageOptions()};
  const std::vector<Template> templates(50, cutTemplate(image, 322, 240));
  const SearchEllipse ellipse = ellipseOf(state.range(0));
  for (auto _ : state) {
    search.beginFrame(image, templates);
    for (int i = 0; i < search.featureCount(); ++i)
      benchmark::DoNotOptimize(search.search(i, ellipse));
  }
  reportPerPixel(state, static_cast<double>(search.pixelsSearched()));
}

void warpPatch(benchmark::State& state) {
  CameraCalibration calibration;
  calibration.width = 640;
  calibration.height = 480;
  calibration.fx = calibration.fy = 500.0;
  calibration.cx = 320.0;
  calibration.cy = 240.0;
  calibration.distortion_model = DistortionModel::kPlumbBob;
  calibration.distortion = {-0.2, 0.05, 0.001, 0.001, 0.0};
  const CameraModel camera(calibration);
  const Eigen::Vector2d pixel(350.0, 200.0);
  const SourcePatch patch =
      *extractSourcePatch(texturedImage(), pixel, Eigen::Isometry3d::Identity(), 31);
  const Eigen::Vector4d point = camera.unproject(pixel)->homogeneous();
  Eigen::Isometry3d now = Eigen::Isometry3d::Identity();
  now.translate(Eigen::Vector3d(0.1, 0.05, 0.1));
  Template warped;
  for (auto _ : state) {
    const auto view = predictPatchView(patch, camera, now, point);
    benchmark::DoNotOptimize(warpTemplate(patch, *view, kSize, &warped));
  }
}

void refineMatch(benchmark::State& state) {
  const cv::Mat image = texturedImage();
  const Template patch = cutTemplate(image, 322, 240);
  for (auto _ : state)
    benchmark::DoNotOptimize(refineSubpixel(image, patch, Eigen::Vector2d(322.15, 239.9)));
}

/// Argument: how many corners are wanted beside those of a grid.
void findCorners(benchmark::State& state) {
  const cv::Mat image = texturedImage();
  std::vector<Eigen::Vector2d> occupied;
  for (int v = 20; v < 480; v += 60)
    for (int u = 20; u < 640; u += 80) occupied.push_back(Eigen::Vector2d(u, v));
  for (auto _ : state)
    benchmark::DoNotOptimize(
        detectCorners(image, occupied, static_cast<int>(state.range(0)), 20.0, ImageOptions()));
}

BENCHMARK_CAPTURE(correlateRuns, best, Correlator::Kernel::kAutomatic)->Arg(1)->Arg(3)->Arg(8);
BENCHMARK_CAPTURE(correlateRuns, sse2, Correlator::Kernel::kSse2)->Arg(1)->Arg(3)->Arg(8);
BENCHMARK_CAPTURE(correlateRuns, portable, Correlator::Kernel::kPortable)->Arg(1)->Arg(3)->Arg(8);
BENCHMARK(matchTemplateOnBox)->Arg(1)->Arg(3)->Arg(8);
BENCHMARK_CAPTURE(readWindow, cached, 1)->Arg(1)->Arg(3)->Arg(8);
BENCHMARK_CAPTURE(readWindow, from_memory, 400)->Arg(1)->Arg(3)->Arg(8);
BENCHMARK(searchEllipse)->Arg(1)->Arg(3)->Arg(8);
BENCHMARK(warpPatch);
BENCHMARK(refineMatch);
BENCHMARK(findCorners)->Arg(3)->Arg(60);

}  // namespace
}  // namespace active_matching_slam

BENCHMARK_MAIN();
