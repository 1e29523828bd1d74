#include "active_matching_slam/ros/markers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "active_matching_slam/ros/debug_image.h"
#include "active_matching_slam/ros/frame_conversions.h"
#include "active_matching_slam/ros/pose_conversions.h"

namespace active_matching_slam {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

TrackedFeature pointFeature(FeatureId id, const Eigen::Vector3d& position) {
  TrackedFeature feature;
  feature.id = id;
  feature.kind = FeatureKind::kPoint;
  feature.position_world = position;
  feature.covariance_world = Eigen::Vector3d(1e-4, 4e-4, 9e-4).asDiagonal();
  feature.status = FeatureStatus::kMatched;
  feature.predicted_px = feature.matched_px = Eigen::Vector2d(50, 40);
  feature.innovation_covariance_px2 = Eigen::Matrix2d::Identity();
  return feature;
}

std_msgs::Header worldHeader() {
  std_msgs::Header header;
  header.frame_id = "world";
  header.stamp = ros::Time(5, 6);
  return header;
}

const Marker* find(const MarkerArray& markers, const std::string& ns, int id) {
  for (const Marker& marker : markers.markers)
    if (marker.ns == ns && marker.id == id) return &marker;
  return nullptr;
}

TEST(Ellipsoid, AxesAreThreeTimesTheRootsOfTheVariances) {
  const Eigen::Quaterniond q(Eigen::AngleAxisd(0.8, Eigen::Vector3d(1, 2, -1).normalized()));
  const Eigen::Matrix3d R = q.toRotationMatrix();
  const Eigen::Matrix3d covariance =
      R * Eigen::Vector3d(0.01, 0.04, 0.25).asDiagonal() * R.transpose();
  const Ellipsoid ellipsoid = threeSigmaEllipsoid(covariance);
  EXPECT_TRUE(ellipsoid.semi_axes_m.isApprox(Eigen::Vector3d(0.3, 0.6, 1.5), 1e-9));
  const Eigen::Matrix3d axes = ellipsoid.q_world_axes.toRotationMatrix();
  const Eigen::Matrix3d rebuilt =
      axes * (ellipsoid.semi_axes_m / 3.0).array().square().matrix().asDiagonal() *
      axes.transpose();
  EXPECT_TRUE(rebuilt.isApprox(covariance, 1e-9));
}

TEST(Ellipsoid, RoundingBelowZeroDoesNotMakeItNaN) {
  const Ellipsoid ellipsoid = threeSigmaEllipsoid(Eigen::Vector3d(-1e-18, 0.0, 1.0).asDiagonal());
  EXPECT_TRUE(ellipsoid.semi_axes_m.allFinite());
}

TEST(Ellipse, AxesAreThreeTimesTheRootsOfTheVariances) {
  const double angle = 0.4;
  const Eigen::Matrix2d R = Eigen::Rotation2Dd(angle).toRotationMatrix();
  const Eigen::Matrix2d covariance = R * Eigen::Vector2d(16.0, 4.0).asDiagonal() * R.transpose();
  const EllipseAxes axes = threeSigmaEllipse(covariance);
  EXPECT_NEAR(12.0, axes.major_px, 1e-9);
  EXPECT_NEAR(6.0, axes.minor_px, 1e-9);
  EXPECT_NEAR(0.0, std::sin(axes.angle_deg * M_PI / 180.0 - angle), 1e-9);
}

TEST(Ray, CoversThreeSigmaOfInverseDepthAndEndsAtTheLimitWhenInfinityIsInside) {
  const auto [nearest, furthest] = threeSigmaDepths(0.5, 0.1, 100.0);
  EXPECT_NEAR(1.0 / 0.8, nearest, 1e-12);
  EXPECT_NEAR(1.0 / 0.2, furthest, 1e-12);
  EXPECT_EQ(100.0, threeSigmaDepths(0.5, 0.25, 100.0).second);
  const auto [near_limit, far_limit] = threeSigmaDepths(-0.5, 0.01, 100.0);
  EXPECT_EQ(100.0, near_limit);
  EXPECT_EQ(100.0, far_limit);
}

TEST(FeatureMarkers, PointsGetEllipsoidsOfFullThreeSigmaLength) {
  TrackedFrame frame;
  frame.features = {pointFeature(7, {0, 0, 2})};
  const MarkerArray markers = featureMarkers(frame, worldHeader());
  const Marker* ellipsoid = find(markers, "ellipsoids", 7);
  ASSERT_TRUE(ellipsoid);
  std::vector<double> lengths = {ellipsoid->scale.x, ellipsoid->scale.y, ellipsoid->scale.z};
  std::sort(lengths.begin(), lengths.end());
  EXPECT_NEAR(0.06, lengths[0], 1e-9);
  EXPECT_NEAR(0.12, lengths[1], 1e-9);
  EXPECT_NEAR(0.18, lengths[2], 1e-9);
  EXPECT_EQ("world", ellipsoid->header.frame_id);
  EXPECT_EQ(ros::Time(5, 6), ellipsoid->header.stamp);
}

TEST(FeatureMarkers, InverseDepthFeaturesAreTheirRay) {
  TrackedFrame frame;
  TrackedFeature feature = pointFeature(3, {0, 0, 2});
  feature.kind = FeatureKind::kInverseDepth;
  feature.anchor_world = Eigen::Vector3d(0.1, 0, 0);
  feature.bearing_world = Eigen::Vector3d::UnitZ();
  feature.inverse_depth = 0.5;
  feature.sigma_inverse_depth = 0.05;
  frame.features = {feature};
  const MarkerArray markers = featureMarkers(frame, worldHeader());
  const Marker* ray = find(markers, "rays", 0);
  ASSERT_TRUE(ray);
  ASSERT_EQ(2u, ray->points.size());
  EXPECT_NEAR(1.0 / 0.65, ray->points[0].z, 1e-9);
  EXPECT_NEAR(1.0 / 0.35, ray->points[1].z, 1e-9);
  EXPECT_NEAR(0.1, ray->points[1].x, 1e-9);
  EXPECT_FALSE(find(markers, "ellipsoids", 3));
}

TEST(FeatureMarkers, WhatIsNotFiniteIsLeftOut) {
  TrackedFrame frame;
  frame.features = {pointFeature(1, {0, 0, std::nan("")}), pointFeature(2, {0, 0, 1})};
  const MarkerArray markers = featureMarkers(frame, worldHeader());
  EXPECT_FALSE(find(markers, "ellipsoids", 1));
  EXPECT_TRUE(find(markers, "ellipsoids", 2));
}

TEST(CameraMarkers, FrustumOpensTowardsWhereTheCameraLooks) {
  TrackedFrame frame;
  frame.state = TrackingState::kTracking;
  frame.camera.position_world << 1, 2, 3;
  CameraCalibration calibration;
  calibration.width = 640;
  calibration.height = 480;
  calibration.fx = calibration.fy = 500;
  calibration.cx = 319.5;
  calibration.cy = 239.5;
  const MarkerArray markers = cameraMarkers(frame, calibration, {}, 0.2, worldHeader());
  const Marker* frustum = find(markers, "frustum", 0);
  ASSERT_TRUE(frustum);
  double furthest = 0.0;
  for (const auto& point : frustum->points) furthest = std::max(furthest, point.z);
  EXPECT_NEAR(3.2, furthest, 1e-9);
  frame.state = TrackingState::kLost;
  EXPECT_FALSE(find(cameraMarkers(frame, calibration, {}, 0.2, worldHeader()), "frustum", 0))
      << "a lost camera claims no pose";
}

TEST(CameraMarkers, UncertaintyIsShownUnlessItWouldHideTheScene) {
  TrackedFrame frame;
  frame.features = {pointFeature(1, {0, 0, 2})};
  const TrajectoryPoint known{Eigen::Vector3d::Zero(), 1e-4 * Eigen::Matrix3d::Identity()};
  const TrajectoryPoint vague{Eigen::Vector3d::Zero(), Eigen::Matrix3d::Identity()};
  const MarkerArray markers = cameraMarkers(frame, {}, {known, vague, known}, 0.2, worldHeader());
  EXPECT_TRUE(find(markers, "trajectory", 0));
  EXPECT_TRUE(find(markers, "trajectory 3 sigma", 1));
  EXPECT_FALSE(find(markers, "trajectory 3 sigma", 2));
}

TEST(InformationMarkers, TreeLinksStandOutAndWeakLinksAreLeftOut) {
  TrackedFrame frame;
  frame.features = {pointFeature(1, {0, 0, 1}), pointFeature(2, {1, 0, 1}),
                    pointFeature(3, {0, 1, 1})};
  auto graph = std::make_shared<MutualInformationGraph>();
  graph->ids = {1, 2, 3};
  graph->links = {{1, 2, 4.0, 5, true}, {1, 3, 2.0, 5, false}, {2, 3, 0.1, 5, false}};
  frame.graph = graph;
  const MarkerArray markers = informationMarkers(frame, 0.5, worldHeader());
  ASSERT_TRUE(find(markers, "tree", 0));
  EXPECT_EQ(2u, find(markers, "tree", 0)->points.size());
  std::size_t ends = 0;
  for (const Marker& marker : markers.markers)
    if (marker.ns == "links") ends += marker.points.size();
  EXPECT_EQ(2u, ends);
}

TEST(SubmapMarkers, FeaturesOfOneSubmapShareAColourAndAnOutline) {
  TrackedFrame frame;
  for (int i = 0; i < 6; ++i)
    frame.features.push_back(pointFeature(i, {i % 3 + 10.0 * (i / 3), 0.3 * (i % 2), 2.0}));
  auto hierarchy = std::make_shared<SubmapHierarchy>();
  hierarchy->ids = {0, 1, 2, 3, 4, 5};
  hierarchy->levels.resize(2);
  hierarchy->levels[0].submap_of_feature = {0, 1, 2, 3, 4, 5};
  hierarchy->levels[1].submap_of_feature = {0, 0, 0, 4, 4, 4};
  frame.submaps = hierarchy;
  const MarkerArray markers = submapMarkers(frame, 1, worldHeader());
  const Marker* features = find(markers, "features", 0);
  ASSERT_TRUE(features);
  EXPECT_EQ(features->colors[0], features->colors[2]);
  EXPECT_EQ(features->colors[3], features->colors[5]);
  EXPECT_NE(features->colors[0], features->colors[3]);
  EXPECT_TRUE(find(markers, "labels", 0));
  EXPECT_TRUE(find(markers, "labels", 4));
  ASSERT_TRUE(find(markers, "hulls", 0));
  EXPECT_EQ(12u, find(markers, "hulls", 0)->points.size()) << "two triangles";
}

TEST(MarkerHistory, DeletesWhatIsNoMore) {
  MarkerHistory history;
  TrackedFrame frame;
  frame.features = {pointFeature(1, {0, 0, 1}), pointFeature(2, {1, 0, 1})};
  MarkerArray markers = featureMarkers(frame, worldHeader());
  history.complete(worldHeader(), &markers);
  EXPECT_EQ(Marker::DELETEALL, markers.markers.front().action);
  frame.features.pop_back();
  markers = featureMarkers(frame, worldHeader());
  history.complete(worldHeader(), &markers);
  EXPECT_NE(Marker::DELETEALL, markers.markers.front().action);
  ASSERT_TRUE(find(markers, "ellipsoids", 2));
  EXPECT_EQ(Marker::DELETE, find(markers, "ellipsoids", 2)->action);
  for (const Marker& marker : markers.markers)
    EXPECT_EQ(worldHeader().stamp, marker.header.stamp) << "what is deleted has a stamp too";
  for (int again = 1; again < MarkerHistory::kRepetitions; ++again) {
    markers = featureMarkers(frame, worldHeader());
    history.complete(worldHeader(), &markers);
    ASSERT_TRUE(find(markers, "ellipsoids", 2)) << "a viewer may have missed it " << again;
  }
  markers = featureMarkers(frame, worldHeader());
  history.complete(worldHeader(), &markers);
  EXPECT_FALSE(find(markers, "ellipsoids", 2)) << "deletions end";
  history.restart();
  markers = featureMarkers(frame, worldHeader());
  history.complete(worldHeader(), &markers);
  EXPECT_EQ(Marker::DELETEALL, markers.markers.front().action);
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
  plain.predictions = plain.searches = plain.matches = plain.status = false;
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
  const std_msgs::ColorRGBA third = submapColor(3);
  const cv::Vec3b inside = middle(image, 0, 1), across = middle(image, 1, 2);
  EXPECT_NEAR(255.0 * third.r, inside[2], 3.0);
  EXPECT_NEAR(255.0 * third.b, inside[0], 3.0);
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
