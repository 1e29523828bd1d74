#include "active_matching_slam/image/warp.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "active_matching_slam/filter/ekf.h"
#include "textured_plane.h"

namespace active_matching_slam {
namespace {

struct Move {
  const char* name;
  Eigen::Vector3d position, rotation;
};

class WarpAfter : public testing::TestWithParam<Move> {};

TEST_P(WarpAfter, LooksLikeThePlaneFromThere) {
  const CameraModel camera = wideCamera();
  const Eigen::Isometry3d first = pose({0.1, -0.2, 0.3}, {0.05, -0.1, 0.02});
  const Eigen::Vector2d pixel(205.0, 90.0);
  const Eigen::Vector3d bearing = first.linear() * *camera.unproject(pixel);
  const Eigen::Vector3d point = first.translation() + 1.5 * bearing;
  const Plane plane(point, -bearing, 0.06);  // waves of 8 pixels and more
  const auto patch = extractSourcePatch(plane.render(camera, first, pixel, 20), pixel, first, 31);
  ASSERT_TRUE(patch);

  const Eigen::Isometry3d now = first * pose(GetParam().position, GetParam().rotation);
  const auto view = predictPatchView(*patch, camera, now, finitePoint(point));
  ASSERT_TRUE(view);
  EXPECT_LT((view->pixel - *camera.project(now.inverse() * point)).norm(), 1e-6);

  // Geometry: where the template's pixels lie in the first image, exactly and as warped.
  const SourceOffset source_offset(*view);
  double worst = 0.0;
  for (const int dv : {-5, 0, 5})
    for (const int du : {-5, 0, 5}) {
      const Eigen::Vector2d offset(du, dv);
      const Eigen::Vector2d exact =
          *camera.project(first.inverse() * plane.at(camera, now, view->pixel + offset));
      worst = std::max(worst, (pixel + source_offset(du, dv) - exact).norm());
    }
  EXPECT_LT(worst, 0.02);

  Template warped;
  ASSERT_TRUE(warpTemplate(*patch, *view, 11, &warped));
  const cv::Mat expected = exactTemplate(plane, camera, now, view->pixel, 11);
  const double score = correlation(warped.image(), expected);
  std::printf("%-9s scale %.2f angle %4.1f deg, worst %.3f px, ZNCC %.4f\n", GetParam().name,
              view->scale, view->view_angle_rad * 180.0 / M_PI, worst, score);
  EXPECT_GT(score, 0.98);
}

INSTANTIATE_TEST_SUITE_P(
    Moves, WarpAfter,
    testing::Values(Move{"nothing", {0, 0, 0}, {0, 0, 0}}, Move{"roll", {0, 0, 0}, {0, 0, 0.8}},
                    Move{"pan", {0, 0, 0}, {0, 0.3, 0}}, Move{"nearer", {0, 0, 0.5}, {0, 0, 0}},
                    Move{"farther", {0, 0, -1.0}, {0, 0, 0}},
                    Move{"sideways", {-0.8, 0, 0}, {0, 0.4, 0}},
                    Move{"all", {0.4, 0.3, 0.2}, {0.2, -0.2, -0.5}}),
    [](const testing::TestParamInfo<Move>& info) { return std::string(info.param.name); });

class WarpTest : public testing::Test {
 protected:
  WarpTest()
      : camera_(wideCamera()),
        image_(WaveTexture(31, 7.0).render(320, 240)),
        patch_(*extractSourcePatch(image_, {150.0, 100.0}, Eigen::Isometry3d::Identity(), 31)),
        point_(*camera_.unproject(patch_.pixel)) {}

  CameraModel camera_;
  cv::Mat image_;
  SourcePatch patch_;
  Eigen::Vector3d point_;  // 1 m away
};

TEST_F(WarpTest, WithoutMotionGivesTheImageItself) {
  const auto view = predictPatchView(patch_, camera_, patch_.T_world_camera, finitePoint(point_));
  ASSERT_TRUE(view);
  EXPECT_LT((view->affine - Eigen::Matrix2d::Identity()).norm(), 1e-6);
  EXPECT_NEAR(view->scale, 1.0, 1e-6);
  EXPECT_NEAR(view->view_angle_rad, 0.0, 1e-6);
  Template warped;
  ASSERT_TRUE(warpTemplate(patch_, *view, 11, &warped));
  EXPECT_EQ(cv::norm(warped.image(), image_(cv::Rect(145, 95, 11, 11)), cv::NORM_INF), 0.0);
}

TEST_F(WarpTest, KeepsTheSubpixelCentreInTheMiddle) {
  const WaveTexture texture(31, 7.0);
  const Eigen::Vector2d pixel(150.37, 100.81);
  const auto patch = extractSourcePatch(image_, pixel, Eigen::Isometry3d::Identity(), 31);
  ASSERT_TRUE(patch);
  const auto view = predictPatchView(*patch, camera_, patch->T_world_camera,
                                     finitePoint(*camera_.unproject(pixel)));
  Template warped;
  ASSERT_TRUE(warpTemplate(*patch, *view, 11, &warped));
  const cv::Mat exact = texture.render(11, 11, pixel.x() - 5.0, pixel.y() - 5.0);
  EXPECT_LT(cv::norm(warped.image(), exact, cv::NORM_INF), 8.0);
  EXPECT_GT(correlation(warped.image(), exact), 0.998);
}

TEST_F(WarpTest, OfAFarPointApproachesThatOfAPointAtInfinity) {
  const Eigen::Isometry3d now = pose({0.3, 0.1, 0.2}, {0.05, 0.1, 0.2});
  const auto infinite =
      predictPatchView(patch_, camera_, now, {point_.x(), point_.y(), point_.z(), 0.0});
  ASSERT_TRUE(infinite);
  const auto rotation_only =
      predictPatchView(patch_, camera_, pose({0, 0, 0}, {0.05, 0.1, 0.2}), finitePoint(point_));
  ASSERT_TRUE(rotation_only);
  EXPECT_LT((infinite->pixel - rotation_only->pixel).norm(), 1e-9);
  EXPECT_LT((infinite->affine - rotation_only->affine).norm(), 1e-9);
  EXPECT_NEAR(infinite->view_angle_rad, 0.0, 1e-7);
  const auto far = predictPatchView(patch_, camera_, now, finitePoint(1e7 * point_));
  ASSERT_TRUE(far);
  EXPECT_LT((infinite->pixel - far->pixel).norm(), 1e-4);
}

TEST_F(WarpTest, ReportsScaleAndViewAngle) {
  // Half-way towards a point 1 m ahead along its ray it looks twice as large.
  const auto nearer =
      predictPatchView(patch_, camera_, pose(0.5 * point_, {0, 0, 0}), finitePoint(point_));
  ASSERT_TRUE(nearer);
  EXPECT_NEAR(nearer->scale, 2.0, 1e-6);
  EXPECT_NEAR(nearer->view_angle_rad, 0.0, 1e-6);
  const auto slightly = predictPatchView(
      patch_, camera_, pose(0.2 * point_.unitOrthogonal(), {0, 0, 0}), finitePoint(point_));
  ASSERT_TRUE(slightly);
  EXPECT_NEAR(slightly->view_angle_rad, std::atan(0.2), 1e-9);
}

TEST_F(WarpTest, AffineIsTheDerivativeOfThePointsMotion) {
  const Eigen::Isometry3d now = pose({0.2, -0.1, 0.1}, {0.1, -0.15, 0.3});
  Eigen::Matrix<double, 3, 2> d_bearing_d_pixel;
  const Eigen::Vector3d bearing = *camera_.unproject(patch_.pixel, &d_bearing_d_pixel);
  for (const Eigen::Vector3d& tilt :
       {Eigen::Vector3d(0, 0, 0), Eigen::Vector3d(0.8, 0, 0), Eigen::Vector3d(-0.5, 1.2, 0.1)}) {
    const Eigen::Vector3d across = tilt - bearing * bearing.dot(tilt);
    const Eigen::Vector3d normal = bearing + across;
    patch_.slope_per_px = d_bearing_d_pixel.transpose() * normal;
    const auto view = predictPatchView(patch_, camera_, now, finitePoint(point_));
    ASSERT_TRUE(view);
    const auto moved = [&](const Eigen::Vector2d& pixel) {
      const Eigen::Vector3d ray = *camera_.unproject(pixel);
      const Eigen::Vector3d on_plane = ray * (normal.dot(point_) / normal.dot(ray));
      return *camera_.project(now.inverse() * on_plane);
    };
    const double h = 1e-3;
    Eigen::Matrix2d numerical;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d step = h * Eigen::Vector2d::Unit(k);
      numerical.col(k) = (moved(patch_.pixel + step) - moved(patch_.pixel - step)) / (2 * h);
    }
    EXPECT_LT((view->affine - numerical).norm(), 1e-6) << "tilt " << tilt.transpose();
    EXPECT_NEAR(patch_.slope_per_px.dot(view->tangent_metric_px2 * patch_.slope_per_px),
                across.squaredNorm(), 1e-9);
  }
}

TEST_F(WarpTest, ParallaxIsWhatASlopeDoesToTheAffine) {
  const Eigen::Isometry3d now = pose({0.2, -0.1, 0.1}, {0.1, -0.15, 0.3});
  const Eigen::Vector2d slope(2e-3, -3e-3);
  const auto facing = predictPatchView(patch_, camera_, now, finitePoint(point_));
  patch_.slope_per_px = slope;
  const auto sloping = predictPatchView(patch_, camera_, now, finitePoint(point_));
  ASSERT_TRUE(facing && sloping);
  EXPECT_EQ(sloping->pixel, facing->pixel);
  EXPECT_EQ(sloping->parallax_px, facing->parallax_px);
  EXPECT_LT((sloping->affine - facing->affine - facing->parallax_px * slope.transpose()).norm(),
            1e-12);
  const auto infinite =
      predictPatchView(patch_, camera_, now, {point_.x(), point_.y(), point_.z(), 0.0});
  ASSERT_TRUE(infinite);
  EXPECT_EQ(infinite->parallax_px.norm(), 0.0);
}

TEST_F(WarpTest, IsRefusedForPointsThatCannotBeSeen) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  EXPECT_FALSE(predictPatchView(patch_, camera_, here, {nan, 0, 1, 1}));
  EXPECT_FALSE(predictPatchView(patch_, camera_, here, {0, 0, 1, nan}));
  EXPECT_FALSE(predictPatchView(patch_, camera_, here, {0, 0, 1, -1}));
  EXPECT_FALSE(predictPatchView(patch_, camera_, here, {0, 0, 0, 1}));  // the first camera itself
  EXPECT_FALSE(predictPatchView(patch_, camera_, pose(2.0 * point_, {0, 0, 0}),
                                finitePoint(point_)));  // behind
  EXPECT_FALSE(predictPatchView(patch_, camera_, pose(point_, {0, 0, 0}), finitePoint(point_)));
}

TEST_F(WarpTest, IsRefusedWhereTheStoredPatchEnds) {
  PatchView view;
  Template warped;
  view.affine = Eigen::Matrix2d::Identity() / 2.0;
  EXPECT_TRUE(warpTemplate(patch_, view, 11, &warped));
  view.affine = Eigen::Matrix2d::Identity() / 3.2;
  EXPECT_FALSE(warpTemplate(patch_, view, 11, &warped));
  EXPECT_EQ(warped.size, 0);
  view.affine = Eigen::Matrix2d::Zero();
  EXPECT_FALSE(warpTemplate(patch_, view, 11, &warped));
  view.affine << 1, 0, 0, -1;  // mirrored: the plane seen from behind
  EXPECT_FALSE(warpTemplate(patch_, view, 11, &warped));
  view.affine.setConstant(std::numeric_limits<double>::quiet_NaN());
  EXPECT_FALSE(warpTemplate(patch_, view, 11, &warped));
}

TEST(HomogeneousPosition, AgreesWithTheFeature) {
  FeatureState feature;
  feature.kind = FeatureKind::kInverseDepth;
  feature.anchor_world = {1, 2, 3};
  feature.bearing_world = Eigen::Vector3d(0.1, 0.2, 1.0).normalized();
  feature.inverse_depth = 0.25;
  EXPECT_LT((homogeneousPosition(feature).hnormalized() - feature.position()).norm(), 1e-12);
  feature.inverse_depth = 0.0;
  EXPECT_EQ(homogeneousPosition(feature).w(), 0.0);
  EXPECT_EQ(homogeneousPosition(feature).head<3>(), feature.bearing_world);
  feature.inverse_depth = -0.1;
  EXPECT_EQ(homogeneousPosition(feature).w(), 0.0);
  feature.kind = FeatureKind::kPoint;
  feature.point_world = {4, 5, 6};
  EXPECT_EQ(homogeneousPosition(feature), Eigen::Vector4d(4, 5, 6, 1));
}

TEST(SourcePatch, IsCutAroundItsPixel) {
  const cv::Mat image = randomImage(50, 40, 3);
  const auto patch = extractSourcePatch(image, {20.4, 18.7}, Eigen::Isometry3d::Identity(), 21);
  ASSERT_TRUE(patch);
  EXPECT_EQ(patch->image.size(), cv::Size(21, 21));
  EXPECT_EQ(cv::norm(patch->image, image(cv::Rect(10, 9, 21, 21)), cv::NORM_INF), 0.0);
  EXPECT_LT((patch->center - Eigen::Vector2d(10.4, 9.7)).norm(), 1e-12);
}

TEST(SourcePatch, IsRefusedBeyondTheImage) {
  const cv::Mat image = randomImage(50, 40, 3);
  const Eigen::Isometry3d here = Eigen::Isometry3d::Identity();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(extractSourcePatch(image, {10.0, 10.0}, here, 21));
  EXPECT_TRUE(extractSourcePatch(image, {39.0, 29.0}, here, 21));
  for (const Eigen::Vector2d& pixel :
       {Eigen::Vector2d(9.9, 15), Eigen::Vector2d(15, 9.0), Eigen::Vector2d(39.1, 15),
        Eigen::Vector2d(15, 29.2), Eigen::Vector2d(nan, 15), Eigen::Vector2d(15, 1e300)})
    EXPECT_FALSE(extractSourcePatch(image, pixel, here, 21)) << pixel.transpose();
  EXPECT_FALSE(extractSourcePatch(cv::Mat(), {5, 5}, here, 5));
  EXPECT_FALSE(extractSourcePatch(cv::Mat(9, 9, CV_8UC3), {4, 4}, here, 5));
}

}  // namespace
}  // namespace active_matching_slam
