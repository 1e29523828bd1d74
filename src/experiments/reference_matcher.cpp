#include "reference_matcher.h"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include "active_matching_slam/image/subpixel.h"
#include "active_matching_slam/math/rotation.h"
#include "recording.h"

namespace active_matching_slam {
namespace {

constexpr int kMinimumInliers = 6;
constexpr int kWindowPx = 4;          ///< around the projection
constexpr double kLeastScore = 0.75;  ///< of a match that counts as sure

}  // namespace

std::optional<PnpPose> solvePnp(const CameraModel& camera,
                                const std::vector<Eigen::Vector3d>& points_world,
                                const std::vector<Eigen::Vector2d>& pixels, double inlier_px) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> ideal;
  std::vector<int> index;
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const auto bearing = camera.unproject(pixels[i]);
    if (!bearing || bearing->z() <= 0.1 || !points_world[i].allFinite()) continue;
    points.emplace_back(points_world[i].x(), points_world[i].y(), points_world[i].z());
    ideal.emplace_back(bearing->x() / bearing->z(), bearing->y() / bearing->z());
    index.push_back(static_cast<int>(i));
  }
  if (static_cast<int>(points.size()) < kMinimumInliers) return std::nullopt;
  cv::Vec3d rotation, translation;
  std::vector<int> inliers;
  const cv::Mat identity = cv::Mat::eye(3, 3, CV_64F);
  constexpr int kIterations = 300;
  const auto threshold = static_cast<float>(inlier_px / camera.calibration().fx);
  try {
    if (!cv::solvePnPRansac(points, ideal, identity, cv::noArray(), rotation, translation, false,
                            kIterations, threshold, 0.999, inliers, cv::SOLVEPNP_P3P) ||
        static_cast<int>(inliers.size()) < kMinimumInliers)
      return std::nullopt;
    std::vector<cv::Point3d> inlier_points;
    std::vector<cv::Point2d> inlier_ideal;
    for (const int i : inliers) {
      inlier_points.push_back(points[static_cast<std::size_t>(i)]);
      inlier_ideal.push_back(ideal[static_cast<std::size_t>(i)]);
    }
    cv::solvePnPRefineLM(inlier_points, inlier_ideal, identity, cv::noArray(), rotation,
                         translation);
  } catch (const cv::Exception&) {  // degenerate points
    return std::nullopt;
  }
  Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
  T_camera_world.linear() =
      rotationFromVector({rotation[0], rotation[1], rotation[2]}).toRotationMatrix();
  T_camera_world.translation() << translation[0], translation[1], translation[2];
  if (!T_camera_world.matrix().allFinite()) return std::nullopt;
  PnpPose pose;
  pose.T_world_camera = T_camera_world.inverse();
  for (const int i : inliers) pose.inliers.push_back(index[static_cast<std::size_t>(i)]);
  return pose;
}

void ReferenceMatcher::observe(const TrackedFrame& frame, int image) {
  observed_[image] = last_;
  last_ = Observed();
  last_.image_before = image;
  for (const TrackedFeature& feature : frame.features) {
    if (feature.status == FeatureStatus::kMatched)
      last_.pixel_before[feature.id] = feature.matched_px;
    if (hasKnownDepth(feature)) position_[feature.id] = feature.position_world;
  }
}

std::optional<Eigen::Isometry3d> ReferenceMatcher::poseByFlow(const Observed& observed,
                                                              int image) const {
  if (observed.image_before < 0) return std::nullopt;
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Vector2d> pixels;
  for (const auto& [id, pixel] : observed.pixel_before) {
    const auto at = position_.find(id);
    if (at == position_.end()) continue;
    points.push_back(at->second);
    pixels.push_back(pixel);
  }
  const auto flow_between = cv::DISOpticalFlow::create(cv::DISOpticalFlow::PRESET_MEDIUM);
  cv::Mat flow;
  for (int i = observed.image_before; i < image; ++i) {  // image by image at the full rate
    flow_between->calc(sequence_.images[static_cast<std::size_t>(i)],
                       sequence_.images[static_cast<std::size_t>(i + 1)], flow);
    for (Eigen::Vector2d& pixel : pixels) {
      if (!sequence_.camera.isInImage(pixel)) continue;  // stays outside, an outlier
      const cv::Vec2f& step = flow.at<cv::Vec2f>(static_cast<int>(std::lround(pixel.y())),
                                                 static_cast<int>(std::lround(pixel.x())));
      pixel += Eigen::Vector2d(step[0], step[1]);
    }
  }
  const auto pose = solvePnp(sequence_.camera, points, pixels, 2.0);
  if (!pose) return std::nullopt;
  return pose->T_world_camera;
}

std::vector<Eigen::Vector2d> ReferenceMatcher::match(int image, const std::vector<FeatureId>& ids,
                                                     const std::vector<Template>& templates) const {
  std::vector<Eigen::Vector2d> places(ids.size(), unknownPixel());
  const auto observed = observed_.find(image);
  if (observed == observed_.end()) return places;
  const auto T_world_camera = poseByFlow(observed->second, image);
  if (!T_world_camera) return places;
  const cv::Mat& picture = sequence_.images[static_cast<std::size_t>(image)];
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto position = position_.find(ids[i]);
    if (position == position_.end()) continue;
    const auto pixel = sequence_.camera.project(T_world_camera->inverse() * position->second);
    const int reach = templates[i].size / 2 + kWindowPx;
    if (!pixel || !sequence_.camera.isInImage(*pixel, reach + 1)) continue;
    const int u = static_cast<int>(std::lround(pixel->x()));
    const int v = static_cast<int>(std::lround(pixel->y()));
    cv::Mat scores;
    cv::matchTemplate(picture(cv::Rect(u - reach, v - reach, 2 * reach + 1, 2 * reach + 1)),
                      templates[i].image(), scores, cv::TM_CCOEFF_NORMED);
    double best = 0.0;
    cv::Point peak;
    cv::minMaxLoc(scores, nullptr, &best, nullptr, &peak);
    const bool at_rim =
        peak.x == 0 || peak.y == 0 || peak.x == 2 * kWindowPx || peak.y == 2 * kWindowPx;
    if (best < kLeastScore || at_rim) continue;
    const Eigen::Vector2d whole(u - kWindowPx + peak.x, v - kWindowPx + peak.y);
    const auto fit = refineSubpixel(picture, templates[i], whole);
    places[i] = fit ? fit->pixel : whole;
  }
  return places;
}

}  // namespace active_matching_slam
