#include "active_matching_slam/simulation/simulator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace active_matching_slam {
namespace {

using Eigen::Vector2d;

/// Small and quick to build.
SimulatorOptions smallOptions() {
  SimulatorOptions options;
  options.scene = "checkerboard";
  options.width = 160;
  options.height = 120;
  options.rate_hz = 10.0;
  options.duration_s = 1.0;
  return options;
}

std::vector<SimulatedFrame> run(const SimulatorOptions& options) {
  Simulator simulator(options);
  std::vector<SimulatedFrame> frames;
  while (auto frame = simulator.next()) frames.push_back(*frame);
  return frames;
}

TEST(Simulator, RepeatsItselfBitForBit) {
  SimulatorOptions options = smallOptions();
  options.occluder = true;
  options.readout_ms = 20.0;
  const auto one = run(options), two = run(options);
  ASSERT_EQ(one.size(), 10u);
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(cv::norm(one[i].image, two[i].image, cv::NORM_INF), 0.0);
    EXPECT_EQ(one[i].truth.T_world_camera.matrix(), two[i].truth.T_world_camera.matrix());
    EXPECT_EQ(one[i].gain, two[i].gain);
  }
}

TEST(Simulator, AnotherSeedIsAnotherSequence) {
  SimulatorOptions options = smallOptions();
  const auto one = run(options);
  options.seed = 2;
  const auto two = run(options);
  EXPECT_GT(cv::norm(one[5].image, two[5].image, cv::NORM_L1), 160 * 120);
  EXPECT_FALSE(one[5].truth.T_world_camera.isApprox(two[5].truth.T_world_camera, 1e-4));
}

TEST(Simulator, StampsFramesAtTheRateFromOneSecond) {
  const auto frames = run(smallOptions());
  const Simulator simulator(smallOptions());
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].index, static_cast<int>(i));
    EXPECT_DOUBLE_EQ(frames[i].stamp_s, 1.0 + 0.1 * i);
    EXPECT_TRUE(frames[i].truth.T_world_camera.isApprox(
        simulator.truthAt(frames[i].stamp_s).T_world_camera, 1e-12));
  }
}

TEST(Simulator, ShowsTheCheckerboardWhereTruthSays) {
  SimulatorOptions options = smallOptions();
  options.width = 640;
  options.height = 480;
  options.motion = "jerky";
  options.rate_hz = 5.0;
  options.exposure_ms = 0.0;
  options.noise = 0.5;
  Simulator simulator(options);
  const CameraModel& camera = simulator.camera();
  const Surface* board = nullptr;
  for (const Surface& s : simulator.scene().surfaces)
    if (std::abs(s.width_m - 0.96) < 1e-9 && std::abs(s.height_m - 0.72) < 1e-9) board = &s;
  ASSERT_NE(board, nullptr);
  int seen = 0;
  while (const auto frame = simulator.next()) {
    cv::Mat image;
    cv::GaussianBlur(frame->image, image, {}, 1.0);  // the detector needs edges wider than a pixel
    double sum2 = 0.0;
    int count = 0;
    for (int i = 1; i < 24; ++i)
      for (int j = 1; j < 18; ++j) {
        const auto pixel =
            camera.project(frame->truth.T_world_camera.inverse() * board->at(0.04 * i, 0.04 * j));
        if (!pixel || !camera.isInImage(*pixel, 15.0) || pixel->y() < 150.0) continue;
        std::vector<cv::Point2f> found = {cv::Point2f(pixel->x(), pixel->y())};
        cv::cornerSubPix(
            frame->image, found, {4, 4}, {-1, -1},
            cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-4));
        sum2 += (Vector2d(found[0].x, found[0].y) - *pixel).squaredNorm();
        ++count;
      }
    if (count == 0) continue;
    EXPECT_LT(std::sqrt(sum2 / count), 0.08) << "frame " << frame->index;
    seen += count;
  }
  EXPECT_GT(seen, 300);
}

TEST(Simulator, AutoExposureKeepsTheMeanWhileTheLightChanges) {
  SimulatorOptions options = smallOptions();
  options.motion = "still";
  options.duration_s = 16.0;
  options.rate_hz = 4.0;
  options.exposure_ms = 0.0;
  options.drift = 0.5;
  options.auto_exposure = false;
  const auto spread = [](const std::vector<SimulatedFrame>& frames) {
    double low = 255.0, high = 0.0;
    for (const SimulatedFrame& frame : frames) {
      low = std::min(low, cv::mean(frame.image)[0]);
      high = std::max(high, cv::mean(frame.image)[0]);
    }
    return high - low;
  };
  const double fixed = spread(run(options));
  options.auto_exposure = true;
  const double followed = spread(run(options));
  EXPECT_GT(fixed, 20.0);
  EXPECT_LT(followed, 0.6 * fixed);
  options.drift = 0.0;
  EXPECT_LT(spread(run(options)), 1.0);
}

TEST(Simulator, TheHandCrossesNowAndThen) {
  SimulatorOptions options = smallOptions();
  options.motion = "still";
  options.duration_s = 6.0;
  options.drift = 0.0;
  options.auto_exposure = false;
  const auto clear = run(options);
  options.occluder = true;
  const auto crossed = run(options);
  int covered = 0;
  for (std::size_t i = 0; i < clear.size(); ++i) {
    cv::Mat difference;
    cv::absdiff(clear[i].image, crossed[i].image, difference);
    covered += cv::countNonZero(difference > 25) > 160 * 120 / 50;
  }
  EXPECT_GT(covered, 4);
  EXPECT_LT(covered, 30);
}

TEST(Simulator, RefusesEveryBadOptionByName) {
  const auto message = [](const std::function<void(SimulatorOptions&)>& change) {
    SimulatorOptions options = smallOptions();
    change(options);
    try {
      Simulator simulator(options);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string("no exception");
  };
  using O = SimulatorOptions;
  EXPECT_EQ(message([](O& o) { o.width = 10; }), "width = 10 is out of range [64, 4096]");
  EXPECT_EQ(message([](O& o) { o.height = 9999; }), "height = 9999 is out of range [64, 4096]");
  EXPECT_EQ(message([](O& o) { o.rate_hz = 0.0; }), "rate_hz = 0 is out of range [0.1, 1000]");
  EXPECT_EQ(message([](O& o) { o.duration_s = -1; }), "duration_s = -1 is out of range [0, 36000]");
  EXPECT_EQ(message([](O& o) { o.exposure_ms = 500; }),
            "exposure_ms = 500 is out of range [0, 100]");
  EXPECT_EQ(message([](O& o) { o.noise = NAN; }), "noise = nan is out of range [0, 50]");
  EXPECT_EQ(message([](O& o) { o.vignetting = 1; }), "vignetting = 1 is out of range [0, 0.9]");
  EXPECT_EQ(message([](O& o) { o.drift = 2; }), "drift = 2 is out of range [0, 0.9]");
  EXPECT_EQ(message([](O& o) { o.readout_ms = -3; }), "readout_ms = -3 is out of range [0, 100]");
  EXPECT_EQ(message([](O& o) { o.distortion = "fov"; }),
            "distortion = 'fov' is not one of none, plumb_bob, rational_polynomial, equidistant");
  EXPECT_NE(message([](O& o) { o.scene = "moon"; }).find("scene = 'moon'"), std::string::npos);
  EXPECT_NE(message([](O& o) { o.motion = "fly"; }).find("motion = 'fly'"), std::string::npos);
}

TEST(Simulator, EveryLensSeesAWholeImage) {
  for (const char* lens : {"none", "plumb_bob", "rational_polynomial", "equidistant"}) {
    SimulatorOptions options = smallOptions();
    options.distortion = lens;
    options.duration_s = 0.0;
    const auto frames = run(options);
    ASSERT_EQ(frames.size(), 1u);
    EXPECT_EQ(cv::countNonZero(frames[0].image < 3), 0) << lens;
  }
}

}  // namespace
}  // namespace active_matching_slam
