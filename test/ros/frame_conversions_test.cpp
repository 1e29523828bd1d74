#include "active_matching_slam/ros/frame_conversions.h"

#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include <cmath>

#include "ros/world_header.h"

namespace active_matching_slam {
namespace {

TrackedFeature matchedFeature(FeatureId id) {
  TrackedFeature feature;
  feature.id = id;
  feature.kind = FeatureKind::kInverseDepth;
  feature.position_world << 1, 2, 3;
  feature.covariance_world << 4, 0.5, 0.25, 0.5, 9, 0.125, 0.25, 0.125, 16;
  feature.anchor_world.setZero();
  feature.bearing_world.setUnit(2);
  feature.inverse_depth = 0.3;
  feature.sigma_inverse_depth = 0.1;
  feature.status = FeatureStatus::kMatched;
  feature.predicted_px << 10, 20;
  feature.innovation_covariance_px2 << 3, 1, 1, 5;
  feature.matched_px << 11, 21;
  return feature;
}

TEST(FeatureMessage, HoldsWhatTheFeatureIs) {
  TrackedFrame frame;
  frame.features = {matchedFeature(17)};
  const auto message = toFeatureArrayMsg(frame, 0, worldHeader());
  EXPECT_EQ(worldHeader(), message.header);
  ASSERT_EQ(1u, message.features.size());
  const auto& feature = message.features[0];
  EXPECT_EQ(17, feature.id);
  EXPECT_EQ(ams_msgs::Feature::INVERSE_DEPTH, feature.kind);
  EXPECT_EQ(ams_msgs::Feature::MATCHED, feature.status);
  EXPECT_EQ(0.5, feature.position_covariance[1]);
  EXPECT_EQ(16.0, feature.position_covariance[8]);
  EXPECT_EQ(20.0, feature.predicted_px[1]);
  EXPECT_EQ(5.0, feature.innovation_covariance[3]);
  EXPECT_EQ(21.0, feature.matched_px[1]);
}

TEST(FeatureMessage, TellsWhatAFeatureKnowsOfTheOthersInBits) {
  TrackedFrame frame;
  TrackedFeature unseen = matchedFeature(8);
  unseen.status = FeatureStatus::kNotVisible;
  frame.features = {matchedFeature(5), matchedFeature(6), matchedFeature(7), unseen};
  frame.prior.ids = {5, 6, 7};
  frame.prior.z.setZero(6);
  frame.prior.S.setIdentity(6, 6);
  frame.prior.S(0, 2) = frame.prior.S(2, 0) = std::sqrt(0.75);  // of the first two
  const auto message = toFeatureArrayMsg(frame, 0, worldHeader());
  EXPECT_NEAR(1.0, message.features[0].information_bits, 1e-9) << "-0.5 log2(1 - 0.75)";
  EXPECT_NEAR(1.0, message.features[1].information_bits, 1e-9);
  EXPECT_NEAR(0.0, message.features[2].information_bits, 1e-9);
  EXPECT_EQ(0.0, message.features[3].information_bits);
}

TEST(FeatureMessage, StatusesAndKindsHaveTheNumbersOfTheMessage) {
  EXPECT_EQ(ams_msgs::Feature::NOT_VISIBLE, int(FeatureStatus::kNotVisible));
  EXPECT_EQ(ams_msgs::Feature::NOT_SEARCHED, int(FeatureStatus::kNotSearched));
  EXPECT_EQ(ams_msgs::Feature::MISSED, int(FeatureStatus::kMissed));
  EXPECT_EQ(ams_msgs::Feature::REJECTED, int(FeatureStatus::kRejected));
  EXPECT_EQ(ams_msgs::Feature::MATCHED, int(FeatureStatus::kMatched));
  EXPECT_EQ(ams_msgs::TrackingState::WAITING, int(TrackingState::kWaiting));
  EXPECT_EQ(ams_msgs::TrackingState::INITIALISING, int(TrackingState::kInitialising));
  EXPECT_EQ(ams_msgs::TrackingState::TRACKING, int(TrackingState::kTracking));
  EXPECT_EQ(ams_msgs::TrackingState::LOST, int(TrackingState::kLost));
  EXPECT_EQ(ams_msgs::TrackingState::SCALE_FREE, int(ScaleSource::kFree));
  EXPECT_EQ(ams_msgs::TrackingState::SCALE_KNOWN_TARGET, int(ScaleSource::kKnownTarget));
  EXPECT_EQ(ams_msgs::TrackingState::SCALE_KNOWN_POINTS, int(ScaleSource::kKnownPoints));
  EXPECT_EQ(ams_msgs::TrackingState::SCALE_SERVICE, int(ScaleSource::kService));
  EXPECT_EQ(ams_msgs::TrackingState::SCALE_CAMERA_HEIGHT, int(ScaleSource::kCameraHeight));
}

TEST(FeatureMessage, NothingThatIsNotFiniteIsPublished) {
  TrackedFrame frame;
  TrackedFeature far = matchedFeature(1);
  far.position_world.setConstant(1e9);
  TrackedFeature broken = matchedFeature(2);
  broken.covariance_world(1, 1) = std::nan("");
  TrackedFeature odd = matchedFeature(3);
  odd.score = std::nan("");
  odd.innovation_covariance_px2(0, 0) = INFINITY;
  frame.features = {far, broken, odd};
  frame.nis = std::nan("");
  const auto message = toFeatureArrayMsg(frame, 0, worldHeader());
  ASSERT_EQ(1u, message.features.size());
  EXPECT_EQ(0.0, message.features[0].innovation_covariance[0]);
  EXPECT_EQ(0.0f, message.features[0].score);
  EXPECT_EQ(1u, toPointCloudMsg(frame, 0, worldHeader()).width);
  EXPECT_EQ(0.0, toStatisticsMsg(frame, 0, worldHeader()).nis);
}

TEST(StatisticsMessage, TellsCalibrationAndNoiseAsLearnt) {
  TrackedFrame frame;
  frame.match_sigma_px = 0.2;
  frame.camera.readout_s = 0.024;
  frame.camera.lens = {0.01, -0.02, {0.003, -0.004}};
  const auto message = toStatisticsMsg(frame, 0, worldHeader());
  EXPECT_EQ(0.2, message.match_sigma_px);
  EXPECT_EQ(0.024, message.readout_s);
  EXPECT_EQ(0.01, message.lens_focal);
  EXPECT_EQ(-0.02, message.lens_radial);
  EXPECT_EQ(0.003, message.lens_centre_x);
  EXPECT_EQ(-0.004, message.lens_centre_y);
}

TEST(PointCloud, OfAnEmptyMapHasItsFieldsAndNoPoints) {
  const auto cloud = toPointCloudMsg(TrackedFrame(), 0, worldHeader());
  EXPECT_EQ(0u, cloud.width);
  EXPECT_EQ(7u, cloud.fields.size());
  EXPECT_TRUE(cloud.data.empty());
  EXPECT_EQ("world", cloud.header.frame_id);
}

TEST(PointCloud, HoldsPositionSigmaIdAndSubmap) {
  TrackedFrame frame;
  frame.features = {matchedFeature(5), matchedFeature(9)};
  frame.features[1].covariance_world = Eigen::Vector3d(1, 25, 4).asDiagonal();
  auto hierarchy = std::make_shared<SubmapHierarchy>();
  hierarchy->ids = {5, 9};
  hierarchy->levels.resize(1);
  hierarchy->levels[0].submap_of_feature = {5, 9};
  frame.submaps = hierarchy;
  const auto cloud = toPointCloudMsg(frame, 3, worldHeader());
  EXPECT_EQ(worldHeader(), cloud.header);
  ASSERT_EQ(2u, cloud.width * cloud.height);
  sensor_msgs::PointCloud2ConstIterator<float> z(cloud, "z"), sigma(cloud, "sigma");
  sensor_msgs::PointCloud2ConstIterator<std::int32_t> id(cloud, "id"), submap(cloud, "submap");
  EXPECT_EQ(3.0f, *z);
  EXPECT_EQ(5, *id);
  ++sigma, ++submap;
  EXPECT_FLOAT_EQ(5.0f, *sigma) << "a standard deviation, not a variance";
  EXPECT_EQ(9, *submap);
}

TEST(Hypotheses, NameTheFeaturesTheyMatchAndWhereThoughOneIsRetiredByNow) {
  TrackedFrame frame;
  frame.features = {matchedFeature(5)};
  frame.prior.ids = {9, 5};
  frame.matches = {{{{30, 40}, 0.9, 0}, {{50, 60}, 0.8, 1}}, {}};
  MatchHypothesis hypothesis;
  hypothesis.probability = 0.75;
  hypothesis.match_of_feature = {1, -1};
  frame.matching.hypotheses = {hypothesis};
  const auto message = toHypothesesMsg(frame, worldHeader());
  ASSERT_EQ(1u, message.hypotheses.size());
  EXPECT_EQ(0.75, message.hypotheses[0].probability);
  EXPECT_EQ(std::vector<std::int64_t>{9}, message.hypotheses[0].feature_ids);
  EXPECT_EQ(50.0f, message.hypotheses[0].u[0]);
  EXPECT_EQ(60.0f, message.hypotheses[0].v[0]);
}

TEST(State, TellsTheReasonAndTheSourceOfTheScale) {
  TrackedFrame frame;
  frame.state = TrackingState::kLost;
  frame.reason = "2 of 9 matched";
  frame.scale_source = ScaleSource::kService;
  const auto message = toTrackingStateMsg(frame, worldHeader());
  EXPECT_EQ(ams_msgs::TrackingState::LOST, message.state);
  EXPECT_EQ("2 of 9 matched", message.reason);
  EXPECT_EQ("service", message.scale_source_name);
}

}  // namespace
}  // namespace active_matching_slam
