#include "active_matching_slam/tracker/known_start.h"

#include <gtest/gtest.h>

#include <functional>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/simulation/renderer.h"
#include "active_matching_slam/simulation/sensor.h"
#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kDistance = 0.8;      ///< of the target from the first view [m]
constexpr double kTexelsPerM = 500.0;  ///< a pixel covers about four texels
constexpr int kTemplateSize = 15;

/// A board that faces the first view, its centre at (x, 0, z).
Surface makeBoard(double x, double z, double width_m, double height_m, const cv::Mat& albedo) {
  Surface board;
  board.origin = Vector3d(x - width_m / 2, -height_m / 2, z);
  board.u_axis = Vector3d::UnitX();
  board.v_axis = Vector3d::UnitY();
  board.width_m = width_m;
  board.height_m = height_m;
  board.albedo = albedo;
  return board;
}

/// Smooth random grey with details a few pixels wide.
cv::Mat speckles(int width, int height, int seed) {
  cv::Mat noise(height, width, CV_32FC1), smooth;
  cv::RNG random(static_cast<std::uint64_t>(seed));
  random.fill(noise, cv::RNG::UNIFORM, 0.0, 1.0);
  cv::GaussianBlur(noise, smooth, cv::Size(), 5.0);
  cv::normalize(smooth, smooth, 0.1, 0.8, cv::NORM_MINMAX);
  return smooth;
}

/// Boards before a camera of 320 x 240 pixels with lens distortion.
class Stand {
 public:
  explicit Stand(const std::vector<Surface>& boards)
      : camera(makeSimulatedCalibration(320, 240, "plumb_bob")) {
    scene_.surfaces = boards;
  }

  cv::Mat imageFrom(const Isometry3d& T_world_camera, int seed = 1) const {
    cv::Mat light, image;
    Renderer(camera, scene_).render(T_world_camera, light);
    Sensor(320, 240, 1.5, 0.0).expose(light, 1.0, static_cast<std::uint64_t>(seed), image);
    return image;
  }

  /// The place on the plane at depth z that is seen at a pixel in the first view.
  Vector3d onPlane(const Vector2d& pixel, double z) const {
    const Vector3d bearing = *camera.unproject(pixel);
    return bearing * (z / bearing.z());
  }

  /// Known point with a template cut from the first view around a pixel.
  KnownPoint pointAt(const cv::Mat& first_view, int u, int v, double z = kDistance) const {
    KnownPoint point;
    point.image_px = Vector2d(u, v);
    point.position_m = onPlane(point.image_px, z);
    const int half = kTemplateSize / 2;
    point.template_image =
        first_view(cv::Rect(u - half, v - half, kTemplateSize, kTemplateSize)).clone();
    return point;
  }

  CameraModel camera;

 private:
  Scene scene_;
};

Stand speckledStand(int seed = 1) {
  return Stand({makeBoard(0.0, kDistance, 1.2, 0.9, speckles(600, 450, seed))});
}

std::vector<KnownPoint> fourPoints(const Stand& stand, const cv::Mat& first_view) {
  std::vector<KnownPoint> points;
  for (const auto& [u, v] : {std::pair(90, 60), {230, 65}, {225, 180}, {85, 175}})
    points.push_back(stand.pointAt(first_view, u, v));
  return points;
}

/// A hand does not put the camera back exactly.
Isometry3d displaced(int k) {
  Isometry3d T_world_camera = Isometry3d::Identity();
  T_world_camera.linear() = (Eigen::AngleAxisd(0.015 * std::sin(1.0 + k), Vector3d::UnitX()) *
                             Eigen::AngleAxisd(0.015 * std::cos(2.0 * k), Vector3d::UnitY()) *
                             Eigen::AngleAxisd(0.02 * std::sin(3.0 * k), Vector3d::UnitZ()))
                                .toRotationMatrix();
  T_world_camera.translation() =
      0.015 * Vector3d(std::sin(2.0 + k), std::cos(1.0 + 3.0 * k), 2.0 * std::sin(5.0 * k));
  return T_world_camera;
}

std::optional<KnownStart> find(const cv::Mat& image, const Stand& stand,
                               const std::vector<KnownPoint>& points, std::string* reason,
                               double search_px = 15.0) {
  return findKnownStart(image, stand.camera, points, search_px, ImageOptions(), reason);
}

void expectPose(const KnownStart& start, const Isometry3d& truth, const Stand& stand,
                const std::vector<KnownPoint>& points) {
  EXPECT_LT((start.T_world_camera.translation() - truth.translation()).norm(), 0.01 * kDistance);
  EXPECT_LT(Eigen::AngleAxisd(start.T_world_camera.linear().transpose() * truth.linear()).angle(),
            0.01);
  ASSERT_EQ(start.pixels.size(), points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    EXPECT_LT(
        (start.pixels[i] - *stand.camera.project(truth.inverse() * points[i].position_m)).norm(),
        0.7)
        << "point " << i;
}

TEST(KnownStart, FindsTheCameraFromFourTemplates) {
  const Stand stand = speckledStand();
  const auto points = fourPoints(stand, stand.imageFrom(Isometry3d::Identity()));
  for (int k = 0; k < 8; ++k) {
    const Isometry3d truth = displaced(k);
    std::string reason;
    const auto start = find(stand.imageFrom(truth, 10 + k), stand, points, &reason);
    ASSERT_TRUE(start) << "view " << k << ": " << reason;
    SCOPED_TRACE(k);
    expectPose(*start, truth, stand, points);
    EXPECT_LT(start->reprojection_rms_px, 1.0);
  }
}

TEST(KnownStart, FindsTheCameraFromPointsOfDifferentDepth) {
  const Stand stand({makeBoard(-0.25, kDistance, 0.5, 0.9, speckles(250, 450, 2)),
                     makeBoard(0.35, 1.1, 0.6, 1.2, speckles(300, 600, 3))});
  const cv::Mat first_view = stand.imageFrom(Isometry3d::Identity());
  std::vector<KnownPoint> points;
  for (const auto& [u, v] : {std::pair(60, 60), {120, 120}, {70, 185}})
    points.push_back(stand.pointAt(first_view, u, v, kDistance));
  for (const auto& [u, v] : {std::pair(200, 55), {245, 130}, {210, 185}})
    points.push_back(stand.pointAt(first_view, u, v, 1.1));
  for (int k = 0; k < 4; ++k) {
    const Isometry3d truth = displaced(k);
    std::string reason;
    const auto start = find(stand.imageFrom(truth, 20 + k), stand, points, &reason);
    ASSERT_TRUE(start) << "view " << k << ": " << reason;
    SCOPED_TRACE(k);
    expectPose(*start, truth, stand, points);
  }
}

/// Grey with one mark, the same everywhere, around each centre [texels].
cv::Mat marks(const std::vector<cv::Point>& centers) {
  cv::Mat albedo(450, 600, CV_32FC1, cv::Scalar(0.5));
  for (const cv::Point& c : centers) {
    cv::rectangle(albedo, cv::Rect(c.x - 8, c.y - 8, 8, 8), cv::Scalar(0.05), cv::FILLED);
    cv::rectangle(albedo, cv::Rect(c.x, c.y, 8, 8), cv::Scalar(0.95), cv::FILLED);
    cv::rectangle(albedo, cv::Rect(c.x, c.y - 8, 8, 4), cv::Scalar(0.9), cv::FILLED);
  }
  return albedo;
}

TEST(KnownStart, TakesTheCombinationThatOneCameraExplains) {
  // Every mark has a double some 8 pixels away, each to another side.
  const cv::Point centers[] = {{160, 110}, {440, 115}, {435, 340}, {155, 335}};
  const cv::Point doubles[] = {{30, 0}, {0, 32}, {28, 4}, {-3, -30}};
  std::vector<cv::Point> all;
  for (int i = 0; i < 4; ++i) {
    all.push_back(centers[i]);
    all.push_back(centers[i] + doubles[i]);
  }
  const Stand stand({makeBoard(0.0, kDistance, 1.2, 0.9, marks(all))});
  const Stand alone({makeBoard(0.0, kDistance, 1.2, 0.9,
                               marks({centers[0], centers[1], centers[2], centers[3]}))});
  const cv::Mat first_view = alone.imageFrom(Isometry3d::Identity());
  std::vector<KnownPoint> points;
  for (const cv::Point& c : centers) {
    const Vector3d place(c.x / kTexelsPerM - 0.6, c.y / kTexelsPerM - 0.45, kDistance);
    const Vector2d pixel = *stand.camera.project(place);
    points.push_back(stand.pointAt(first_view, static_cast<int>(std::lround(pixel.x())),
                                   static_cast<int>(std::lround(pixel.y()))));
    points.back().template_image =
        points.back().template_image(cv::Rect(3, 3, 9, 9)).clone();  // without the double
  }
  for (int k = 0; k < 6; ++k) {
    const Isometry3d truth = displaced(k);
    std::string reason;
    const auto start = find(stand.imageFrom(truth, 30 + k), stand, points, &reason);
    ASSERT_TRUE(start) << "view " << k << ": " << reason;
    SCOPED_TRACE(k);
    EXPECT_LT((start->T_world_camera.translation() - truth.translation()).norm(), 0.02 * kDistance);
    for (int i = 0; i < 4; ++i)
      EXPECT_LT(
          (start->pixels[i] - *stand.camera.project(truth.inverse() * points[i].position_m)).norm(),
          2.0)
          << "point " << i;
  }
}

TEST(KnownStart, NamesThePointThatIsMissing) {
  const Stand stand = speckledStand();
  const auto points = fourPoints(stand, stand.imageFrom(Isometry3d::Identity()));
  for (int missing = 0; missing < 4; ++missing) {
    cv::Mat image = stand.imageFrom(displaced(1));
    const cv::Point center(static_cast<int>(points[missing].image_px.x()),
                           static_cast<int>(points[missing].image_px.y()));
    cv::circle(image, center, 40, cv::Scalar(128), cv::FILLED);
    std::string reason;
    EXPECT_FALSE(find(image, stand, points, &reason));
    EXPECT_NE(reason.find("known point " + std::to_string(missing)), std::string::npos) << reason;
  }
}

TEST(KnownStart, DoesNotLookFurtherThanTold) {
  const Stand stand = speckledStand();
  auto points = fourPoints(stand, stand.imageFrom(Isometry3d::Identity()));
  for (KnownPoint& point : points) point.image_px.x() += 12.0;
  const cv::Mat image = stand.imageFrom(Isometry3d::Identity(), 2);
  std::string reason;
  EXPECT_TRUE(find(image, stand, points, &reason, 20.0)) << reason;
  EXPECT_FALSE(find(image, stand, points, &reason, 5.0));
  EXPECT_NE(reason.find("5 px"), std::string::npos) << reason;
}

TEST(KnownStart, RefusesPlacesThatNoCameraExplains) {
  const Stand stand = speckledStand();
  auto points = fourPoints(stand, stand.imageFrom(Isometry3d::Identity()));
  std::swap(points[0].position_m, points[1].position_m);  // a twisted quadrangle
  std::string reason;
  EXPECT_FALSE(find(stand.imageFrom(displaced(2)), stand, points, &reason));
  EXPECT_NE(reason.find("no camera explains"), std::string::npos) << reason;
}

TEST(KnownStart, DoesNotThrowOnPointsOfALine) {
  const Stand stand = speckledStand();
  const cv::Mat first_view = stand.imageFrom(Isometry3d::Identity());
  std::vector<KnownPoint> points;
  for (int i = 0; i < 4; ++i) points.push_back(stand.pointAt(first_view, 60 + 60 * i, 120));
  std::string reason;
  EXPECT_NO_THROW({
    const auto start = find(first_view, stand, points, &reason);
    if (start) {
      EXPECT_TRUE(start->T_world_camera.matrix().allFinite());
    }
  });
  for (KnownPoint& point : points) point.position_m = Vector3d(0, 0, 1);
  EXPECT_NO_THROW(EXPECT_FALSE(find(first_view, stand, points, &reason)));
}

/// A dark rectangle on a light wall: four corners that need no templates.
TEST(KnownStart, FindsTheCameraFromPlainCorners) {
  cv::Mat albedo(450, 600, CV_32FC1, cv::Scalar(0.8));
  cv::rectangle(albedo, cv::Rect(150, 100, 300, 240), cv::Scalar(0.05), cv::FILLED);
  const Stand stand({makeBoard(0.0, kDistance, 1.2, 0.9, albedo)});
  std::vector<KnownPoint> points(4);
  const int corners[4][2] = {{150, 100}, {450, 100}, {450, 340}, {150, 340}};
  for (int i = 0; i < 4; ++i) {
    points[i].position_m =
        Vector3d(corners[i][0] / kTexelsPerM - 0.6, corners[i][1] / kTexelsPerM - 0.45, kDistance);
    points[i].image_px = *stand.camera.project(points[i].position_m);
  }
  for (int k = 0; k < 6; ++k) {
    const Isometry3d truth = displaced(k);
    std::string reason;
    const auto start = find(stand.imageFrom(truth, 40 + k), stand, points, &reason);
    ASSERT_TRUE(start) << "view " << k << ": " << reason;
    SCOPED_TRACE(k);
    expectPose(*start, truth, stand, points);
  }
  points[1].image_px = Vector2d(318, 4);
  std::string reason;
  EXPECT_FALSE(find(stand.imageFrom(Isometry3d::Identity()), stand, points, &reason));
  EXPECT_NE(reason.find("known point 1"), std::string::npos) << reason;
}

TEST(KnownStart, CopesWithAnyTemplateAndImage) {
  const Stand stand = speckledStand();
  const auto good = fourPoints(stand, stand.imageFrom(Isometry3d::Identity()));
  const cv::Mat image = stand.imageFrom(displaced(3));
  std::string reason;
  for (const cv::Mat& odd :
       {cv::Mat(cv::Mat::zeros(11, 11, CV_8UC1)), cv::Mat(cv::Mat::zeros(10, 11, CV_8UC1)),
        cv::Mat(cv::Mat::ones(41, 41, CV_8UC1))}) {
    auto points = good;
    points[2].template_image = odd;
    EXPECT_NO_THROW(EXPECT_FALSE(find(image, stand, points, &reason)));
    EXPECT_NE(reason.find("known point 2"), std::string::npos) << reason;
  }
  auto points = good;
  points[3].image_px = Vector2d(5000.0, -300.0);
  EXPECT_NO_THROW(EXPECT_FALSE(find(image, stand, points, &reason)));
  EXPECT_NE(reason.find("known point 3"), std::string::npos) << reason;
  EXPECT_NO_THROW(EXPECT_FALSE(find(cv::Mat::zeros(240, 320, CV_8UC1), stand, good, &reason)));
}

}  // namespace
}  // namespace active_matching_slam
