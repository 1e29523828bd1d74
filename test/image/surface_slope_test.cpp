#include "active_matching_slam/image/surface_slope.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <limits>
#include <optional>
#include <tuple>
#include <vector>

#include "active_matching_slam/image/warp.h"
#include "textured_plane.h"

namespace active_matching_slam {
namespace {

constexpr int kTemplatePx = 11;

/// A plane seen first from one place, and then from others around it.
class InclinedPlane {
 public:
  /// `tangent`: of the angles by which the plane is turned off the first ray, two directions
  /// across it.
  explicit InclinedPlane(const Eigen::Vector2d& tangent)
      : camera_(wideCamera()), first_(pose({0.1, -0.2, 0.3}, {0.05, -0.1, 0.02})) {
    Eigen::Matrix<double, 3, 2> d_bearing_d_pixel;
    const Eigen::Vector3d bearing = *camera_.unproject(pixel_, &d_bearing_d_pixel);
    const Eigen::Vector3d x = bearing.unitOrthogonal(), y = bearing.cross(x);
    const Eigen::Vector3d normal = bearing + tangent.x() * x + tangent.y() * y;
    slope_ = d_bearing_d_pixel.transpose() * normal;
    point_ = first_ * (1.5 * bearing);
    plane_.emplace(point_, -(first_.linear() * normal).normalized(), 0.05);
    patch_ = *extractSourcePatch(plane_->render(camera_, first_, pixel_, 20), pixel_, first_, 31);
  }

  /// From `count` places on a circle around the first.
  std::vector<Eigen::Isometry3d> views(int count, double radius_m = 0.25) const {
    std::vector<Eigen::Isometry3d> views;
    for (int i = 0; i < count; ++i) {
      const double angle = 2.0 * M_PI * i / count;
      views.push_back(first_ * pose({radius_m * std::cos(angle), radius_m * std::sin(angle), 0.0},
                                    {0.02, -0.03, 0.05}));
    }
    return views;
  }

  PatchView viewFrom(const Eigen::Isometry3d& now) const {
    return *predictPatchView(patch_, camera_, now, finitePoint(point_));
  }
  Template expectedFrom(const Eigen::Isometry3d& now) const {
    Template expected;
    EXPECT_TRUE(warpTemplate(patch_, viewFrom(now), kTemplatePx, &expected));
    return expected;
  }
  cv::Mat imageFrom(const Eigen::Isometry3d& now) const {
    return plane_->render(camera_, now, viewFrom(now).pixel, 12);
  }
  /// As a tracker would; `error_px` is the match's.
  bool learnFrom(const Eigen::Isometry3d& now, const cv::Mat& image,
                 const Eigen::Vector2d& error_px = Eigen::Vector2d::Zero()) {
    const PatchView view = viewFrom(now);
    return learnSlope(image, view.pixel + error_px, expectedFrom(now), view, &patch_);
  }
  double score(const Eigen::Isometry3d& now) const {
    return correlation(expectedFrom(now).image(),
                       exactTemplate(*plane_, camera_, now, viewFrom(now).pixel, kTemplatePx));
  }

  /// By how much the tangent is off.
  double errorOfTangent() const {
    const Eigen::Vector2d error = patch_.slope_per_px - slope_;
    return std::sqrt(error.dot(viewFrom(first_).tangent_metric_px2 * error));
  }
  SourcePatch& patch() { return patch_; }
  const Eigen::Isometry3d& first() const { return first_; }

 private:
  const Eigen::Vector2d pixel_{205.0, 90.0};
  CameraModel camera_;
  Eigen::Isometry3d first_;
  Eigen::Vector3d point_;
  Eigen::Vector2d slope_;
  std::optional<Plane> plane_;
  SourcePatch patch_;
};

class SlopeOf : public testing::TestWithParam<std::tuple<double, double>> {};

TEST_P(SlopeOf, APlaneIsFoundFromViewsAroundIt) {
  const auto [x, y] = GetParam();
  InclinedPlane plane({x, y});
  const Eigen::Isometry3d other_view = plane.views(1).front();
  const double score_before = plane.score(other_view);
  Eigen::Matrix2d information = Eigen::Matrix2d::Zero();
  unsigned seed = 0;
  for (const Eigen::Isometry3d& now : plane.views(24)) {
    cv::Mat image = plane.imageFrom(now);
    addNoise(&image, 1.5, ++seed);
    ASSERT_TRUE(plane.learnFrom(now, image, {0.2, -0.1}));
    const Eigen::Matrix2d gained = plane.patch().slope_information_px2 - information;
    EXPECT_GT(gained.determinant(), 0.0);
    information = plane.patch().slope_information_px2;
  }
  const double score_after = plane.score(other_view);
  std::printf("tangent (%.1f, %.1f): off by %.3f; ZNCC %.4f, was %.4f\n", x, y,
              plane.errorOfTangent(), score_after, score_before);
  EXPECT_LT(plane.errorOfTangent(), 0.05);
  EXPECT_GT(score_after, 0.995);
  if (Eigen::Vector2d(x, y).norm() > 0.5) {
    EXPECT_LT(1.0 - score_after, 0.5 * (1.0 - score_before));
  }
}

INSTANTIATE_TEST_SUITE_P(Tangents, SlopeOf,
                         testing::Combine(testing::Values(-1.0, 0.0, 0.6),
                                          testing::Values(-0.8, 0.0, 0.9)));

TEST(SurfaceSlope, DoesNotDependOnGainAndOffset) {
  InclinedPlane plane({0.8, -0.4}), dim({0.8, -0.4});
  for (const Eigen::Isometry3d& now : plane.views(12)) {
    const cv::Mat image = plane.imageFrom(now);
    EXPECT_TRUE(plane.learnFrom(now, image));
    EXPECT_TRUE(dim.learnFrom(now, 0.5 * image + 40.0));
  }
  EXPECT_LT(plane.errorOfTangent(), 0.05);
  EXPECT_LT(dim.errorOfTangent(), 0.05);
}

TEST(SurfaceSlope, OneImageOfManyMovesItLittleOnceItIsKnown) {
  InclinedPlane plane({0.5, 0.5});
  for (int round = 0; round < 4; ++round)
    for (const Eigen::Isometry3d& now : plane.views(12)) plane.learnFrom(now, plane.imageFrom(now));
  const double known = plane.errorOfTangent();
  const Eigen::Isometry3d now = plane.views(1).front();
  const PatchView view = plane.viewFrom(now);
  EXPECT_TRUE(learnSlope(InclinedPlane({-1.0, 0.5}).imageFrom(now), view.pixel,
                         plane.expectedFrom(now), view, &plane.patch()));
  EXPECT_LT(plane.errorOfTangent(), known + 0.1);
}

TEST(SurfaceSlope, NeverBecomesSteeperThanASurfaceThatCanBeSeen) {
  // What is far steeper than the steepest allowed has a gradient at every image.
  InclinedPlane plane({0.0, 0.0});
  const InclinedPlane other({8.0, 0.0});
  for (int round = 0; round < 20; ++round)
    for (const Eigen::Isometry3d& now : plane.views(12)) {
      const PatchView view = plane.viewFrom(now);
      Template expected;
      if (!warpTemplate(plane.patch(), view, kTemplatePx, &expected)) continue;
      learnSlope(other.imageFrom(now), view.pixel, expected, view, &plane.patch());
      const Eigen::Vector2d slope = plane.patch().slope_per_px;
      ASSERT_LE(slope.dot(view.tangent_metric_px2 * slope), 9.0);
    }
}

TEST(SurfaceSlope, IsLeftAloneByWhatSaysNothing) {
  InclinedPlane plane({0.8, -0.4});
  const Eigen::Isometry3d other_view = plane.views(1).front(), near = plane.views(1, 0.01).front();
  const cv::Mat image = plane.imageFrom(other_view);
  const PatchView view = plane.viewFrom(other_view);
  const Template expected = plane.expectedFrom(other_view);
  const auto learns = [&](const cv::Mat& from, const Eigen::Vector2d& pixel, const Template& t) {
    const bool learns = learnSlope(from, pixel, t, view, &plane.patch());
    EXPECT_TRUE(plane.patch().slope_per_px.isZero(0.0) || learns);
    EXPECT_TRUE(plane.patch().slope_information_px2.isZero(0.0) || learns);
    return learns;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(plane.learnFrom(near, plane.imageFrom(near)));  // no parallax
  EXPECT_FALSE(plane.learnFrom(plane.first(), plane.imageFrom(plane.first())));
  EXPECT_FALSE(learns(cv::Mat(), view.pixel, expected));
  EXPECT_FALSE(learns(cv::Mat(240, 320, CV_8UC1, cv::Scalar(90)), view.pixel, expected));
  EXPECT_FALSE(learns(255 - image, view.pixel, expected));
  EXPECT_FALSE(learns(image, {3.0, 90.0}, expected));
  EXPECT_FALSE(learns(image, {317.0, 90.0}, expected));
  EXPECT_FALSE(learns(image, {nan, 90.0}, expected));
  EXPECT_FALSE(learns(image, view.pixel, Template()));
  EXPECT_TRUE(learns(image, view.pixel, expected));
}

}  // namespace
}  // namespace active_matching_slam
