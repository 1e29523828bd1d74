#include "active_matching_slam/tracker/match_cascade.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <random>

namespace active_matching_slam {
namespace {

constexpr int kColumns = 7, kRows = 5, kFeatures = kColumns * kRows;
constexpr double kNoisePx = 0.5;

/// Grey blobs of some pixels, so that every patch is unlike the others.
cv::Mat texture(unsigned seed, int width = 640, int height = 480) {
  cv::Mat noise(height, width, CV_32F), image;
  cv::RNG random(seed);
  random.fill(noise, cv::RNG::NORMAL, 0.0, 1.0);
  cv::GaussianBlur(noise, noise, cv::Size(), 3.0);
  cv::normalize(noise, noise, 0.0, 255.0, cv::NORM_MINMAX);
  noise.convertTo(image, CV_8U);
  return image;
}

/// `image` with its content moved by a whole number of pixels; what comes in is another texture.
cv::Mat shifted(const cv::Mat& image, const cv::Point& shift) {
  cv::Mat result = texture(99, image.cols, image.rows);
  const cv::Rect whole(0, 0, image.cols, image.rows);
  const cv::Rect target = (whole + shift) & whole;
  image(target - shift).copyTo(result(target));
  return result;
}

/// A grid of features, taken from `first` and predicted where they were, of a camera that may have
/// turned by `sigma_px` of the image; the image in hand is `image`.
FrameState makeFrame(const cv::Mat& first, const cv::Mat& image, double sigma_px) {
  FrameState frame{ImageOptions{}};
  frame.image = image;
  frame.reference_image = first;
  frame.interval_s = frame.predicted_interval_s = 1.0 / 30.0;
  frame.prior.z.resize(2 * kFeatures);
  frame.prior.noise_variance_px2 = kNoisePx * kNoisePx;
  Eigen::MatrixXd J(2 * kFeatures, 3);  // pan, tilt and roll
  for (int i = 0; i < kFeatures; ++i) {
    const Eigen::Vector2d pixel(110 + 70 * (i % kColumns), 80 + 80 * (i / kColumns));
    const int half = 5;
    const cv::Rect patch(int(pixel.x()) - half, int(pixel.y()) - half, 2 * half + 1, 2 * half + 1);
    frame.templates.push_back(*makeTemplate(first(patch).clone()));
    frame.candidates.emplace_back();
    frame.match_probabilities.push_back(0.9);
    frame.reference_px.emplace_back(pixel);
    frame.in_reference.push_back(1);
    frame.prior.ids.push_back(i);
    frame.prior.z.segment<2>(2 * i) = pixel;
    J.middleRows<2>(2 * i) << sigma_px, 0.0, 0.005 * (240.0 - pixel.y()), 0.0, sigma_px,
        0.005 * (pixel.x() - 320.0);
  }
  frame.prior.S = J * J.transpose();
  frame.prior.S.diagonal().array() += kNoisePx * kNoisePx;
  frame.search.beginFrame(image, frame.templates);
  return frame;
}

/// Inliers whose match is within a pixel of where the feature was, moved by `shift`.
int correctInliers(const FrameState& frame, const Eigen::Vector2d& shift) {
  return static_cast<int>(std::count_if(frame.inliers.begin(), frame.inliers.end(), [&](int i) {
    const auto& match = frame.search.matches(i)[frame.matching.match_of_feature[i]];
    return (match.pixel - *frame.reference_px[i] - shift).norm() < 1.0;
  }));
}

class EveryMatcherOfACascade : public testing::TestWithParam<const char*> {};
class EveryJointMatcherOfACascade : public testing::TestWithParam<const char*> {};

TEST_P(EveryMatcherOfACascade, MatchesWhatIsWhereItShouldBe) {
  const cv::Mat first = texture(1);
  FrameState frame = makeFrame(first, shifted(first, {3, -2}), 4.0);
  MatchCascade(GetParam()).match({}, true, &frame);
  EXPECT_EQ(correctInliers(frame, {3.0, -2.0}), kFeatures);
}

TEST_P(EveryMatcherOfACascade, FindsAJerkBeyondTheGatesByTheMotionOfTheImage) {
  const cv::Mat first = texture(1);
  const cv::Mat jerked = shifted(first, {40, 25});
  FrameState without = makeFrame(first, jerked, 4.0);
  MatchCascade(GetParam()).match({}, false, &without);
  EXPECT_LT(correctInliers(without, {40.0, 25.0}), kFeatures / 4);
  FrameState frame = makeFrame(first, jerked, 4.0);
  MatchCascade(GetParam()).match({}, true, &frame);
  const int matched = frame.matching.statistics.matched;
  EXPECT_GT(matched, 3 * kFeatures / 4);
  for (int i = 0; i < kFeatures; ++i) {
    const int match = frame.matching.match_of_feature[i];
    if (match < 0) continue;
    const Eigen::Vector2d motion = frame.search.matches(i)[match].pixel - *frame.reference_px[i];
    EXPECT_LT((motion - Eigen::Vector2d(40.0, 25.0)).norm(), 1.0) << i;
  }
}

TEST_P(EveryJointMatcherOfACascade, AcceptsNothingInAnImageOfSomethingElse) {
  for (unsigned seed = 2; seed < 6; ++seed) {
    FrameState frame = makeFrame(texture(1), texture(seed), 10.0);
    MatchCascade(GetParam()).match({}, true, &frame);
    EXPECT_EQ(frame.matching.statistics.matched, 0) << seed;
    EXPECT_TRUE(frame.inliers.empty()) << seed;
  }
}

INSTANTIATE_TEST_SUITE_P(MatchCascade, EveryMatcherOfACascade,
                         testing::Values("active_search", "jcbb", "one_point_ransac", "active",
                                         "fast_active", "chow_liu"));
// active_search takes the best score in each gate, whatever the others say.
INSTANTIATE_TEST_SUITE_P(MatchCascade, EveryJointMatcherOfACascade,
                         testing::Values("jcbb", "one_point_ransac", "active", "fast_active",
                                         "chow_liu"));

TEST(MatchCascade, GateDropsAMatchThatTheOthersContradict) {
  const cv::Mat first = texture(1);
  cv::Mat image = first.clone();
  // One feature's surroundings have moved by themselves.
  const cv::Rect moved(320 - 20, 240 - 20, 41, 41);
  first(moved).copyTo(image(moved + cv::Point(6, 0)));
  FrameState frame = makeFrame(first, image, 4.0);
  MatchCascade("active_search").match({}, true, &frame);
  EXPECT_EQ(correctInliers(frame, {0.0, 0.0}), kFeatures - 1);
  EXPECT_EQ(static_cast<int>(frame.inliers.size()), kFeatures - 1);
}

TEST(MatchCascade, BudgetGrowsWithTheIntervalAndHoldsForAllAttempts) {
  const cv::Mat first = texture(1);
  MatchOptions options;
  options.max_pixels = 2000;
  FrameState frame = makeFrame(first, texture(2), 8.0);
  MatchCascade("active").match(options, true, &frame);
  // The search that uses the budget up ends: one gate of 3 sigma more for each of the attempts.
  const double gate_px = M_PI * 24.0 * 24.0;
  EXPECT_LT(frame.matching.statistics.pixels_searched, 2000 + 4 * gate_px);
}

TEST(MatchCascade, ABusyMachineLeavesEnoughSearchesForAPose) {
  const cv::Mat first = texture(1);
  for (const char* matcher : {"active", "fast_active", "chow_liu", "jcbb", "active_search"}) {
    MatchOptions options;
    options.max_milliseconds = 5.0;
    double now_s = 0.0;
    options.clock_s = [&now_s] { return now_s += 0.02; };  // gone at the first look
    FrameState frame = makeFrame(first, shifted(first, {3, -2}), 4.0);
    MatchCascade(matcher).match(options, true, &frame);
    EXPECT_TRUE(frame.matching.statistics.cut_short) << matcher;
    EXPECT_GE(correctInliers(frame, {3.0, -2.0}), 8) << matcher;
  }
}

TEST(MatchCascade, UnknownMatcherIsRefused) {
  EXPECT_THROW(MatchCascade("nearest"), std::invalid_argument);
  MatchCascade cascade("active");
  EXPECT_THROW(cascade.setOptions("nearest", {}), std::invalid_argument);
}

TEST(MatchCascade, NothingPredictedIsNothingMatched) {
  FrameState frame{ImageOptions{}};
  frame.image = texture(1);
  frame.search.beginFrame(frame.image, {});
  MatchCascade("active").match({}, true, &frame);
  EXPECT_TRUE(frame.inliers.empty());
  EXPECT_TRUE(frame.matching.match_of_feature.empty());
}

}  // namespace
}  // namespace active_matching_slam
