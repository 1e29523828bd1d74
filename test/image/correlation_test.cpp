#include "active_matching_slam/image/correlation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "textures.h"

namespace active_matching_slam {
namespace {

std::vector<PixelRun> allPositions(const cv::Mat& image, int size) {
  std::vector<PixelRun> runs;
  for (int v = size / 2; v < image.rows - size / 2; ++v)
    runs.push_back({v, size / 2, image.cols - size / 2});
  return runs;
}

std::vector<float> scoresOf(const cv::Mat& image, const Template& patch,
                            const std::vector<PixelRun>& runs,
                            Correlator::Kernel kernel = Correlator::Kernel::kAutomatic) {
  std::vector<float> scores;
  Correlator(0.0, kernel).correlate(image, patch, runs, &scores);
  return scores;
}

class CorrelationOfSize : public testing::TestWithParam<int> {};

TEST_P(CorrelationOfSize, EqualsMatchTemplate) {
  const int size = GetParam();
  const cv::Mat image = randomImage(97, 71, 1);
  const Template patch = cutTemplate(randomImage(64, 64, 2), 32, 32, size);
  cv::Mat expected;
  cv::matchTemplate(image, patch.image(), expected, cv::TM_CCOEFF_NORMED);
  const std::vector<float> scores = scoresOf(image, patch, allPositions(image, size));
  ASSERT_EQ(scores.size(), expected.total());
  for (std::size_t i = 0; i < scores.size(); ++i)
    ASSERT_NEAR(scores[i], expected.at<float>(static_cast<int>(i)), 1e-5) << "position " << i;
}

TEST_P(CorrelationOfSize, IsTheSameBitForBitWithEveryInstructionSet) {
  const int size = GetParam();
  const cv::Mat image = randomImage(131, 67, 3);
  const Template patch = cutTemplate(image, 60, 30, size);
  const std::vector<PixelRun> runs = allPositions(image, size);
  const std::vector<float> portable = scoresOf(image, patch, runs, Correlator::Kernel::kPortable);
  EXPECT_EQ(scoresOf(image, patch, runs, Correlator::Kernel::kSse2), portable);
  EXPECT_EQ(scoresOf(image, patch, runs, Correlator::Kernel::kAvx2), portable);
  EXPECT_EQ(scoresOf(image, patch, runs), portable);
}

INSTANTIATE_TEST_SUITE_P(Sizes, CorrelationOfSize, testing::Values(5, 7, 11, 15, 21, 31));

TEST(Correlation, OfShortScatteredRunsEqualsThatOfTheWholeImage) {
  const int size = 11;
  const cv::Mat image = WaveTexture(4, 6.0).render(90, 80);
  const Template patch = cutTemplate(image, 40, 40, size);
  const std::vector<float> all = scoresOf(image, patch, allPositions(image, size));
  const int width = image.cols - size + 1;
  // Lengths from 1 up, several runs in some rows, rows left out.
  std::vector<PixelRun> runs;
  for (int i = 0, v = 5; v < 75; ++i, v += 1 + (i % 4) * (i % 5 == 0 ? 5 : 1)) {
    runs.push_back({v, 5 + i % 7, 6 + i % 7 + i});
    runs.push_back({v, 45 + i % 3, 80});
  }
  const std::vector<float> scores = scoresOf(image, patch, runs);
  std::size_t k = 0;
  for (const PixelRun& run : runs)
    for (int u = run.begin_u; u < run.end_u; ++u, ++k)
      ASSERT_EQ(scores[k], all[(run.v - 5) * width + u - 5]) << u << ", " << run.v;
  EXPECT_EQ(k, scores.size());
}

TEST(Correlation, IsOneWhereTheTemplateWasCutAndIgnoresGainAndOffset) {
  const cv::Mat image = WaveTexture(5, 8.0, 25.0).render(60, 60);
  const Template patch = cutTemplate(image, 30, 25, 11);
  EXPECT_NEAR(scoresOf(image, patch, {{25, 30, 31}})[0], 1.0, 1e-6);
  cv::Mat changed;
  image.convertTo(changed, CV_8U, 0.5, 40.0);
  EXPECT_GT(scoresOf(changed, patch, {{25, 30, 31}})[0], 0.995);
  const cv::Mat negative = 255 - image;
  EXPECT_NEAR(scoresOf(negative, patch, {{25, 30, 31}})[0], -1.0, 1e-6);
}

TEST(Correlation, HoldsForTheLargestProducts) {
  // Black and white at full swing: the largest sums that can occur.
  cv::Mat image(80, 80, CV_8UC1);
  for (int v = 0; v < 80; ++v)
    for (int u = 0; u < 80; ++u) image.at<std::uint8_t>(v, u) = (u / 3 + v / 5) % 2 ? 255 : 0;
  const Template patch = cutTemplate(image, 40, 40, 31);
  cv::Mat expected;
  cv::matchTemplate(image, patch.image(), expected, cv::TM_CCOEFF_NORMED);
  const std::vector<float> scores = scoresOf(image, patch, allPositions(image, 31));
  for (std::size_t i = 0; i < scores.size(); ++i)
    ASSERT_NEAR(scores[i], expected.at<float>(static_cast<int>(i)), 1e-5);
}

TEST(Correlation, ScoresZeroWhereThereIsNothingToSee) {
  const cv::Mat flat(40, 40, CV_8UC1, cv::Scalar(77));
  const cv::Mat image = randomImage(40, 40, 6);
  const Template patch = cutTemplate(image, 20, 20, 11);
  EXPECT_EQ(scoresOf(flat, patch, {{20, 15, 25}}), std::vector<float>(10, 0.0f));
  EXPECT_EQ(scoresOf(image, cutTemplate(flat, 20, 20, 11), {{20, 15, 25}}),
            std::vector<float>(10, 0.0f));
  EXPECT_EQ(scoresOf(image, Template(), {{20, 15, 25}}), std::vector<float>(10, 0.0f));
}

TEST(Correlation, ScoresZeroUnderTheLeastContrast) {
  cv::Mat image = randomImage(40, 40, 7);
  const Template patch = cutTemplate(image, 20, 20, 11);
  cv::Mat faint;
  image.convertTo(faint, CV_8U, 3.0 / patch.contrast(), 100.0);  // standard deviation 3
  std::vector<float> scores;
  Correlator(4.0).correlate(faint, patch, {{20, 20, 21}}, &scores);
  EXPECT_EQ(scores, std::vector<float>{0.0f});
  Correlator(2.0).correlate(faint, patch, {{20, 20, 21}}, &scores);
  EXPECT_GT(scores[0], 0.98f);
}

TEST(Correlation, ReachesTheVeryCornersOfTheImage) {
  const cv::Mat image = randomImage(33, 29, 8);
  for (const cv::Point& at :
       {cv::Point(5, 5), cv::Point(27, 5), cv::Point(5, 23), cv::Point(27, 23)}) {
    const Template patch = cutTemplate(image, at.x, at.y, 11);
    EXPECT_NEAR(scoresOf(image, patch, {{at.y, at.x, at.x + 1}})[0], 1.0, 1e-6);
  }
}

TEST(Correlation, OfNoPositionsIsEmpty) {
  const cv::Mat image = randomImage(33, 29, 8);
  EXPECT_TRUE(scoresOf(image, cutTemplate(image, 15, 15, 11), {}).empty());
}

TEST(Template, KnowsItsContrast) {
  cv::Mat image(5, 5, CV_8UC1, cv::Scalar(100));
  EXPECT_EQ(makeTemplate(image)->contrast(), 0.0);
  for (int i = 0; i < 25; i += 2) image.at<std::uint8_t>(i / 5, i % 5) = 120;
  EXPECT_NEAR(makeTemplate(image)->contrast(), 10.0, 0.02);
  EXPECT_EQ(Template().contrast(), 0.0);
  EXPECT_EQ(cv::norm(makeTemplate(image)->image(), image, cv::NORM_INF), 0.0);
}

TEST(Template, IsRefusedForAnImageOfTheWrongShape) {
  EXPECT_FALSE(makeTemplate(cv::Mat()));
  EXPECT_FALSE(makeTemplate(cv::Mat(10, 10, CV_8UC1, cv::Scalar(0))));
  EXPECT_FALSE(makeTemplate(cv::Mat(11, 9, CV_8UC1, cv::Scalar(0))));
  EXPECT_FALSE(makeTemplate(cv::Mat(33, 33, CV_8UC1, cv::Scalar(0))));
  EXPECT_FALSE(makeTemplate(cv::Mat(11, 11, CV_8UC3, cv::Scalar(0, 0, 0))));
}

}  // namespace
}  // namespace active_matching_slam
