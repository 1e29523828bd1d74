// Patches, search and corners together on real images: corners of one frame are found in the next
// and, cut out there, back in the first. The recordings are found by the environment variable
// AMS_DATA; without it these tests are skipped.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>
#include <string>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/image/image_quality.h"
#include "active_matching_slam/image/warp.h"

namespace active_matching_slam {
namespace {

struct Recording {
  const char* name;
  const char* extension;
  double sigma_px;  ///< of the search: motion between the frames used, at most 3 sigma
};

class RecordedImages : public testing::TestWithParam<Recording> {
 protected:
  void SetUp() override {
    if (!std::getenv("AMS_DATA")) GTEST_SKIP() << "skipped: AMS_DATA is not set";
  }

  static cv::Mat frame(int index) {
    const std::string number = std::to_string(index);
    return cv::imread(std::string(std::getenv("AMS_DATA")) + "/" + GetParam().name + "/frames/" +
                          std::string(6 - number.size(), '0') + number + GetParam().extension,
                      cv::IMREAD_GRAYSCALE);
  }
};

Template templateAt(const cv::Mat& image, const Eigen::Vector2d& pixel) {
  Template result;
  const auto patch = extractSourcePatch(image, pixel, Eigen::Isometry3d::Identity(), 31);
  PatchView unchanged;
  unchanged.affine.setIdentity();
  if (patch) warpTemplate(*patch, unchanged, 11, &result);
  return result;
}

/// Best match of each template around its place; templates without one get none.
std::vector<const SearchMatch*> searchAround(ImageFeatureSearch* search, const cv::Mat& image,
                                             const std::vector<Template>& templates,
                                             const std::vector<Eigen::Vector2d>& places,
                                             double sigma_px) {
  search->beginFrame(image, templates);
  std::vector<const SearchMatch*> best;
  for (std::size_t i = 0; i < templates.size(); ++i) {
    search->search(static_cast<int>(i),
                   {places[i], sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
    best.push_back(search->bestMatch(static_cast<int>(i)));
  }
  return best;
}

TEST_P(RecordedImages, GiveMostCornersThereAndBackAgain) {
  const ImageOptions options;
  ImageFeatureSearch there(options), back(options);
  int corners = 0, found = 0, returned = 0;
  std::vector<double> errors;
  for (int index = 20; index <= 320; index += 60) {
    const cv::Mat first = frame(index), second = frame(index + 1);
    ASSERT_FALSE(first.empty() || second.empty());
    EXPECT_FALSE(measureImageQuality(first).isBlank());
    std::vector<Template> templates;
    std::vector<Eigen::Vector2d> places;
    for (const Corner& corner : detectCorners(first, {}, 40, 15.0, options)) {
      templates.push_back(templateAt(first, corner.pixel));
      places.push_back(corner.pixel);
    }
    corners += static_cast<int>(places.size());
    const auto matches = searchAround(&there, second, templates, places, GetParam().sigma_px);
    std::vector<Template> back_templates;
    std::vector<Eigen::Vector2d> back_places;
    for (std::size_t i = 0; i < matches.size(); ++i) {
      if (!matches[i]) continue;
      ++found;
      back_templates.push_back(templateAt(second, matches[i]->pixel));
      back_places.push_back(places[i]);
    }
    const auto back_matches =
        searchAround(&back, first, back_templates, back_places, GetParam().sigma_px);
    for (std::size_t i = 0; i < back_matches.size(); ++i) {
      if (!back_matches[i]) continue;
      const double error = (back_matches[i]->pixel - back_places[i]).norm();
      errors.push_back(error);
      returned += error < 0.5;
    }
  }
  ASSERT_FALSE(errors.empty());
  std::sort(errors.begin(), errors.end());
  std::printf("%s: %d corners, %d found, %d returned; median error %.3f px, 90 %% %.3f px\n",
              GetParam().name, corners, found, returned, errors[errors.size() / 2],
              errors[errors.size() * 9 / 10]);
  EXPECT_GE(corners, 100);
  EXPECT_GE(found, 0.85 * corners);
  EXPECT_GE(returned, 0.85 * found);
  EXPECT_LT(errors[errors.size() / 2], 0.1);
}

INSTANTIATE_TEST_SUITE_P(Sequences, RecordedImages,
                         testing::Values(Recording{"davison_monoslam_desk", ".png", 4.0},
                                         Recording{"uzh_vamr_checkerboard", ".jpg", 6.0},
                                         Recording{"sevenscenes_redkitchen", ".jpg", 5.0}),
                         [](const testing::TestParamInfo<Recording>& info) {
                           return std::string(info.param.name);
                         });

}  // namespace
}  // namespace active_matching_slam
