#include "active_matching_slam/image/image_mask.h"

#include <gtest/gtest.h>

#include <opencv2/imgcodecs.hpp>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/image/image_motion.h"
#include "support/fault.h"
#include "textures.h"

namespace active_matching_slam {
namespace {

constexpr int kMaskedFrom = 100;  ///< column from which on the masks below leave out

/// White on the left of kMaskedFrom.
cv::Mat leftOf(int width, int height) {
  cv::Mat mask(height, width, CV_8UC1, cv::Scalar(0));
  mask.colRange(0, kMaskedFrom).setTo(255);
  return mask;
}

SearchEllipse circle(double u, double v, double sigma) {
  return {{u, v}, sigma * sigma * Eigen::Matrix2d::Identity()};
}

TEST(ImageMask, WithoutAPictureAllIsUsed) {
  const ImageMask mask;
  const cv::Mat image = randomImage(60, 40, 1);
  EXPECT_TRUE(mask.isWhole());
  EXPECT_TRUE(mask.isSearched({3.0, 4.0}));
  EXPECT_EQ(mask.applyTo(image).data, image.data) << "not even copied";
}

TEST(ImageMask, WhatIsNearerToBlackIsNotUsed) {
  cv::Mat picture(40, 60, CV_8UC1, cv::Scalar(128));
  picture.colRange(30, 60).setTo(127);
  const ImageMask mask(picture, {});
  EXPECT_EQ(mask.used().at<std::uint8_t>(5, 29), 255);
  EXPECT_EQ(mask.used().at<std::uint8_t>(5, 30), 0);
}

TEST(ImageMask, WhatIsWrongWithAPictureIsNamed) {
  EXPECT_NE(faultOf([] { ImageMask(cv::Mat(), {}); }).find("empty"), std::string::npos);
  EXPECT_NE(faultOf([] { ImageMask(cv::Mat::ones(9, 9, CV_8UC3), {}); }).find("8-bit grey"),
            std::string::npos);
  // 0 and 1 in place of 0 and 255.
  EXPECT_NE(faultOf([] { ImageMask(cv::Mat::ones(9, 9, CV_8UC1), {}); }).find("no white pixel"),
            std::string::npos);
  EXPECT_NE(faultOf([] { readMask("/nonexistent/mask.png"); }).find("/nonexistent/mask.png"),
            std::string::npos);
}

TEST(ImageMask, OnlyTheMaskedPixelsOfAnImageAreReplaced) {
  const cv::Mat image = randomImage(160, 120, 1);
  const cv::Mat masked = ImageMask(leftOf(160, 120), {}).applyTo(image);
  EXPECT_EQ(cv::norm(image.colRange(0, kMaskedFrom), masked.colRange(0, kMaskedFrom)), 0.0);
  EXPECT_GT(cv::norm(image.colRange(kMaskedFrom, 160), masked.colRange(kMaskedFrom, 160)), 0.0);
}

TEST(MaskedSearch, FindsNothingBehindTheMaskAndAllBesideIt) {
  const cv::Mat image = WaveTexture(3, 8.0).render(200, 120);
  const ImageMask mask(leftOf(200, 120), {});
  ImageOptions options;
  ImageFeatureSearch search(options);
  search.beginFrame(image, {cutTemplate(image, 60, 50), cutTemplate(image, 150, 50)}, {},
                    mask.templateCentres());
  search.search(0, circle(60.0, 50.0, 3.0));
  ASSERT_NE(search.bestMatch(0), nullptr);
  EXPECT_NEAR(search.bestMatch(0)->pixel.x(), 60.0, 0.1);
  EXPECT_FALSE(search.isPartlyMasked(0)) << "its circle is 40 pixels off";
  const SearchOutcome behind = search.search(1, circle(150.0, 50.0, 3.0));
  EXPECT_EQ(behind.pixels_in_ellipse, 0);
  EXPECT_EQ(search.searchedPixels(1).size(), 0);
  EXPECT_TRUE(search.isPartlyMasked(1));
}

TEST(MaskedSearch, CountsThePixelsThatItSearches) {
  const cv::Mat image = WaveTexture(3, 8.0).render(200, 120);
  const ImageMask mask(leftOf(200, 120), {});
  ImageFeatureSearch search{ImageOptions()};
  search.beginFrame(image, {cutTemplate(image, 60, 50)}, {}, mask.templateCentres());
  const SearchEllipse across = circle(90.0, 50.0, 6.0);
  const int expected = search.countNewPixels(0, across);
  int by_hand = 0;
  for (int v = 0; v < 120; ++v)
    for (int u = 0; u < 200; ++u)
      by_hand += (Eigen::Vector2d(u, v) - across.center).norm() <= 18.0 &&
                 mask.templateCentres().at<std::uint8_t>(v, u) != 0;
  EXPECT_EQ(expected, by_hand);
  EXPECT_EQ(search.search(0, across).pixels_in_ellipse, by_hand);
  EXPECT_TRUE(search.isPartlyMasked(0));
}

TEST(MaskedSearch, ReadsNothingBehindTheMask) {
  const cv::Mat image = WaveTexture(3, 8.0).render(200, 120);
  cv::Mat other = image.clone();
  randomImage(200 - kMaskedFrom, 120, 7).copyTo(other.colRange(kMaskedFrom, 200));
  const ImageMask mask(leftOf(200, 120), {});
  ImageOptions options;
  options.match_threshold = 0.3;
  const auto matchesIn = [&](const cv::Mat& searched) {
    ImageFeatureSearch search(options);
    search.beginFrame(searched, {cutTemplate(image, 60, 50)}, {}, mask.templateCentres());
    search.search(0, circle(90.0, 60.0, 100.0));
    return search.matches(0);
  };
  const auto a = matchesIn(image), b = matchesIn(other);
  ASSERT_GT(a.size(), 10u);
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    EXPECT_EQ(a[i].pixel, b[i].pixel);
    EXPECT_EQ(a[i].score, b[i].score);
  }
}

TEST(MaskedCorners, StartWhereTheirWholePatchIsUsed) {
  const cv::Mat image = randomImage(320, 240, 5);
  const ImageOptions options;
  const auto corners = detectCorners(image, {}, 60, 10.0, options,
                                     ImageMask(leftOf(320, 240), options).patchCentres());
  EXPECT_GT(corners.size(), 5u);
  for (const Corner& corner : corners)
    EXPECT_LT(corner.pixel.x() + options.source_patch_size_px / 2, kMaskedFrom);
}

TEST(MaskedImageMotion, IsThatOfTheSceneAndNotOfWhatStandsStillBeforeIt) {
  const WaveTexture scene(3, 60.0);
  cv::Mat before = scene.render(320, 240), now = scene.render(320, 240, -21.0, 13.0);
  const cv::Mat gripper = randomImage(320, 110, 4);
  cv::Mat mask(240, 320, CV_8UC1, cv::Scalar(255));
  gripper.copyTo(before.rowRange(130, 240));
  gripper.copyTo(now.rowRange(130, 240));
  mask.rowRange(130, 240).setTo(0);
  const ImageMask used(mask, {});
  const auto motion = estimateImageMotion(used.applyTo(before), used.applyTo(now), {}, used.used());
  ASSERT_TRUE(motion);
  EXPECT_LT(((*motion)({160.0, 60.0}) - Eigen::Vector2d(181.0, 47.0)).norm(), motion->sigma_px);
}

}  // namespace
}  // namespace active_matching_slam
