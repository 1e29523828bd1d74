#include "active_matching_slam/simulation/renderer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <string>
#include <utility>

#include "active_matching_slam/simulation/random.h"
#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/simulation/textures.h"

namespace active_matching_slam {
namespace {

using Eigen::AngleAxisd;
using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

/// A rectangle at depth `depth` that faces a camera at the origin.
Surface facing(double depth, double width, double height, const cv::Mat& albedo) {
  Surface s;
  s.origin = Vector3d(-0.5 * width, -0.5 * height, depth);
  s.u_axis = Vector3d::UnitX();
  s.v_axis = Vector3d::UnitY();
  s.width_m = width;
  s.height_m = height;
  s.albedo = albedo;
  return s;
}

cv::Mat grey(double level) { return cv::Mat(16, 16, CV_32FC1, cv::Scalar(level)); }

Surface moved(const Isometry3d& pose, Surface s) {
  s.origin = pose * s.origin;
  s.u_axis = pose.linear() * s.u_axis;
  s.v_axis = pose.linear() * s.v_axis;
  return s;
}

CameraModel camera(const std::string& distortion, int width = 640, int height = 480) {
  return CameraModel(makeSimulatedCalibration(width, height, distortion));
}

class EveryLens : public ::testing::TestWithParam<std::string> {};

TEST_P(EveryLens, ShowsCornersWhereTheyProject) {
  constexpr double kSquare = 0.05, kWidth = 0.7, kHeight = 0.5;
  Scene scene;
  scene.surfaces.push_back(
      facing(0.7, kWidth, kHeight, paintCheckerboard({kWidth, kHeight, 1000.0, 1}, kSquare)));
  const CameraModel model = camera(GetParam());
  const Renderer renderer(model, scene);
  const Surface& board = scene.surfaces[0];
  int seen = 0;
  Vector2d error_sum = Vector2d::Zero();
  for (int view = 0; view < 3; ++view) {
    Isometry3d T_world_camera(AngleAxisd(0.3 * view, Vector3d(0.3, 1.0, 0.4).normalized()));
    T_world_camera.translation() = Vector3d(-0.17 * view, 0.03 * view, 0.05 * view);
    cv::Mat light, image;
    renderer.render(T_world_camera, light);
    // Blur moves no corner of a checkerboard, but the detector needs edges wider than a pixel.
    cv::GaussianBlur(light, image, {}, 1.0);
    for (double u = kSquare; u < kWidth - 1e-9; u += kSquare)
      for (double v = kSquare; v < kHeight - 1e-9; v += kSquare) {
        const auto pixel = model.project(T_world_camera.inverse() * board.at(u, v));
        if (!pixel || !model.isInImage(*pixel, 12.0)) continue;
        std::vector<cv::Point2f> found = {
            cv::Point2f(std::round(pixel->x()), std::round(pixel->y()))};
        cv::cornerSubPix(
            image, found, {4, 4}, {-1, -1},
            cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 50, 1e-4));
        const Vector2d error = Vector2d(found[0].x, found[0].y) - *pixel;
        EXPECT_LT(error.norm(), 0.1);
        error_sum += error;
        ++seen;
      }
  }
  EXPECT_GT(seen, 150);
  EXPECT_LT(error_sum.norm() / seen, 0.01);  // no bias
}

INSTANTIATE_TEST_SUITE_P(Lenses, EveryLens,
                         ::testing::Values("none", "plumb_bob", "rational_polynomial",
                                           "equidistant"),
                         [](const auto& info) { return info.param; });

/// The nearest rectangle that a ray meets, by the plain formula; its grey, or 0.
double castPlainly(const Scene& scene, const Vector3d& from, const Vector3d& direction) {
  double nearest = 1e30, level = 0.0;
  for (const Surface& s : scene.surfaces) {
    const Vector3d normal = s.normal();
    if (normal.dot(direction) >= 0.0) continue;
    const double t = normal.dot(s.origin - from) / normal.dot(direction);
    const Vector3d hit = from + t * direction - s.origin;
    const double u = s.u_axis.dot(hit), v = s.v_axis.dot(hit);
    if (t <= 0.0 || t >= nearest || u < 0 || v < 0 || u > s.width_m || v > s.height_m) continue;
    nearest = t;
    level = s.albedo.at<float>(0, 0);
  }
  return level;
}

Scene randomRectangles(int count, double spread, double size, double near, double far) {
  Random random(4);
  Scene scene;
  for (int i = 0; i < count; ++i) {
    const Vector3d axis(random.uniform(-1, 1), random.uniform(-1, 1), 0.2);
    Isometry3d pose(AngleAxisd(random.uniform(-1.2, 1.2), axis.normalized()));
    pose.translation() = Vector3d(random.uniform(-spread, spread), random.uniform(-spread, spread),
                                  random.uniform(near, far));
    const Surface s = facing(0.0, random.uniform(0.1, 1.0) * size, random.uniform(0.1, 1.0) * size,
                             grey(0.05 + 0.85 * i / count));
    scene.surfaces.push_back(moved(pose, s));
  }
  return scene;
}

void expectSameAsPlainFormula(const Scene& scene) {
  const CameraModel model = camera("plumb_bob", 170, 130);  // not a multiple of any tile
  const Renderer renderer(model, scene);
  const Isometry3d pose(AngleAxisd(0.1, Vector3d::UnitY()));
  cv::Mat light;
  renderer.render(pose, light);
  int edges = 0;
  for (int y = 0; y < 130; ++y)
    for (int x = 0; x < 170; ++x) {
      double low = 1.0, high = 0.0;
      for (double du : {-0.375, -0.125, 0.125, 0.375})
        for (double dv : {-0.375, -0.125, 0.125, 0.375}) {
          const Vector3d ray = pose.linear() * *model.unproject(Vector2d(x + du, y + dv));
          const double value = castPlainly(scene, pose.translation(), ray);
          low = std::min(low, value);
          high = std::max(high, value);
        }
      edges += high > low;
      // Stored light is rounded to 1/8192.
      EXPECT_GE(light.at<float>(y, x), low - 2e-4) << x << ' ' << y;
      EXPECT_LE(light.at<float>(y, x), high + 2e-4) << x << ' ' << y;
    }
  EXPECT_GT(edges, 300);
  EXPECT_LT(edges, 170 * 130 / 2);
}

TEST(Renderer, SeesWhatThePlainFormulaSees) {
  expectSameAsPlainFormula(randomRectangles(80, 1.7, 1.5, 1.0, 6.0));
}

TEST(Renderer, SeesCrowdsOfSmallThings) {
  expectSameAsPlainFormula(randomRectangles(400, 0.6, 0.12, 5.0, 6.0));
}

TEST(Renderer, ShowsNothingFromBehind) {
  Scene scene;
  scene.surfaces.push_back(facing(1.0, 4.0, 4.0, grey(0.5)));
  const Renderer renderer(camera("none", 96, 64), scene);
  cv::Mat light;
  renderer.render(Isometry3d::Identity(), light);
  EXPECT_NEAR(light.at<float>(32, 48), 0.5, 1e-4);
  Isometry3d behind(AngleAxisd(M_PI, Vector3d::UnitY()));
  behind.translation() = Vector3d(0, 0, 2);
  renderer.render(behind, light);
  EXPECT_EQ(cv::countNonZero(light), 0);
}

TEST(Renderer, FinePatternsTurnGreyInsteadOfAliasing) {
  Scene scene;
  scene.surfaces.push_back(facing(
      6.0, 12.0, 12.0, paintCheckerboard({12.0, 12.0, 200.0, 1}, 0.01)));  // 6 squares a pixel
  const Renderer renderer(camera("none", 128, 96), scene);
  cv::Mat light;
  renderer.render(Isometry3d::Identity(), light);
  cv::Scalar mean, deviation;
  cv::meanStdDev(light, mean, deviation);
  EXPECT_NEAR(mean[0], 0.465, 0.02);
  EXPECT_LT(deviation[0], 0.03);
}

/// 8 m wide, 2 m ahead: dark to the left of the axis and bright to the right.
Scene verticalEdge(double height) {
  cv::Mat edge(64, 1024, CV_32FC1, cv::Scalar(0.1));
  edge.colRange(512, 1024).setTo(cv::Scalar(0.9));
  Scene scene;
  scene.surfaces.push_back(facing(2.0, 8.0, height, edge));
  return scene;
}

TEST(Renderer, BlurIsCentredOnTheMiddleOfTheExposure) {
  const Scene scene = verticalEdge(4.0);
  const CameraModel model = camera("none", 320, 96);
  const Renderer renderer(model, scene);
  const auto pose_at = [](double moment) {
    Isometry3d pose = Isometry3d::Identity();
    pose.translation().x() = 0.08 * moment;  // 10 px over the exposure
    return pose;
  };
  constexpr int kSamples = 16;
  cv::Mat light;
  renderer.render([&](int sample, double) { return pose_at((sample + 0.5) / kSamples - 0.5); },
                  kSamples, light);
  const double expected = model.project(Vector3d(0, 0, 2.0))->x();
  // The area under the step tells where its middle is, whatever its shape.
  double area = 0.0;
  for (int x = 0; x < 320; ++x) area += (light.at<float>(48, x) - 0.1) / 0.8;
  EXPECT_NEAR(319.5 - area, expected, 0.1);
  int slope = 0;
  for (int x = 0; x < 320; ++x)
    slope += light.at<float>(48, x) > 0.14 && light.at<float>(48, x) < 0.86;
  EXPECT_NEAR(slope, 9, 3);
}

/// Mean and third central moment of the slope of row 48: of what a vertical edge is smeared to.
std::pair<double, double> smear(const cv::Mat& light) {
  double sum = 0.0, mean = 0.0, third = 0.0;
  const auto slope = [&](int x) { return light.at<float>(48, x + 1) - light.at<float>(48, x); };
  for (int x = 0; x + 1 < light.cols; ++x) {
    sum += slope(x);
    mean += slope(x) * (x + 0.5);
  }
  mean /= sum;
  for (int x = 0; x + 1 < light.cols; ++x) third += slope(x) * std::pow(x + 0.5 - mean, 3);
  return {mean, third / sum};
}

TEST(Renderer, BlurIsTheSameToBothSidesHoweverFewItsSamples) {
  const Scene scene = verticalEdge(4.0);
  const CameraModel model = camera("none", 320, 96);
  const Renderer renderer(model, scene);
  constexpr int kShifts = 8;  // of the edge over a pixel: what pixels make of it averages out
  for (const int samples : {4, 8, 16})
    for (const double metres : {0.04, -0.04}) {  // 5 px over the exposure
      double third = 0.0;
      for (int shift = 0; shift < kShifts; ++shift) {
        const double middle = 0.008 * shift / kShifts;
        cv::Mat light;
        renderer.render(
            [&](int sample, double) {
              Isometry3d pose = Isometry3d::Identity();
              pose.translation().x() = middle + metres * ((sample + 0.5) / samples - 0.5);
              return pose;
            },
            samples, light);
        const auto [mean, its_third] = smear(light);
        EXPECT_NEAR(mean, model.project(Vector3d(-middle, 0, 2.0))->x(), 0.01);
        third += its_third / kShifts;
      }
      EXPECT_NEAR(third, 0.0, 0.05) << samples << " samples, " << metres << " m";
    }
}

TEST(Renderer, RollingShutterGivesEveryRowItsPose) {
  const Scene scene = verticalEdge(6.0);
  const CameraModel model = camera("none", 320, 96);
  const Renderer renderer(model, scene, true);
  const auto pose_at = [](double row) {
    Isometry3d pose = Isometry3d::Identity();
    pose.translation().x() = 0.001 * row;
    return pose;
  };
  cv::Mat light;
  renderer.render([&](int, double row) { return pose_at(row); }, Renderer::kPattern, light);
  for (int row : {10, 50, 90}) {
    const double expected = model.project(pose_at(row).inverse() * Vector3d(0, 0, 2.0))->x();
    double area = 0.0;
    for (int x = 0; x < 320; ++x) area += (light.at<float>(row, x) - 0.1) / 0.8;
    EXPECT_NEAR(319.5 - area, expected, 0.15);
  }
}

TEST(Renderer, RefusesABrokenScene) {
  Scene scene;
  scene.name = "broken";
  scene.surfaces.push_back(facing(1.0, 0.0, 1.0, grey(0.5)));
  EXPECT_THROW(Renderer(camera("none", 64, 64), scene), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
