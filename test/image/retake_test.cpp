#include <gtest/gtest.h>

#include <Eigen/LU>

#include "active_matching_slam/image/warp.h"
#include "textured_plane.h"

namespace active_matching_slam {
namespace {

/// An inclined plane, first seen from afar and then from nearer; its slope is known.
class ApproachedPlane : public testing::Test {
 protected:
  ApproachedPlane() {
    Eigen::Matrix<double, 3, 2> d_bearing_d_pixel;
    const Eigen::Vector3d bearing = *camera_.unproject(pixel_, &d_bearing_d_pixel);
    const Eigen::Vector3d normal = bearing + 0.5 * bearing.unitOrthogonal();
    point_ = far_ * (1.5 * bearing);
    plane_.emplace(point_, -(far_.linear() * normal).normalized(), 0.03);
    patch_ = *extractSourcePatch(plane_->render(camera_, far_, pixel_, 20), pixel_, far_, 31);
    patch_.slope_per_px = d_bearing_d_pixel.transpose() * normal;
    patch_.slope_information_px2 << 3e4, 1e3, 1e3, 2e4;
    near_ = far_ * pose(0.8 * bearing, {0.02, -0.03, 0.2});
    near_pixel_ = viewOf(patch_, near_).pixel;
  }

  PatchView viewOf(const SourcePatch& patch, const Eigen::Isometry3d& now) const {
    return *predictPatchView(patch, camera_, now, finitePoint(point_));
  }
  SourcePatch retaken() const {
    return *retakeSourcePatch(patch_, camera_, near_, finitePoint(point_),
                              plane_->render(camera_, near_, near_pixel_, 20), near_pixel_, 31);
  }
  double resemblance(const SourcePatch& patch, const Eigen::Isometry3d& now) const {
    const PatchView view = viewOf(patch, now);
    Template expected;
    EXPECT_TRUE(warpTemplate(patch, view, 11, &expected));
    return correlation(exactTemplate(*plane_, camera_, now, view.pixel, 11), expected.image());
  }

  CameraModel camera_ = wideCamera();
  Eigen::Vector2d pixel_{171.3, 110.6}, near_pixel_;
  Eigen::Isometry3d far_ = pose({0.1, -0.2, 0.3}, {0.05, -0.1, 0.02}), near_;
  Eigen::Vector3d point_;
  std::optional<Plane> plane_;
  SourcePatch patch_;
};

TEST_F(ApproachedPlane, IsSeenUnchangedWhereItsPatchWasTakenAnew) {
  EXPECT_GT(viewOf(patch_, near_).scale, 1.8);
  const PatchView view = viewOf(retaken(), near_);
  EXPECT_NEAR(view.scale, 1.0, 1e-9);
  EXPECT_LT((view.affine - Eigen::Matrix2d::Identity()).norm(), 1e-9);
  EXPECT_LT((view.pixel - near_pixel_).norm(), 1e-9);
}

TEST_F(ApproachedPlane, KeepsThePlaneAndHowWellItIsKnown) {
  const SourcePatch anew = retaken();
  Eigen::Matrix<double, 3, 2> d_bearing_d_pixel;
  const Eigen::Vector3d bearing = *camera_.unproject(near_pixel_, &d_bearing_d_pixel);
  const Eigen::Vector3d normal = near_.linear().transpose() * plane_->normal();
  const Eigen::Vector2d slope = d_bearing_d_pixel.transpose() * normal / normal.dot(bearing);
  EXPECT_LT((anew.slope_per_px - slope).norm(), 1e-6);
  // A pixel is now less of the surface: the slope by it is smaller, and known to fewer of them.
  const Eigen::Matrix2d affine = viewOf(patch_, near_).affine;
  EXPECT_LT((affine.inverse() * anew.slope_information_px2 * affine.inverse().transpose() -
             patch_.slope_information_px2)
                .norm(),
            1e-6 * patch_.slope_information_px2.norm());
}

TEST_F(ApproachedPlane, LooksLikeItselfFromNearerThanItsFirstPatchTells) {
  const Eigen::Isometry3d nearer =
      near_ * pose(0.25 * *camera_.unproject(near_pixel_), {0.01, 0.02, 0.0});
  const double by_first = resemblance(patch_, nearer), by_retaken = resemblance(retaken(), nearer);
  EXPECT_GT(by_retaken, 0.98);
  EXPECT_GT(1.0 - by_first, 2.0 * (1.0 - by_retaken));
}

TEST_F(ApproachedPlane, IsNotTakenAnewAtTheBorder) {
  const cv::Mat image = plane_->render(camera_, near_, near_pixel_, 20);
  EXPECT_FALSE(
      retakeSourcePatch(patch_, camera_, near_, finitePoint(point_), image, {5.0, 100.0}, 31));
}

}  // namespace
}  // namespace active_matching_slam
