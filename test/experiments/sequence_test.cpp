#include "../../src/experiments/sequence.h"

#include <gtest/gtest.h>

#include "../../src/experiments/recording.h"
#include "../../src/experiments/reference_matcher.h"
#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

Surface wallAt(double z) {
  Surface wall;  // seen from the origin: u right, v down, its front towards -z
  wall.origin = Eigen::Vector3d(-1.0, -1.0, z);
  wall.u_axis = Eigen::Vector3d::UnitX();
  wall.v_axis = Eigen::Vector3d::UnitY();
  wall.width_m = wall.height_m = 2.0;
  return wall;
}

TEST(Sequence, ALowerRateBeginsAfterTheFirstImages) {
  const std::vector<int> images = imagesAtRate(60, 8);
  EXPECT_EQ(images[kFullRateFrames], kFullRateFrames);
  EXPECT_EQ(images[kFullRateFrames + 1], kFullRateFrames + 8);
  EXPECT_EQ(imagesAtRate(60, 1).size(), 60u);
}

TEST(Sequence, ARayMeetsTheNearestSurfaceFromItsFront) {
  const Eigen::Vector3d ahead = Eigen::Vector3d::UnitZ(), origin = Eigen::Vector3d::Zero();
  const auto hit = firstHit({wallAt(3.0), wallAt(2.0)}, origin, ahead);
  ASSERT_TRUE(hit);
  EXPECT_NEAR(hit->z(), 2.0, 1e-12);
  EXPECT_FALSE(firstHit({wallAt(2.0)}, origin, Eigen::Vector3d::UnitX()));
  EXPECT_FALSE(firstHit({wallAt(2.0)}, Eigen::Vector3d(0, 0, 5), -ahead)) << "from behind";
  EXPECT_FALSE(firstHit({wallAt(2.0)}, Eigen::Vector3d(1.5, 0, 0), ahead)) << "beside it";
}

TEST(Sequence, PnpFindsTheCameraAmongOutliers) {
  const CameraModel camera(makeSimulatedCalibration(640, 480, "plumb_bob"));
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  T_world_camera.translation() << 0.3, -0.1, 0.2;
  T_world_camera.rotate(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitY()));
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  for (int i = 0; i < 20; ++i) {
    points.emplace_back(0.2 * (i % 5) - 0.4, 0.2 * (i / 5) - 0.3, 2.0 + 0.1 * (i % 3));
    pixels.push_back(*camera.project(T_world_camera.inverse() * points.back()));
    if (i % 5 == 0) pixels.back() += Eigen::Vector2d(40.0, -25.0 + i);
  }
  const auto pose = solvePnp(camera, points, pixels, 2.0);
  ASSERT_TRUE(pose);
  EXPECT_EQ(pose->inliers.size(), 16u);
  EXPECT_TRUE(pose->T_world_camera.isApprox(T_world_camera, 1e-4));
  EXPECT_FALSE(solvePnp(camera, {points[0]}, {pixels[0]}, 2.0));
}

/// What the reference run of a simulated sequence writes down agrees with the simulator's truth.
TEST(Sequence, RecordedProblemsPredictTheTruePlaces) {
  const Sequence sequence = loadSequence("office_slow", "", /*quick=*/true);
  ASSERT_TRUE(sequence.isSimulated());
  const Recording recording = recordProblems(sequence, {2, 20, 3, 11});
  EXPECT_EQ(recording.tracked, recording.frames);
  ASSERT_EQ(recording.problems.size(), 3u);
  int known = 0, near = 0;
  for (const RecordedProblem& problem : recording.problems) {
    ASSERT_EQ(problem.templates.size(), problem.prior.ids.size());
    ASSERT_EQ(problem.reference_px.size(), problem.prior.ids.size());
    for (int i = 0; i < problem.prior.size(); ++i) {
      const Eigen::Vector2d error =
          problem.reference_px[static_cast<std::size_t>(i)] - problem.prior.mean(i);
      if (!error.allFinite()) continue;
      ++known;
      near += error.dot(problem.prior.covariance(i).inverse() * error) < 9.0;
    }
  }
  EXPECT_GT(known, 30);
  EXPECT_GT(near, 0.8 * known);
}

}  // namespace
}  // namespace active_matching_slam
