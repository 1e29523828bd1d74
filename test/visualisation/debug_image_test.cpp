#include "active_matching_slam/visualisation/debug_image.h"

#include <gtest/gtest.h>

#include <cmath>

#include "active_matching_slam/information/submap_color.h"
#include "active_matching_slam/visualisation/debug_canvas.h"
#include "support/point_feature.h"

namespace active_matching_slam {
namespace {

TEST(Ellipse, AxesAreThreeTimesTheRootsOfTheVariances) {
  const double angle = 0.4;
  const Eigen::Matrix2d R = Eigen::Rotation2Dd(angle).toRotationMatrix();
  const Eigen::Matrix2d covariance = R * Eigen::Vector2d(16.0, 4.0).asDiagonal() * R.transpose();
  const EllipseAxes axes = threeSigmaEllipse(covariance);
  EXPECT_NEAR(12.0, axes.major_px, 1e-9);
  EXPECT_NEAR(6.0, axes.minor_px, 1e-9);
  EXPECT_NEAR(0.0, std::sin(axes.angle_deg * M_PI / 180.0 - angle), 1e-9);
}

TEST(DebugImage, ShowsMatchesInColourAndEnlargesSmallImages) {
  TrackedFrame frame;
  EXPECT_TRUE(drawDebugImage(frame, DrawOptions(), 0).empty());
  frame.image = cv::Mat(240, 320, CV_8UC1, cv::Scalar(128));
  frame.features = {pointFeature(1, {0, 0, 1})};
  const cv::Mat image = drawDebugImage(frame, DrawOptions(), 0);
  ASSERT_EQ(CV_8UC3, image.type());
  EXPECT_EQ(640, image.cols);
  const cv::Vec3b at_match = image.at<cv::Vec3b>(81, 101);
  EXPECT_GT(at_match[1], at_match[2] + 50) << "green at the match";
  EXPECT_EQ(0.0, cv::norm(frame.image, cv::Mat(240, 320, CV_8UC1, cv::Scalar(128))))
      << "the tracked image is left alone";
}

TEST(DebugImage, ShowsLinksByBitsAndSubmapsInTheirColoursWhenAsked) {
  TrackedFrame frame;
  frame.image = cv::Mat(480, 640, CV_8UC1, cv::Scalar(0));
  for (int i = 0; i < 3; ++i) {
    frame.features.push_back(pointFeature(i, {0, 0, 1}));
    frame.features[i].predicted_px = {100.0 + 200.0 * i, 100.0 + 300.0 * (i % 2)};
  }
  auto graph = std::make_shared<MutualInformationGraph>();
  graph->ids = {0, 1, 2};
  graph->links = {{0, 1, 4.0, 5, true}, {0, 2, 1.0, 5, false}, {1, 2, 0.1, 5, true}};
  frame.graph = graph;
  auto hierarchy = std::make_shared<SubmapHierarchy>();
  hierarchy->ids = graph->ids;
  hierarchy->levels.resize(2);
  hierarchy->levels[0].submap_of_feature = {0, 1, 2};
  hierarchy->levels[1].submap_of_feature = {3, 3, 5};
  frame.submaps = hierarchy;
  const auto middle = [&](const cv::Mat& image, int i, int j) {
    const Eigen::Vector2d at =
        0.5 * (frame.features[i].predicted_px + frame.features[j].predicted_px);
    return image.at<cv::Vec3b>(static_cast<int>(at.y()), static_cast<int>(at.x()));
  };
  DrawOptions plain;
  plain.predictions = plain.searches = plain.matches = plain.status = plain.legend = false;
  EXPECT_EQ(cv::Vec3b(0, 0, 0), middle(drawDebugImage(frame, plain, 1), 0, 1));

  DrawOptions links = plain;
  links.links = true;
  cv::Mat image = drawDebugImage(frame, links, 1);
  EXPECT_GT(middle(image, 0, 1)[2], 200) << "yellow: the strongest";
  EXPECT_GT(cv::norm(middle(image, 0, 2)), 0.0);
  EXPECT_LT(middle(image, 0, 2)[2], 100) << "darker: weaker";
  EXPECT_EQ(cv::Vec3b(0, 0, 0), middle(image, 1, 2)) << "too weak";

  DrawOptions submaps = plain;
  submaps.submaps = true;
  image = drawDebugImage(frame, submaps, 1);
  const Eigen::Vector3f third = submapRgb(3);
  const cv::Vec3b inside = middle(image, 0, 1), across = middle(image, 1, 2);
  EXPECT_NEAR(255.0 * third[0], inside[2], 3.0);
  EXPECT_NEAR(255.0 * third[2], inside[0], 3.0);
  EXPECT_GT(across[0], 0);
  EXPECT_EQ(across[0], across[2]) << "grey: joins two submaps";
  EXPECT_EQ(cv::Vec3b(0, 0, 0), middle(image, 0, 2)) << "not of the tree";
}

TEST(DebugImage, DrawsTheMatchersTreeThoughAFeatureIsRetiredByNow) {
  TrackedFrame frame;
  frame.image = cv::Mat(480, 640, CV_8UC1, cv::Scalar(0));
  frame.features = {pointFeature(2, {0, 0, 1})};
  frame.prior.ids = {1, 2};
  frame.prior.z.resize(4);
  frame.prior.z << 100, 100, 300, 100;
  frame.prior.S.setIdentity(4, 4);
  frame.matching.tree_edges = {{0, 1}};
  DrawOptions tree;
  tree.predictions = tree.searches = tree.matches = tree.status = false;
  tree.tree = tree.information = true;
  EXPECT_NE(cv::Vec3b(0, 0, 0), drawDebugImage(frame, tree, 0).at<cv::Vec3b>(100, 200));
}

/// Of a picture as large as the image: where nothing is enlarged.
bool isRedAt(const cv::Mat& image, const Eigen::Vector2d& pixel) {
  const cv::Vec3b color = image.at<cv::Vec3b>(cvRound(pixel.y()), cvRound(pixel.x()));
  return color[2] > color[0] + 100 && color[2] > color[1] + 100;
}

TEST(DebugImage, MarksASearchThatFoundNothingWhereItWasMadeThoughItsFeatureIsMatchedInTheEnd) {
  TrackedFrame frame;
  frame.image = cv::Mat(480, 640, CV_8UC1, cv::Scalar(60));
  frame.features = {pointFeature(1, {0, 0, 1})};
  const Eigen::Vector2d in_vain(200, 150), with_success(400, 300);
  MatchStep nothing, something;
  nothing.ellipse = {in_vain, 25.0 * Eigen::Matrix2d::Identity()};
  something.ellipse = {with_success, 25.0 * Eigen::Matrix2d::Identity()};
  something.matches = {0};
  frame.matching.trace = {nothing, something};
  const cv::Mat image = drawDebugImage(frame, DrawOptions(), 0);
  EXPECT_TRUE(isRedAt(image, in_vain));
  EXPECT_FALSE(isRedAt(image, with_success));
  const cv::Vec3b first = image.at<cv::Vec3b>(150, 215), last = image.at<cv::Vec3b>(300, 415);
  EXPECT_GT(first[1], first[2] + 100) << "cyan";
  EXPECT_GT(last[2], last[1] + 100) << "magenta";

  DrawOptions without;
  without.matches = false;
  EXPECT_FALSE(isRedAt(drawDebugImage(frame, without, 0), in_vain));
}

TEST(DebugImage, MarksAMissedFeatureAtItsPredictionWhenTheMatcherLeavesNoTrace) {
  TrackedFrame frame;
  frame.image = cv::Mat(480, 640, CV_8UC1, cv::Scalar(60));
  frame.features = {pointFeature(1, {0, 0, 1})};
  frame.features[0].status = FeatureStatus::kMissed;
  EXPECT_TRUE(isRedAt(drawDebugImage(frame, DrawOptions(), 0), frame.features[0].predicted_px));
}

TEST(DebugImage, SaysWhatItsMarksMeanBelowThePictureAndHidesNothing) {
  TrackedFrame frame;
  frame.image = cv::Mat(480, 640, CV_8UC1, cv::Scalar(60));
  DrawOptions silent;
  silent.status = silent.legend = false;
  const cv::Mat bare = drawDebugImage(frame, silent, 0);
  ASSERT_EQ(cv::Size(640, 480), bare.size());
  const cv::Mat explained = drawDebugImage(frame, DrawOptions(), 0);
  ASSERT_GT(explained.rows, 480);
  EXPECT_EQ(0.0, cv::norm(bare, explained.rowRange(0, 480)));
  DrawOptions everything;
  everything.tree = everything.links = everything.submaps = everything.information = true;
  EXPECT_GT(drawDebugImage(frame, everything, 0).rows, explained.rows) << "each mark has a legend";
  EXPECT_GT(cv::countNonZero(explained.rowRange(482, explained.rows).reshape(1) > 200), 200);
}

TEST(DebugImage, SurvivesWhatIsNotFinite) {
  TrackedFrame frame;
  frame.image = cv::Mat(480, 640, CV_8UC1, cv::Scalar(0));
  frame.features = {pointFeature(1, {0, 0, 1})};
  frame.features[0].predicted_px.setConstant(std::nan(""));
  frame.features[0].innovation_covariance_px2.setConstant(INFINITY);
  DrawOptions all;
  all.templates = all.information = all.tree = all.links = all.submaps = true;
  EXPECT_NO_THROW(drawDebugImage(frame, all, 0));
}

}  // namespace
}  // namespace active_matching_slam
