#include "active_matching_slam/image/image_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>

#include "textures.h"

namespace active_matching_slam {
namespace {

TEST(ImageQuality, OfATexturedImageIsItsMeanAndDeviation) {
  const cv::Mat image = WaveTexture(51, 8.0, 30.0).render(320, 240);
  const ImageQuality quality = measureImageQuality(image);
  EXPECT_NEAR(quality.mean, 128.0, 4.0);
  EXPECT_NEAR(quality.contrast, 30.0, 3.0);
  EXPECT_FALSE(quality.isBlank());
}

TEST(ImageQuality, FallsWithBlur) {
  const cv::Mat image = WaveTexture(52, 5.0).render(320, 240);
  cv::Mat blurred;
  cv::GaussianBlur(image, blurred, cv::Size(15, 15), 3.0);
  EXPECT_LT(measureImageQuality(blurred).sharpness, 0.5 * measureImageQuality(image).sharpness);
}

TEST(ImageQuality, KnowsBlankImages) {
  for (const int level : {0, 90, 255}) {
    cv::Mat image(240, 320, CV_8UC1, cv::Scalar(level));
    EXPECT_TRUE(measureImageQuality(image).isBlank());
    EXPECT_EQ(measureImageQuality(image).mean, level);
    addNoise(&image, 1.0, 53);
    EXPECT_TRUE(measureImageQuality(image).isBlank());
  }
  EXPECT_TRUE(measureImageQuality(cv::Mat()).isBlank());
  EXPECT_TRUE(measureImageQuality(cv::Mat(4, 4, CV_8UC3, cv::Scalar(0, 90, 0))).isBlank());
  EXPECT_EQ(measureImageQuality(cv::Mat(1, 1, CV_8UC1, cv::Scalar(7))).mean, 7.0);
}

TEST(RepeatedImage, IsOneThatDoesNotDifferByAPixel) {
  const cv::Mat image = randomImage(64, 48, 54);
  cv::Mat copy = image.clone();
  EXPECT_TRUE(isRepeatedImage(copy, image));
  EXPECT_EQ(meanAbsoluteDifference(copy, image), 0.0);
  copy.at<std::uint8_t>(47, 63) ^= 1;
  EXPECT_FALSE(isRepeatedImage(copy, image));
  EXPECT_NEAR(meanAbsoluteDifference(copy, image), 1.0 / (64 * 48), 1e-12);
}

TEST(RepeatedImage, ComparesViewsOfLargerImagesToo) {
  const cv::Mat image = randomImage(64, 48, 55);
  const cv::Rect part(5, 6, 20, 30);
  EXPECT_TRUE(isRepeatedImage(image(part), image(part).clone()));
}

TEST(RepeatedImage, IsNeverOneOfAnotherSizeOrNone) {
  const cv::Mat image = randomImage(64, 48, 56);
  EXPECT_FALSE(isRepeatedImage(image, cv::Mat()));
  EXPECT_FALSE(isRepeatedImage(cv::Mat(), cv::Mat()));
  EXPECT_FALSE(isRepeatedImage(image, randomImage(48, 64, 56)));
  EXPECT_TRUE(std::isinf(meanAbsoluteDifference(image, cv::Mat())));
}

}  // namespace
}  // namespace active_matching_slam
