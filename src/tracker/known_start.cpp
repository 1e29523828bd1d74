#include "active_matching_slam/tracker/known_start.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/image/image_feature_search.h"

namespace active_matching_slam {
namespace {

/// Root mean square residual of a camera that explains the points. Cost: responses within a
/// corner's localisation error pass; beyond it a wrong combination would start a wrong scale.
constexpr double kMaximumReprojectionPx = 2.0;
constexpr std::size_t kMaximumCombinations = 4096;  ///< Cost: each takes a pose by PnP

struct Response {
  Eigen::Vector2d pixel;
  double score;
};

/// Responses of a point, best first, at most `limit`.
std::vector<Response> templateResponses(const cv::Mat& image, const KnownPoint& point,
                                        double search_px, ImageOptions options, std::size_t limit) {
  const auto patch = makeTemplate(point.template_image);
  if (!patch) return {};
  // A stored template comes from another exposure, or another camera: let it score lower.
  options.match_threshold = std::min(options.match_threshold, 0.6);
  options.template_size_px = patch->size;
  ImageFeatureSearch search(options);
  search.beginFrame(image, {*patch});
  const double sigma_px = search_px / 3.0;
  const SearchOutcome outcome =
      search.search(0, {point.image_px, sigma_px * sigma_px * Eigen::Matrix2d::Identity()});
  std::vector<Response> responses;
  for (int m : outcome.matches)
    responses.push_back({search.matches(0)[m].pixel, search.matches(0)[m].score});
  std::stable_sort(responses.begin(), responses.end(),
                   [](const Response& a, const Response& b) { return a.score > b.score; });
  if (responses.size() > limit) responses.resize(limit);
  return responses;
}

/// Corners around the place where a point is expected, nearest first, at most `limit`.
std::vector<Response> cornerResponses(const cv::Mat& image, const KnownPoint& point,
                                      double search_px, double minimum_contrast,
                                      std::size_t limit) {
  const int reach = static_cast<int>(std::ceil(search_px)) + 3;
  const Eigen::Vector2d corner_of_roi = point.image_px.array().floor() - reach;
  if (corner_of_roi.cwiseAbs().maxCoeff() > 1e6) return {};
  const cv::Rect roi = cv::Rect(static_cast<int>(corner_of_roi.x()),
                                static_cast<int>(corner_of_roi.y()), 2 * reach + 1, 2 * reach + 1) &
                       cv::Rect(0, 0, image.cols, image.rows);
  if (roi.width < 9 || roi.height < 9) return {};
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(image(roi), corners, static_cast<int>(limit), 0.2, 3.0);
  if (corners.empty()) return {};
  for (cv::Point2f& corner : corners) corner += cv::Point2f(roi.tl());
  cv::cornerSubPix(image, corners, cv::Size(3, 3), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 40, 0.01));
  std::vector<Response> responses;
  for (const cv::Point2f& corner : corners) {
    const Eigen::Vector2d pixel(corner.x, corner.y);
    const double distance = (pixel - point.image_px).norm();
    const cv::Rect around =
        cv::Rect(static_cast<int>(corner.x) - 5, static_cast<int>(corner.y) - 5, 11, 11) &
        cv::Rect(0, 0, image.cols, image.rows);
    cv::Scalar mean, deviation;
    cv::meanStdDev(image(around), mean, deviation);
    if (deviation[0] < minimum_contrast) continue;  // a corner of noise
    // The nearer, the better, but geometry decides.
    if (distance <= search_px) responses.push_back({pixel, 1.0 - 0.1 * distance / search_px});
  }
  std::stable_sort(responses.begin(), responses.end(),
                   [](const Response& a, const Response& b) { return a.score > b.score; });
  return responses;
}

double reprojectionRms(const CameraModel& camera, const Eigen::Isometry3d& T_world_camera,
                       const std::vector<KnownPoint>& points,
                       const std::vector<Eigen::Vector2d>& pixels) {
  double sum = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto pixel = camera.project(T_world_camera.inverse() * points[i].position_m);
    if (!pixel) return std::numeric_limits<double>::infinity();
    sum += (*pixel - pixels[i]).squaredNorm();
  }
  return std::sqrt(sum / static_cast<double>(points.size()));
}

bool areCoplanar(const std::vector<KnownPoint>& points) {
  Eigen::MatrixXd offsets(3, points.size());
  for (std::size_t i = 0; i < points.size(); ++i)
    offsets.col(i) = points[i].position_m - points[0].position_m;
  const Eigen::Matrix3d covariance = offsets * offsets.transpose();
  const Eigen::Vector3d spread =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(covariance, Eigen::EigenvaluesOnly)
          .eigenvalues();
  return spread(0) < 1e-6 * spread(2);
}

/// Best camera for one combination of responses; infinite rms when there is none.
KnownStart solve(const CameraModel& camera, const std::vector<KnownPoint>& points,
                 const std::vector<Eigen::Vector2d>& pixels) {
  KnownStart best;
  best.pixels = pixels;
  best.reprojection_rms_px = std::numeric_limits<double>::infinity();
  std::vector<cv::Point3d> object;
  std::vector<cv::Point2d> normalised;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto bearing = camera.unproject(pixels[i]);
    if (!bearing || bearing->z() <= 1e-3) return best;
    object.emplace_back(points[i].position_m.x(), points[i].position_m.y(),
                        points[i].position_m.z());
    normalised.emplace_back(bearing->x() / bearing->z(), bearing->y() / bearing->z());
  }
  std::vector<cv::Mat> rotations, translations;
  try {
    cv::solvePnPGeneric(object, normalised, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), rotations,
                        translations, false,
                        areCoplanar(points) ? cv::SOLVEPNP_IPPE : cv::SOLVEPNP_EPNP);
    for (std::size_t i = 0; i < rotations.size(); ++i)
      cv::solvePnPRefineLM(object, normalised, cv::Mat::eye(3, 3, CV_64F), cv::noArray(),
                           rotations[i], translations[i]);
  } catch (const cv::Exception&) {
    return best;  // a degenerate combination, such as points on a line
  }
  for (std::size_t i = 0; i < rotations.size(); ++i) {
    cv::Mat rotation;
    cv::Rodrigues(rotations[i], rotation);
    Eigen::Isometry3d T_camera_world = Eigen::Isometry3d::Identity();
    for (int r = 0; r < 3; ++r) {
      for (int c = 0; c < 3; ++c) T_camera_world.linear()(r, c) = rotation.at<double>(r, c);
      T_camera_world.translation()(r) = translations[i].at<double>(r);
    }
    if (!T_camera_world.matrix().allFinite()) continue;
    const double rms = reprojectionRms(camera, T_camera_world.inverse(), points, pixels);
    if (rms < best.reprojection_rms_px) {
      best.reprojection_rms_px = rms;
      best.T_world_camera = T_camera_world.inverse();
    }
  }
  return best;
}

}  // namespace

std::optional<KnownStart> findKnownStart(const cv::Mat& image, const CameraModel& camera,
                                         const std::vector<KnownPoint>& points, double search_px,
                                         const ImageOptions& options, std::string* reason) {
  std::vector<std::vector<Response>> responses;
  // As many responses a point as keep the number of combinations within bounds.
  const auto limit = static_cast<std::size_t>(std::max(
      1.0, std::floor(std::pow(double(kMaximumCombinations), 1.0 / double(points.size())))));
  for (const KnownPoint& point : points) {
    responses.push_back(
        point.template_image.empty()
            ? cornerResponses(image, point, search_px, options.minimum_contrast, limit)
            : templateResponses(image, point, search_px, options, limit));
    if (responses.back().empty()) {
      *reason = "known point " + std::to_string(responses.size() - 1) + " was not found within " +
                std::to_string(static_cast<int>(search_px)) + " px of its image_px";
      return std::nullopt;
    }
  }

  std::vector<std::size_t> choice(points.size(), 0);
  std::optional<KnownStart> best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (bool more = true; more;) {
    std::vector<Eigen::Vector2d> pixels;
    double cost = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      pixels.push_back(responses[i][choice[i]].pixel);
      cost += 1.0 - responses[i][choice[i]].score;
    }
    const KnownStart start = solve(camera, points, pixels);
    // A pixel of residual weighs as much as half the range of one score.
    cost += start.reprojection_rms_px;
    if (cost < best_cost) {
      best_cost = cost;
      best = start;
    }
    more = false;  // the next combination, as a counter with one digit a point
    for (std::size_t i = 0; i < points.size() && !more; ++i) {
      if (++choice[i] < responses[i].size())
        more = true;
      else
        choice[i] = 0;
    }
  }
  if (!best || best->reprojection_rms_px > kMaximumReprojectionPx) {
    *reason = "the known points were found, but no camera explains them within 2 px";
    return std::nullopt;
  }
  return best;
}

}  // namespace active_matching_slam
