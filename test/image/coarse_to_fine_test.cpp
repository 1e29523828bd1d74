// Wide ellipses, searched coarse to fine, against the same ellipses correlated pixel by pixel: on
// rendered images, and on recorded ones where AMS_DATA says where they are. Prints, by level of the
// coarsest search, the share of the true places that are found, and of the spurious matches.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

using ImagePair = std::pair<cv::Mat, cv::Mat>;

std::vector<ImagePair> recordedPairs(const std::string& name, const std::string& extension,
                                     int gap) {
  const auto read = [&](int index) {
    const std::string number = std::to_string(index);
    return cv::imread(std::string(std::getenv("AMS_DATA")) + "/" + name + "/frames/" +
                          std::string(6 - number.size(), '0') + number + extension,
                      cv::IMREAD_GRAYSCALE);
  };
  std::vector<ImagePair> pairs;
  for (int index = 10; index < 150; index += 14) pairs.emplace_back(read(index), read(index + gap));
  return pairs;
}

std::vector<ImagePair> renderedPairs(int gap) {
  SimulatorOptions options;
  options.motion = "jerky";
  options.duration_s = 3.0;
  Simulator simulator(options);
  std::vector<cv::Mat> images;
  while (auto frame = simulator.next()) images.push_back(frame->image);
  std::vector<ImagePair> pairs;
  for (std::size_t i = 0; i + gap < images.size(); i += 14)
    pairs.emplace_back(images[i], images[i + gap]);
  return pairs;
}

struct CutFeature {
  TemplateSource source;
  Template expected;
};

std::vector<CutFeature> cutFeatures(const cv::Mat& image, const ImageOptions& options) {
  std::vector<CutFeature> features;
  for (const Corner& corner : detectCorners(image, {}, 40, 20.0, options)) {
    const auto patch = extractSourcePatch(image, corner.pixel, Eigen::Isometry3d::Identity(),
                                          options.source_patch_size_px);
    CutFeature feature;
    if (!patch) continue;
    feature.source.patch = *patch;
    feature.source.view.pixel = corner.pixel;
    if (warpTemplate(*patch, feature.source.view, options.template_size_px, &feature.expected))
      features.push_back(feature);
  }
  return features;
}

SearchEllipse roundEllipse(const Eigen::Vector2d& center, double area_px) {
  return {center, area_px / (9.0 * M_PI) * Eigen::Matrix2d::Identity()};
}

/// Where the feature is now, if a search there and one back again agree on it.
std::optional<Eigen::Vector2d> truePlace(const ImagePair& images, const CutFeature& feature,
                                         double area_px, const ImageOptions& options) {
  ImageFeatureSearch there(options), back(options);
  const Eigen::Vector2d& before = feature.source.patch.pixel;
  there.beginFrame(images.second, {feature.expected});
  there.search(0, roundEllipse(before, area_px));
  const SearchMatch* match = there.bestMatch(0);
  if (!match) return std::nullopt;
  const auto patch = extractSourcePatch(images.second, match->pixel, Eigen::Isometry3d::Identity(),
                                        options.source_patch_size_px);
  Template seen;
  PatchView unchanged;
  if (!patch || !warpTemplate(*patch, unchanged, options.template_size_px, &seen))
    return std::nullopt;
  back.beginFrame(images.first, {seen});
  back.search(0, roundEllipse(before, area_px));
  const SearchMatch* returned = back.bestMatch(0);
  if (!returned || !((returned->pixel - before).norm() < 0.5)) return std::nullopt;
  return match->pixel;
}

struct Tally {
  int places = 0, found = 0;
  int others = 0, others_found = 0, unknown = 0;  ///< matches that full searches bring, or not
  double correlations = 0.0, pixels = 0.0, clutter_pixels = 0.0;
};

bool hasMatchAt(const std::vector<SearchMatch>& matches, const Eigen::Vector2d& pixel) {
  return std::any_of(matches.begin(), matches.end(),
                     [&](const SearchMatch& m) { return (m.pixel - pixel).norm() < 0.1; });
}

void compareSearches(const std::vector<ImagePair>& pairs, double true_area_px, double area_px,
                     Tally* tally) {
  const ImageOptions options;
  ImageFeatureSearch full(options), coarse(options);
  for (const ImagePair& images : pairs) {
    ASSERT_FALSE(images.first.empty() || images.second.empty());
    std::vector<Template> templates;
    std::vector<TemplateSource> sources;
    std::vector<Eigen::Vector2d> places;
    for (const CutFeature& feature : cutFeatures(images.first, options)) {
      const auto place = truePlace(images, feature, true_area_px, options);
      if (!place) continue;
      templates.push_back(feature.expected);
      sources.push_back(feature.source);
      places.push_back(*place);
    }
    full.beginFrame(images.second, templates);
    coarse.beginFrame(images.second, templates, sources);
    for (std::size_t i = 0; i < places.size(); ++i) {
      const int feature = static_cast<int>(i);
      const SearchEllipse gate = roundEllipse(sources[i].patch.pixel, area_px);
      full.search(feature, gate);
      const SearchOutcome outcome = coarse.search(feature, gate);
      tally->correlations += outcome.correlations;
      tally->pixels += outcome.pixels_in_ellipse;
      tally->clutter_pixels += coarse.clutterPixels(feature);
      EXPECT_EQ(coarse.countNewPixels(feature, gate), 0);
      if (!hasMatchAt(full.matches(feature), places[i])) continue;
      ++tally->places;
      tally->found += hasMatchAt(coarse.matches(feature), places[i]);
      for (const SearchMatch& m : full.matches(feature)) {
        if ((m.pixel - places[i]).norm() < 0.1) continue;
        ++tally->others;
        tally->others_found += hasMatchAt(coarse.matches(feature), m.pixel);
      }
      for (const int m : outcome.matches)
        tally->unknown += !hasMatchAt(full.matches(feature), coarse.matches(feature)[m].pixel);
    }
  }
}

void expectTheSameMatches(const std::string& name, const std::vector<ImagePair>& pairs,
                          double true_area_px) {
  for (const double area_px : {6e3, 2e4, 2e5}) {
    Tally tally;
    compareSearches(pairs, true_area_px, area_px, &tally);
    std::printf(
        "%s, %.0f px a gate (clipped: %.0f): %d of %d places found, %d of %d spurious, "
        "%d that no full search finds; %.0f correlations a search\n",
        name.c_str(), area_px, tally.pixels / std::max(tally.places, 1), tally.found, tally.places,
        tally.others_found, tally.others, tally.unknown,
        tally.correlations / std::max(tally.places, 1));
    EXPECT_GE(tally.places, 50);
    EXPECT_GE(tally.found, 0.96 * tally.places);
    EXPECT_LE(tally.unknown, 0.01 * tally.found);
    EXPECT_LT(tally.correlations, 0.7 * tally.pixels);
    // What the rate of spurious matches is learnt from tells within a factor of two how many come.
    const double expected = tally.clutter_pixels / tally.pixels * tally.others;
    EXPECT_GT(tally.others_found, 0.5 * expected);
    EXPECT_LT(tally.others_found, 2.0 * expected);
  }
}

TEST(CoarseToFineTest, FindsWhatAFullSearchFindsInRenderedImages) {
  expectTheSameMatches("rendered", renderedPairs(2), 3000.0);
}

class CoarseToFineRecorded
    : public testing::TestWithParam<std::tuple<const char*, const char*, int>> {};

TEST_P(CoarseToFineRecorded, FindsWhatAFullSearchFinds) {
  if (!std::getenv("AMS_DATA")) GTEST_SKIP() << "skipped: AMS_DATA is not set";
  const auto& [name, extension, gap] = GetParam();
  expectTheSameMatches(name, recordedPairs(name, extension, gap), 3500.0);
}

INSTANTIATE_TEST_SUITE_P(Sequences, CoarseToFineRecorded,
                         testing::Values(std::make_tuple("tum_fr1_xyz", ".jpg", 2),
                                         std::make_tuple("kitti_07_first160", ".jpg", 1),
                                         std::make_tuple("euroc_mh05_part", ".jpg", 2),
                                         std::make_tuple("davison_monoslam_desk", ".png", 3),
                                         std::make_tuple("sevenscenes_redkitchen", ".jpg", 3)),
                         [](const auto& info) { return std::string(std::get<0>(info.param)); });

/// A detailed image and a feature in its middle.
struct WideGate {
  cv::Mat image = cv::Mat(480, 640, CV_8UC1);
  CutFeature feature;
  WideGate() {
    cv::RNG random(3);
    random.fill(image, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(image, image, cv::Size(), 2.0);
    cv::normalize(image, image, 0, 255, cv::NORM_MINMAX);
    feature.source.patch =
        *extractSourcePatch(image, {300.0, 200.0}, Eigen::Isometry3d::Identity(), 31);
    warpTemplate(feature.source.patch, feature.source.view, 11, &feature.expected);
  }
};

TEST(CoarseToFineTest, CostsAboutTheSameHoweverWideTheGateIs) {
  const WideGate wide;
  ImageFeatureSearch search{ImageOptions()};
  for (const double area_px : {5e3, 2e4, 8e4}) {
    search.beginFrame(wide.image, {wide.feature.expected}, {wide.feature.source});
    const SearchEllipse gate = roundEllipse({310.0, 230.0}, area_px);
    const SearchOutcome outcome = search.search(0, gate);
    EXPECT_EQ(outcome.pixels_new, outcome.pixels_in_ellipse);
    EXPECT_EQ(search.searchedPixels(0).size(), outcome.pixels_in_ellipse);
    EXPECT_EQ(search.pixelsSearched(), outcome.correlations);
    EXPECT_LE(outcome.correlations, 1.05 * search.expectedCost(0, area_px));
    EXPECT_LT(search.expectedCost(0, area_px), 8000.0);
    ASSERT_FALSE(outcome.matches.empty());
    EXPECT_LT((search.bestMatch(0)->pixel - Eigen::Vector2d(300.0, 200.0)).norm(), 1e-3);
    EXPECT_LT(search.clutterPixels(0), outcome.pixels_in_ellipse);
    const SearchOutcome again = search.search(0, gate);
    EXPECT_EQ(again.correlations, 0);
    EXPECT_EQ(again.matches, outcome.matches);
  }
}

TEST(CoarseToFineTest, LeavesSmallGatesAndFeaturesWithoutSourceAsTheyAre) {
  const WideGate wide;
  ImageFeatureSearch full{ImageOptions()}, search{ImageOptions()};
  full.beginFrame(wide.image, {wide.feature.expected});
  search.beginFrame(wide.image, {wide.feature.expected}, {wide.feature.source});
  const SearchEllipse small = roundEllipse({302.0, 205.0}, 2000.0);
  const SearchOutcome a = full.search(0, small), b = search.search(0, small);
  EXPECT_EQ(a.correlations, b.correlations);
  EXPECT_EQ(a.pixels_new, b.pixels_new);
  EXPECT_EQ(full.bestMatch(0)->pixel, search.bestMatch(0)->pixel);
  EXPECT_EQ(full.expectedCost(0, 2000.0), search.expectedCost(0, 2000.0));
  EXPECT_EQ(full.expectedCost(0, 1e5), 1e5);
  const SearchOutcome pixel_by_pixel = full.search(0, roundEllipse({302.0, 205.0}, 1e5));
  EXPECT_EQ(pixel_by_pixel.correlations, pixel_by_pixel.pixels_new);
}

TEST(CoarseToFineTest, GoesOnPixelByPixelBesideAWideGateWithoutCountingAMatchTwice) {
  const WideGate wide;
  ImageFeatureSearch search{ImageOptions()};
  search.beginFrame(wide.image, {wide.feature.expected}, {wide.feature.source});
  search.search(0, roundEllipse({300.0, 280.0}, M_PI * 79.0 * 79.0));  // ends beside the feature
  const auto covered = search.searchedPixels(0).size();
  const SearchEllipse small = roundEllipse({300.0, 200.0}, 1000.0);
  const int fresh = search.countNewPixels(0, small);
  EXPECT_GT(fresh, 0);
  const SearchOutcome outcome = search.search(0, small);
  EXPECT_GE(outcome.pixels_new, fresh);
  EXPECT_EQ(search.searchedPixels(0).size(), covered + outcome.pixels_new);
  const auto near_feature = [](const SearchMatch& match) {
    return (match.pixel - Eigen::Vector2d(300.0, 200.0)).norm() < 0.5;
  };
  const auto& matches = search.matches(0);
  EXPECT_EQ(std::count_if(matches.begin(), matches.end(), near_feature), 1);
}

}  // namespace
}  // namespace active_matching_slam
