#include "active_matching_slam/ros/markers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "active_matching_slam/ros/frame_conversions.h"
#include "active_matching_slam/ros/pose_conversions.h"
#include "active_matching_slam/visualisation/link_view.h"
#include "ros/world_header.h"
#include "support/point_feature.h"

namespace active_matching_slam {
namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

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
  EXPECT_EQ(worldHeader().stamp, ellipsoid->header.stamp);
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
  const MarkerArray markers = informationMarkers(frame, DrawOptions(), worldHeader());
  ASSERT_TRUE(find(markers, "tree", 0));
  EXPECT_EQ(2u, find(markers, "tree", 0)->points.size());
  std::size_t ends = 0;
  for (const Marker& marker : markers.markers)
    if (marker.ns == "links") ends += marker.points.size();
  EXPECT_EQ(2u, ends);
}

TEST(LinksToShow, AreTheStrongestOfEachFeatureAndTheTree) {
  const std::vector<InformationLink> links = {{1, 2, 4.0, 1, true},  {1, 3, 3.0, 1, false},
                                              {1, 4, 2.0, 1, true},  {2, 3, 1.5, 1, false},
                                              {2, 4, 1.0, 1, false}, {3, 4, 0.7, 1, false}};
  DrawOptions options;
  const auto bitsShown = [&](int per_feature, double minimum_bits) {
    options.links_per_feature = per_feature;
    options.minimum_link_bits = minimum_bits;
    std::vector<double> bits;
    for (const InformationLink& link : linksToShow(links, options))
      bits.push_back(link.information_bits);
    return bits;
  };
  using Bits = std::vector<double>;
  EXPECT_EQ((Bits{2.0, 4.0}), bitsShown(0, 0.5));
  EXPECT_EQ((Bits{2.0, 3.0, 4.0}), bitsShown(1, 0.5));
  EXPECT_EQ((Bits{1.0, 1.5, 2.0, 3.0, 4.0}), bitsShown(2, 0.5));
  EXPECT_EQ((Bits{2.0, 3.0, 4.0}), bitsShown(3, 2.5)) << "the tree is shown whole";
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
  for (int again = 1; again < MarkerHistory::kDeletionRepeats; ++again) {
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

}  // namespace
}  // namespace active_matching_slam
