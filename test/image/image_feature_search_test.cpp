#include "active_matching_slam/image/image_feature_search.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/imgproc.hpp>
#include <random>
#include <set>
#include <stdexcept>

#include "textures.h"

namespace active_matching_slam {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

SearchEllipse round(double u, double v, double sigma) {
  return {{u, v}, sigma * sigma * Eigen::Matrix2d::Identity()};
}

SearchEllipse randomEllipse(std::mt19937* generator, int width, int height, double largest) {
  const auto uniform = [&] { return (*generator)() / 4294967296.0; };
  const double a = 0.4 + largest * uniform(), b = 0.4 + largest * uniform();
  const double angle = M_PI * uniform();
  Eigen::Matrix2d R;
  R << std::cos(angle), -std::sin(angle), std::sin(angle), std::cos(angle);
  return {{width * uniform(), height * uniform()},
          R * Eigen::Vector2d(a * a, b * b).asDiagonal() * R.transpose()};
}

using PixelSet = std::set<std::pair<int, int>>;  // (v, u)

PixelSet pixelsOf(const SearchEllipse& ellipse, const PixelBox& box) {
  PixelSet pixels;
  const Eigen::Matrix2d inverse = ellipse.covariance.inverse();
  for (int v = box.min_v; v <= box.max_v; ++v)
    for (int u = box.min_u; u <= box.max_u; ++u) {
      const Eigen::Vector2d d = Eigen::Vector2d(u, v) - ellipse.center;
      if (d.dot(inverse * d) <= 9.0) pixels.insert({v, u});
    }
  return pixels;
}

PixelSet pixelsOf(const PixelMask& mask) {
  PixelSet pixels;
  mask.forEachRun([&](const PixelRun& run) {
    for (int u = run.begin_u; u < run.end_u; ++u) pixels.insert({run.v, u});
  });
  return pixels;
}

/// Local maxima of the whole score map by the plain definition.
PixelSet maximaOf(const cv::Mat& image, const Template& patch, double threshold,
                  const PixelBox& box) {
  cv::Mat scores;
  cv::matchTemplate(image, patch.image(), scores, cv::TM_CCOEFF_NORMED);
  const int half = patch.size / 2;
  const auto at = [&](int v, int u) { return scores.at<float>(v - half, u - half); };
  PixelSet maxima;
  for (int v = box.min_v; v <= box.max_v; ++v)
    for (int u = box.min_u; u <= box.max_u; ++u) {
      bool highest = at(v, u) >= threshold;
      for (int dv = -1; dv <= 1; ++dv)
        for (int du = -1; du <= 1; ++du)
          highest = highest && (dv == 0 && du == 0 ? true : at(v + dv, u + du) < at(v, u));
      if (highest) maxima.insert({v, u});
    }
  return maxima;
}

class ImageFeatureSearchTest : public testing::Test {
 protected:
  ImageFeatureSearchTest() : image_(WaveTexture(11, 7.0).render(160, 120)), search_(options_) {
    search_.beginFrame(image_, {cutTemplate(image_, 60, 50), cutTemplate(image_, 100, 70)});
  }

  ImageOptions options_;
  cv::Mat image_;
  ImageFeatureSearch search_;
};

TEST_F(ImageFeatureSearchTest, FindsEachTemplateWhereItWasCut) {
  const SearchOutcome first = search_.search(0, round(62.0, 49.0, 3.0));
  ASSERT_FALSE(first.matches.empty());
  const SearchMatch* best = search_.bestMatch(0);
  ASSERT_NE(best, nullptr);
  EXPECT_NEAR(best->score, 1.0, 1e-6);
  EXPECT_LT((best->pixel - Eigen::Vector2d(60, 50)).norm(), 0.1);
  search_.search(1, round(98.0, 71.5, 3.0));
  ASSERT_NE(search_.bestMatch(1), nullptr);
  EXPECT_LT((search_.bestMatch(1)->pixel - Eigen::Vector2d(100, 70)).norm(), 0.1);
}

TEST_F(ImageFeatureSearchTest, CountsThePixelsOfAnyEllipseExactly) {
  std::mt19937 generator(1);
  for (int i = 0; i < 300; ++i) {
    search_.beginFrame(image_, {Template(cutTemplate(image_, 60, 50))});
    const SearchEllipse ellipse = randomEllipse(&generator, 160, 120, 12.0);
    const PixelSet expected = pixelsOf(ellipse, search_.validArea(0));
    EXPECT_EQ(search_.countNewPixels(0, ellipse), static_cast<int>(expected.size()));
    const SearchOutcome outcome = search_.search(0, ellipse);
    EXPECT_EQ(outcome.pixels_in_ellipse, static_cast<int>(expected.size()));
    const PixelSet searched = pixelsOf(search_.searchedPixels(0));
    EXPECT_TRUE(std::includes(searched.begin(), searched.end(), expected.begin(), expected.end()));
    EXPECT_EQ(outcome.pixels_new, static_cast<int>(searched.size()));
    EXPECT_EQ(search_.countNewPixels(0, ellipse), 0);
  }
}

TEST_F(ImageFeatureSearchTest, CountsEveryPixelOnceHoweverEllipsesOverlap) {
  std::mt19937 generator(2);
  PixelSet covered;
  int counted = 0;
  for (int i = 0; i < 60; ++i) {
    const SearchEllipse ellipse = randomEllipse(&generator, 160, 120, 8.0);
    const PixelSet before = pixelsOf(search_.searchedPixels(0));
    const PixelSet pixels = pixelsOf(ellipse, search_.validArea(0));
    covered.insert(pixels.begin(), pixels.end());
    const int expected_new = static_cast<int>(std::count_if(
        pixels.begin(), pixels.end(), [&](const auto& pixel) { return !before.count(pixel); }));
    EXPECT_EQ(search_.countNewPixels(0, ellipse), expected_new);
    counted += search_.search(0, ellipse).pixels_new;
    EXPECT_EQ(counted, search_.searchedPixels(0).size());
    EXPECT_EQ(counted, search_.pixelsSearched());
  }
  const PixelSet searched = pixelsOf(search_.searchedPixels(0));
  EXPECT_TRUE(std::includes(searched.begin(), searched.end(), covered.begin(), covered.end()));
  // The rim of maxima costs little beside the ellipses.
  EXPECT_LT(searched.size(), 1.05 * covered.size());
  EXPECT_EQ(search_.searchedPixels(1).size(), 0);
}

TEST_F(ImageFeatureSearchTest, FindsAllLocalMaximaOfTheScoreAndNothingElse) {
  ImageOptions options;
  options.match_threshold = 0.3;  // so that there are many
  ImageFeatureSearch search(options);
  search.beginFrame(image_, {cutTemplate(image_, 60, 50)});
  search.search(0, round(80.0, 60.0, 1000.0));
  const PixelSet expected = maximaOf(image_, cutTemplate(image_, 60, 50), 0.3, search.validArea(0));
  EXPECT_GT(expected.size(), 30u);
  // Refined positions may round to the pixel next to the best one.
  ASSERT_EQ(search.matches(0).size(), expected.size());
  for (const SearchMatch& match : search.matches(0))
    EXPECT_TRUE(std::any_of(expected.begin(), expected.end(), [&](const auto& pixel) {
      return (match.pixel - Eigen::Vector2d(pixel.second, pixel.first)).cwiseAbs().maxCoeff() <=
             0.75;
    })) << match.pixel.transpose();
}

TEST_F(ImageFeatureSearchTest, FindsTheSameMatchesByManyEllipsesAsByOne) {
  ImageOptions options;
  options.match_threshold = 0.3;
  ImageFeatureSearch whole(options), pieces(options);
  const std::vector<Template> templates{cutTemplate(image_, 60, 50)};
  whole.beginFrame(image_, templates);
  pieces.beginFrame(image_, templates);
  whole.search(0, round(80.0, 60.0, 1000.0));
  std::mt19937 generator(3);
  for (int i = 0; i < 50; ++i) pieces.search(0, randomEllipse(&generator, 160, 120, 10.0));
  pieces.search(0, round(80.0, 60.0, 1000.0));
  EXPECT_EQ(pieces.searchedPixels(0).size(), whole.searchedPixels(0).size());
  std::map<std::pair<double, double>, double> a, b;
  for (const SearchMatch& m : whole.matches(0)) a[{m.pixel.x(), m.pixel.y()}] = m.score;
  for (const SearchMatch& m : pieces.matches(0)) b[{m.pixel.x(), m.pixel.y()}] = m.score;
  EXPECT_EQ(a, b);
  EXPECT_EQ(whole.matches(0).size(), pieces.matches(0).size());
}

TEST_F(ImageFeatureSearchTest, ReportsExactlyTheKnownMatchesInsideTheEllipseByAscendingId) {
  ImageOptions options;
  options.match_threshold = 0.3;
  ImageFeatureSearch search(options);
  search.beginFrame(image_, {cutTemplate(image_, 60, 50)});
  std::mt19937 generator(4);
  for (int i = 0; i < 100; ++i) {
    const SearchEllipse ellipse = randomEllipse(&generator, 160, 120, 8.0);
    const SearchOutcome outcome = search.search(0, ellipse);
    std::vector<int> inside;
    const std::vector<SearchMatch>& matches = search.matches(0);
    for (std::size_t m = 0; m < matches.size(); ++m) {
      EXPECT_EQ(matches[m].id, static_cast<int>(m));
      const Eigen::Vector2d d = matches[m].pixel - ellipse.center;
      if (d.dot(ellipse.covariance.inverse() * d) <= 9.0) inside.push_back(static_cast<int>(m));
    }
    EXPECT_EQ(outcome.matches, inside);
  }
}

TEST_F(ImageFeatureSearchTest, EverySearchedPixelOverTheThresholdIsAMatchOrBesideABetterOne) {
  ImageOptions options;
  options.match_threshold = 0.3;
  ImageFeatureSearch search(options);
  const Template patch = cutTemplate(image_, 60, 50);
  search.beginFrame(image_, {patch});
  std::mt19937 generator(5);
  for (int i = 0; i < 20; ++i) search.search(0, randomEllipse(&generator, 160, 120, 5.0));
  const PixelSet searched = pixelsOf(search.searchedPixels(0));
  const PixelSet maxima = maximaOf(image_, patch, 0.3, search.validArea(0));
  std::size_t met = 0;
  for (const auto& pixel : searched) met += maxima.count(pixel);
  EXPECT_EQ(search.matches(0).size(), met);
}

TEST_F(ImageFeatureSearchTest, ForgetsEverythingWithANewFrame) {
  search_.search(0, round(60.0, 50.0, 3.0));
  const std::vector<SearchMatch> first = search_.matches(0);
  search_.beginFrame(image_, {cutTemplate(image_, 60, 50)});
  EXPECT_EQ(search_.featureCount(), 1);
  EXPECT_EQ(search_.pixelsSearched(), 0);
  EXPECT_EQ(search_.searchedPixels(0).size(), 0);
  EXPECT_TRUE(search_.matches(0).empty());
  EXPECT_EQ(search_.bestMatch(0), nullptr);
  search_.search(0, round(60.0, 50.0, 3.0));
  ASSERT_EQ(search_.matches(0).size(), first.size());
  for (std::size_t i = 0; i < first.size(); ++i) {
    EXPECT_EQ(search_.matches(0)[i].pixel, first[i].pixel);
    EXPECT_EQ(search_.matches(0)[i].score, first[i].score);
  }
}

TEST_F(ImageFeatureSearchTest, GivesOneMatchForAPlateau) {
  // A stripe pattern matches equally well all along its stripes.
  cv::Mat stripes(60, 60, CV_8UC1);
  for (int u = 0; u < 60; ++u) stripes.col(u).setTo(u % 20 < 10 ? 50 : 200);
  search_.beginFrame(stripes, {cutTemplate(stripes, 30, 30)});
  const SearchOutcome outcome = search_.search(0, round(30.0, 30.0, 2.0));
  // Maxima of the first row only; the tie goes on beyond the top of the ellipse.
  EXPECT_LE(outcome.matches.size(), 1u);
  EXPECT_LE(search_.matches(0).size(), 2u);
}

TEST_F(ImageFeatureSearchTest, AnswersHopelessEllipsesWithNothing) {
  const Eigen::Matrix2d one = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d indefinite, singular;
  indefinite << 1.0, 2.0, 2.0, 1.0;
  singular << 1.0, 1.0, 1.0, 1.0;
  const std::vector<SearchEllipse> hopeless{
      {{kNaN, 50.0}, one},        {{60.0, kInfinity}, one},
      {{60.0, 50.0}, kNaN * one}, {{60.0, 50.0}, kInfinity * one},
      {{60.0, 50.0}, -one},       {{60.0, 50.0}, 0.0 * one},
      {{60.0, 50.0}, indefinite}, {{60.0, 50.0}, singular},
      {{-100.0, 50.0}, one},      {{1e300, -1e300}, one},
      {{60.0, 5000.0}, one},
  };
  for (const SearchEllipse& ellipse : hopeless) {
    EXPECT_EQ(search_.countNewPixels(0, ellipse), 0);
    const SearchOutcome outcome = search_.search(0, ellipse);
    EXPECT_EQ(outcome.pixels_in_ellipse, 0);
    EXPECT_EQ(outcome.pixels_new, 0);
    EXPECT_TRUE(outcome.matches.empty());
  }
  EXPECT_EQ(search_.pixelsSearched(), 0);
}

TEST_F(ImageFeatureSearchTest, ClipsEnormousEllipsesToTheValidArea) {
  const PixelBox valid = search_.validArea(0);
  const int all = (valid.max_u - valid.min_u + 1) * (valid.max_v - valid.min_v + 1);
  for (const double sigma : {1e6, 1e12, 1e60}) {
    search_.beginFrame(image_, {cutTemplate(image_, 60, 50), cutTemplate(image_, 100, 70)});
    EXPECT_EQ(search_.countNewPixels(1, round(0.0, 0.0, sigma)), all);
    EXPECT_EQ(search_.search(1, round(-1e4, 1e4, sigma)).pixels_in_ellipse, all);
  }
}

TEST_F(ImageFeatureSearchTest, KeepsToTheBorder) {
  const PixelBox valid = search_.validArea(0);
  EXPECT_EQ(valid.min_u, options_.border_px);
  EXPECT_EQ(valid.max_v, 119 - options_.border_px);
  ImageOptions options;
  options.border_px = 0;
  ImageFeatureSearch search(options);
  search.beginFrame(image_, {cutTemplate(image_, 60, 50)});
  EXPECT_EQ(search.validArea(0).min_u, 6);   // half a template and the neighbour of a maximum
  search.search(0, round(80.0, 60.0, 1e3));  // touches every rim
  EXPECT_GT(search.pixelsSearched(), 140 * 100);
}

TEST_F(ImageFeatureSearchTest, FindsNothingInImagesThatAreNoImages) {
  const std::vector<Template> templates{cutTemplate(image_, 60, 50)};
  const std::vector<cv::Mat> bad{cv::Mat(), cv::Mat(3, 3, CV_8UC1, cv::Scalar(9)),
                                 cv::Mat(15, 200, CV_8UC1, cv::Scalar(9)),
                                 cv::Mat(120, 160, CV_8UC3, cv::Scalar(9, 9, 9))};
  for (const cv::Mat& image : bad) {
    search_.beginFrame(image, templates);
    const SearchOutcome outcome = search_.search(0, round(2.0, 2.0, 50.0));
    EXPECT_EQ(outcome.pixels_new, 0);
    EXPECT_TRUE(outcome.matches.empty());
  }
  search_.beginFrame(image_, {Template()});
  EXPECT_EQ(search_.search(0, round(60.0, 50.0, 3.0)).pixels_new, 0);
  const cv::Mat flat(120, 160, CV_8UC1, cv::Scalar(128));
  search_.beginFrame(flat, templates);
  EXPECT_TRUE(search_.search(0, round(60.0, 50.0, 3.0)).matches.empty());
}

TEST_F(ImageFeatureSearchTest, RefusesOptionsOutOfRangeByName) {
  ImageOptions options;
  options.template_size_px = 10;
  try {
    ImageFeatureSearch search(options);
    FAIL() << "an even template was accepted";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("template_size_px = 10"), std::string::npos);
  }
  options = {};
  options.source_patch_size_px = 11;
  EXPECT_THROW(checkImageOptions(options), std::invalid_argument);
  options = {};
  options.match_threshold = kNaN;
  EXPECT_THROW(checkImageOptions(options), std::invalid_argument);
  options = {};
  options.minimum_contrast = -1.0;
  EXPECT_THROW(checkImageOptions(options), std::invalid_argument);
  options = {};
  options.border_px = -1;
  EXPECT_THROW(checkImageOptions(options), std::invalid_argument);
  EXPECT_NO_THROW(checkImageOptions(ImageOptions()));
}

}  // namespace
}  // namespace active_matching_slam
