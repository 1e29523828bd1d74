#include "active_matching_slam/camera/camera_model.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdlib>
#include <opencv2/calib3d.hpp>
#include <random>

#include "camera/test_calibrations.h"

namespace active_matching_slam {
namespace {

std::vector<Eigen::Vector3d> pointsInView(const CameraModel& camera, int count) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> u(0.0, camera.width() - 1.0), depth(0.2, 8.0);
  std::uniform_real_distribution<double> v(0.0, camera.height() - 1.0);
  std::vector<Eigen::Vector3d> points;
  while (static_cast<int>(points.size()) < count) {
    const Eigen::Vector2d pixel(u(random), v(random));
    const auto bearing = camera.unproject(pixel);
    if (bearing) points.push_back(depth(random) * *bearing);
  }
  return points;
}

constexpr int kLenses = 7;

/// More than any calibration should get wrong.
LensCorrection largeCorrection() { return {0.06, -0.04, {0.012, -0.017}}; }

/// As calibrated, the second time through corrected with a large correction.
class EveryLens : public testing::TestWithParam<int> {
 protected:
  CameraModel camera_ = CameraModel(lenses()[GetParam() % kLenses])
                            .corrected(GetParam() < kLenses ? LensCorrection() : largeCorrection());
};
INSTANTIATE_TEST_SUITE_P(Lenses, EveryLens, testing::Range(0, 2 * kLenses));

class EveryCalibratedLens : public testing::TestWithParam<int> {
 protected:
  CameraModel camera_{lenses()[GetParam()]};
};
INSTANTIATE_TEST_SUITE_P(Lenses, EveryCalibratedLens, testing::Range(0, kLenses));

TEST_P(EveryLens, ProjectionJacobianEqualsNumericalDerivative) {
  for (const Eigen::Vector3d& point : pointsInView(camera_, 200)) {
    Eigen::Matrix<double, 2, 3> analytic, numeric;
    ASSERT_TRUE(camera_.project(point, &analytic));
    const double step = 1e-5 * point.norm();
    for (int k = 0; k < 3; ++k) {
      // Fourth-order central difference: its truncation stays below rounding.
      const Eigen::Vector3d e = step * Eigen::Vector3d::Unit(k);
      numeric.col(k) = (8.0 * (*camera_.project(point + e) - *camera_.project(point - e)) -
                        (*camera_.project(point + 2 * e) - *camera_.project(point - 2 * e))) /
                       (12.0 * step);
    }
    EXPECT_LT((analytic - numeric).norm(), 1e-7 * analytic.norm()) << point.transpose();
  }
}

TEST_P(EveryLens, UnprojectionJacobianEqualsNumericalDerivative) {
  for (const Eigen::Vector3d& point : pointsInView(camera_, 200)) {
    const Eigen::Vector2d pixel = *camera_.project(point);
    Eigen::Matrix<double, 3, 2> analytic, numeric;
    ASSERT_TRUE(camera_.unproject(pixel, &analytic));
    const double step = 0.02;
    for (int k = 0; k < 2; ++k) {
      const Eigen::Vector2d e = step * Eigen::Vector2d::Unit(k);
      numeric.col(k) = (8.0 * (*camera_.unproject(pixel + e) - *camera_.unproject(pixel - e)) -
                        (*camera_.unproject(pixel + 2 * e) - *camera_.unproject(pixel - 2 * e))) /
                       (12.0 * step);
    }
    EXPECT_LT((analytic - numeric).norm(), 1e-6 * analytic.norm()) << pixel.transpose();
  }
}

TEST_P(EveryLens, JacobiansOfProjectionAndUnprojectionAreInverse) {
  for (const Eigen::Vector3d& point : pointsInView(camera_, 50)) {
    const Eigen::Vector3d bearing = point.normalized();
    Eigen::Matrix<double, 2, 3> down;
    Eigen::Matrix<double, 3, 2> up;
    camera_.unproject(*camera_.project(bearing, &down), &up);
    EXPECT_TRUE((down * up).isApprox(Eigen::Matrix2d::Identity(), 1e-9));
    EXPECT_LT((bearing.transpose() * up).norm(), 1e-12);  // the bearing stays a unit vector
  }
}

TEST_P(EveryLens, EveryPixelOfTheImageSurvivesTheRoundTrip) {
  const double bound = GetParam() < kLenses ? 1e-9 : 1e-8;  // a correction is inverted by itself
  for (int v = 0; v < camera_.height(); v += 5) {
    for (int u = 0; u < camera_.width(); u += 5) {
      const Eigen::Vector2d pixel(u, v);
      const auto bearing = camera_.unproject(pixel);
      ASSERT_TRUE(bearing) << pixel.transpose();
      EXPECT_NEAR(bearing->norm(), 1.0, 1e-14);
      EXPECT_LT((*camera_.project(*bearing) - pixel).norm(), bound);
    }
  }
}

TEST_P(EveryLens, PixelByCorrectionEqualsNumericalDerivative) {
  const LensCorrection correction = GetParam() < kLenses ? LensCorrection() : largeCorrection();
  for (const Eigen::Vector3d& point : pointsInView(camera_, 50)) {
    const auto pixelWith = [&](const Eigen::Vector4d& d) {
      const LensCorrection moved{correction.focal + d[0], correction.radial + d[1],
                                 correction.centre + d.tail<2>()};
      return *camera_.corrected(moved).project(point);
    };
    const Eigen::Matrix<double, 2, 4> analytic = camera_.pixelByCorrection(*camera_.project(point));
    for (int k = 0; k < 4; ++k) {
      // The pixel is linear in its correction: any step will do.
      const Eigen::Vector4d e = 1e-2 * Eigen::Vector4d::Unit(k);
      const Eigen::Vector2d numeric = (pixelWith(e) - pixelWith(-e)) / 2e-2;
      EXPECT_LT((analytic.col(k) - numeric).norm(), 1e-9 * (1.0 + numeric.norm())) << k;
    }
  }
}

TEST_P(EveryCalibratedLens, ACorrectionMovesPixelsAsItsDefinitionSays) {
  const CameraCalibration& c = camera_.calibration();
  const Eigen::Vector2d centre(c.cx, c.cy);
  const LensCorrection l = largeCorrection();
  for (const Eigen::Vector3d& point : pointsInView(camera_, 50)) {
    const Eigen::Vector2d focal_px(c.fx, c.fy);
    const Eigen::Vector2d n = (*camera_.project(point) - centre).cwiseQuotient(focal_px);
    const Eigen::Vector2d moved = l.centre + (1.0 + l.focal + l.radial * n.squaredNorm()) * n;
    const Eigen::Vector2d expected = centre + moved.cwiseProduct(focal_px);
    EXPECT_LT((*camera_.corrected(l).project(point) - expected).norm(), 1e-9);
  }
}

TEST_P(EveryCalibratedLens, NoCorrectionIsTheCalibrationBitForBitAlsoInPlaceOfAnother) {
  const CameraModel none = camera_.corrected(largeCorrection()).corrected({});
  for (const Eigen::Vector3d& point : pointsInView(camera_, 50)) {
    const Eigen::Vector2d pixel = *camera_.project(point);
    EXPECT_EQ(*none.project(point), pixel);
    EXPECT_EQ(*none.unproject(pixel), *camera_.unproject(pixel));
  }
}

TEST_P(EveryCalibratedLens, ProjectionAgreesWithOpenCv) {
  const CameraCalibration& c = camera_.calibration();
  const std::vector<Eigen::Vector3d> points = pointsInView(camera_, 200);
  std::vector<cv::Point3d> cv_points;
  for (const Eigen::Vector3d& p : points) cv_points.emplace_back(p.x(), p.y(), p.z());
  const cv::Matx33d K(c.fx, 0.0, c.cx, 0.0, c.fy, c.cy, 0.0, 0.0, 1.0);
  const cv::Vec3d zero(0.0, 0.0, 0.0);
  std::vector<cv::Point2d> expected;
  if (c.distortion_model == DistortionModel::kEquidistant)
    cv::fisheye::projectPoints(cv_points, expected, zero, zero, K, c.distortion);
  else
    cv::projectPoints(cv_points, zero, zero, K, c.distortion, expected);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d pixel = *camera_.project(points[i]);
    EXPECT_NEAR(pixel.x(), expected[i].x, 1e-9);
    EXPECT_NEAR(pixel.y(), expected[i].y, 1e-9);
  }
}

TEST_P(EveryLens, OnlyTheDirectionOfAPointMatters) {
  for (const Eigen::Vector3d& point : pointsInView(camera_, 20))
    EXPECT_LT((*camera_.project(1e-6 * point) - *camera_.project(1e6 * point)).norm(), 1e-9);
}

TEST_P(EveryLens, PointsBehindOrBesideTheCameraHaveNoPixel) {
  EXPECT_FALSE(camera_.project({0.1, 0.2, -1.0}));
  EXPECT_FALSE(camera_.project({0.1, 0.2, 0.0}));
  EXPECT_FALSE(camera_.project({0.0, 0.0, 0.0}));
  EXPECT_FALSE(camera_.project({1e6, 0.0, 1.0}));
  EXPECT_FALSE(camera_.project({NAN, 0.0, 1.0}));
  EXPECT_FALSE(camera_.project({0.0, 0.0, NAN}));
}

TEST_P(EveryLens, PixelsThatAreNotFiniteHaveNoBearing) {
  EXPECT_FALSE(camera_.unproject({NAN, 100.0}));
  EXPECT_FALSE(camera_.unproject({100.0, INFINITY}));
}

TEST_P(EveryCalibratedLens, PrincipalPointLooksAlongTheOpticalAxis) {
  const CameraCalibration& c = camera_.calibration();
  Eigen::Matrix<double, 3, 2> jacobian;
  const auto bearing = camera_.unproject({c.cx, c.cy}, &jacobian);
  ASSERT_TRUE(bearing);
  EXPECT_LT((*bearing - Eigen::Vector3d::UnitZ()).norm(), 1e-12);
  EXPECT_TRUE(jacobian.allFinite());
}

TEST(CameraModel, ProjectionStopsWhereABarrelLensFoldsOver) {
  // r (1 + k1 r^2) turns back at r = 1 / sqrt(-3 k1).
  const CameraModel camera(makeCalibration(DistortionModel::kPlumbBob, {-0.3, 0.0, 0.0, 0.0}));
  const double rim = 1.0 / std::sqrt(0.9);
  EXPECT_TRUE(camera.project({0.999 * rim, 0.0, 1.0}));
  EXPECT_FALSE(camera.project({1.001 * rim, 0.0, 1.0}));
  const double largest_pixel_radius = 410.5 * rim * (1.0 - 0.3 * rim * rim);
  EXPECT_TRUE(camera.unproject({322.75 + 0.9999 * largest_pixel_radius, 236.125}));
  EXPECT_FALSE(camera.unproject({322.75 + 1.0001 * largest_pixel_radius, 236.125}));
}

TEST(CameraModel, TheFieldEndsBeforeAPoleOfTheRationalModel) {
  // The denominator 1 - 0.5 r^2 vanishes at r = sqrt(2).
  const CameraModel camera(makeCalibration(DistortionModel::kRationalPolynomial,
                                           {0.0, 0.0, 0.0, 0.0, 0.0, -0.5, 0.0, 0.0}));
  EXPECT_TRUE(camera.project({1.41, 0.0, 1.0}));
  EXPECT_FALSE(camera.project({1.42, 0.0, 1.0}));
  EXPECT_FALSE(camera.project({3.0, 0.0, 1.0}));
}

TEST(CameraModel, TheFieldEndsWhereACorrectionFoldsOver) {
  // r (1 - 0.04 r^2) turns back at r = 1 / sqrt(0.12) and comes out on the other side at r = 5.
  const CameraModel camera =
      CameraModel(makeCalibration(DistortionModel::kNone, {})).corrected({0.0, -0.04, {0.0, 0.0}});
  const double rim = 1.0 / std::sqrt(0.12);
  EXPECT_TRUE(camera.project({0.999 * rim, 0.0, 1.0}));
  for (const double radius : {1.001 * rim, 4.0, 5.01, 6.0, 20.0})
    EXPECT_FALSE(camera.project({radius, 0.0, 1.0})) << radius;
  const double largest_pixel_radius = 410.5 * rim * (1.0 - 0.04 * rim * rim);
  EXPECT_TRUE(camera.unproject({322.75 + 0.9999 * largest_pixel_radius, 236.125}));
  for (const double factor : {1.0001, 1.1, 2.0, 10.0})
    EXPECT_FALSE(camera.unproject({322.75 + factor * largest_pixel_radius, 236.125})) << factor;
}

TEST(CameraModel, TheFieldIsOneToOneWithTangentialDistortionToo) {
  const CameraModel camera(
      makeCalibration(DistortionModel::kPlumbBob, {-0.3, 0.05, 0.02, -0.015, 0.0}));
  for (double direction = 0.0; direction < 6.28; direction += 0.1) {
    for (double radius = 0.01; radius < 3.0; radius += 0.01) {
      const Eigen::Vector3d point(radius * std::cos(direction), radius * std::sin(direction), 1.0);
      Eigen::Matrix<double, 2, 3> jacobian;
      const auto pixel = camera.project(point, &jacobian);
      if (!pixel) break;
      EXPECT_GT(jacobian.leftCols<2>().determinant(), 0.0);
      const auto bearing = camera.unproject(*pixel);
      ASSERT_TRUE(bearing) << point.transpose();
      EXPECT_LT((*bearing - point.normalized()).norm(), 1e-8);
    }
  }
}

TEST(CameraModel, ImageEndsAtItsLastPixelCentres) {
  const CameraModel camera(lenses()[0]);
  EXPECT_TRUE(camera.isInImage({0.0, 0.0}));
  EXPECT_TRUE(camera.isInImage({639.0, 479.0}));
  EXPECT_FALSE(camera.isInImage({639.01, 100.0}));
  EXPECT_FALSE(camera.isInImage({-0.01, 100.0}));
  EXPECT_TRUE(camera.isInImage({8.0, 471.0}, 8.0));
  EXPECT_FALSE(camera.isInImage({7.9, 100.0}, 8.0));
}

class RecordedCamera : public testing::TestWithParam<const char*> {};
INSTANTIATE_TEST_SUITE_P(Sequences, RecordedCamera,
                         testing::Values("davison_monoslam_desk", "oekf_desk_translation",
                                         "sevenscenes_redkitchen", "uzh_vamr_checkerboard"));

TEST_P(RecordedCamera, SeesEveryPixelOfItsImage) {
  const char* data = std::getenv("AMS_DATA");
  if (!data) GTEST_SKIP() << "AMS_DATA is not set";
  const CameraModel camera(
      readCalibrationYaml(std::string(data) + "/" + GetParam() + "/camera.yaml"));
  for (int v = 0; v < camera.height(); ++v) {
    for (int u = 0; u < camera.width(); ++u) {
      const Eigen::Vector2d pixel(u, v);
      const auto bearing = camera.unproject(pixel);
      ASSERT_TRUE(bearing) << pixel.transpose();
      ASSERT_LT((*camera.project(*bearing) - pixel).norm(), 1e-9) << pixel.transpose();
    }
  }
}

TEST(RecordedCamera, RationalFitOfTheMonoSlamLensEqualsItsOwnModel) {
  const char* data = std::getenv("AMS_DATA");
  if (!data) GTEST_SKIP() << "AMS_DATA is not set";
  const CameraModel camera(
      readCalibrationYaml(std::string(data) + "/davison_monoslam_desk/camera.yaml"));
  for (double v = 0.0; v < 240.0; v += 7.0) {
    for (double u = 0.0; u < 320.0; u += 7.0) {
      // p_d - p_0 = (p_u - p_0) / sqrt(1 + 2 Kd1 |p_u - p_0|^2)  =>  the same with -2 Kd1 back.
      const Eigen::Vector2d distorted(u - 162.0, v - 125.0);
      const Eigen::Vector2d ideal =
          distorted / std::sqrt(1.0 - 2.0 * 9e-6 * distorted.squaredNorm());
      const Eigen::Vector3d bearing = Eigen::Vector3d(ideal.x() / 195.0, ideal.y() / 195.0, 1.0);
      EXPECT_LT((*camera.unproject({u, v}) - bearing.normalized()).norm(), 1e-5);
    }
  }
}

}  // namespace
}  // namespace active_matching_slam
