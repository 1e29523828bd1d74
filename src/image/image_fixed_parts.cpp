#include "active_matching_slam/image/image_fixed_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/feature_flow.h"

namespace active_matching_slam {
namespace {

/// Least time between two comparisons [s]. Cost: how soon it is known; one takes half a frame.
constexpr double kComparisonPeriodS = 0.2;
constexpr std::size_t kMostCorners =
    300;                           ///< Cost: one in each 32 x 32 pixels of a 640 x 480 image
constexpr double kSurely = 0.999;  ///< that a sample is met without outlier. Standard: OpenCV
/// Epipolar distance of a static point, in standard deviations of the flow. Standard: chi-square
/// with one degree of freedom, 95 % (Hartley and Zisserman 2004, table 4.2).
constexpr double kEpipolarSigmas = 1.96;
/// Inliers below which an essential matrix is not believed. Derivation: three times its minimum of
/// five, so that ten confirm it.
constexpr std::size_t kLeastInliers = 15;
/// Of the eigenvalues of a patch's structure tensor, from which on it is an edge. Standard: SIFT's
/// (Lowe 2004, section 4.1), of the principal curvatures.
constexpr double kEdgeRatio = 10.0;
/// Comparisons that must agree. Derivation: repeated texture deceives one, but not at two
/// distances.
constexpr int kAgreeing = 2;

/// Where the patch around a pixel has texture and looks the same in both images, by zero-mean
/// normalised cross-correlation: 255, else 0.
cv::Mat whatStays(const cv::Mat& first, const cv::Mat& second, const ImageOptions& options) {
  const auto mean = [&options](const cv::Mat& image) {
    cv::Mat smooth;
    cv::boxFilter(image, smooth, CV_32F, {options.template_size_px, options.template_size_px});
    return smooth;
  };
  cv::Mat a, b;
  first.convertTo(a, CV_32F);
  second.convertTo(b, CV_32F);
  const cv::Mat mean_a = mean(a), mean_b = mean(b);
  const cv::Mat variance_a = mean(a.mul(a)) - mean_a.mul(mean_a);
  const cv::Mat variance_b = mean(b.mul(b)) - mean_b.mul(mean_b);
  const cv::Mat covariance = mean(a.mul(b)) - mean_a.mul(mean_b);
  const double least = options.minimum_contrast * options.minimum_contrast;
  const double score = options.match_threshold;
  return (variance_a >= least) & (variance_b >= least) & (covariance > 0.0) &
         (covariance.mul(covariance) >= score * score * variance_a.mul(variance_b));
}

/// Whether a patch is found at its own pixel rather than beside it: one that is not sharp looks the
/// same a pixel away.
bool isBestWhereItWas(const cv::Mat& first, const cv::Mat& second, const Eigen::Vector2d& pixel,
                      const ImageOptions& options) {
  const int size = options.template_size_px;
  const cv::Rect window(static_cast<int>(pixel.x()) - size / 2,
                        static_cast<int>(pixel.y()) - size / 2, size, size);
  const cv::Rect around(window.x - 1, window.y - 1, size + 2, size + 2);
  if ((around & cv::Rect({}, first.size())) != around) return false;
  cv::Mat scores;
  cv::matchTemplate(second(around), first(window), scores, cv::TM_CCOEFF_NORMED);
  cv::Point best;
  cv::minMaxLoc(scores, nullptr, nullptr, nullptr, &best);
  return best == cv::Point(1, 1);
}

/// Whether a patch, which lies in the image, looks the same when it moves along some line.
bool isEdge(const cv::Mat& image, const Eigen::Vector2d& pixel, int size) {
  cv::Mat eigen;
  const cv::Rect window(static_cast<int>(pixel.x()) - size / 2,
                        static_cast<int>(pixel.y()) - size / 2, size, size);
  cv::cornerEigenValsAndVecs(image(window), eigen, size, 3);
  const auto& middle = eigen.at<cv::Vec6f>(size / 2, size / 2);
  return middle[1] * kEdgeRatio < middle[0];
}

cv::Point2d idealOf(const CameraModel& camera, const Eigen::Vector2d& pixel) {
  const auto ray = camera.unproject(pixel);
  if (!ray || !(ray->z() > 0.0)) return {NAN, NAN};
  return {ray->x() / ray->z(), ray->y() / ray->z()};
}

/// Sampson distance of `from` in one image and `to` in the other (Hartley and Zisserman 2004, eq.
/// 11.9).
double epipolarDistance(const cv::Matx33d& E, const cv::Point2d& from, const cv::Point2d& to) {
  const cv::Vec3d x(from.x, from.y, 1.0), y(to.x, to.y, 1.0), line = E * x, back = E.t() * y;
  return std::abs(y.dot(line)) /
         std::sqrt(line[0] * line[0] + line[1] * line[1] + back[0] * back[0] + back[1] * back[1]);
}

/// By what most points say that were found in the second image; empty where they do not agree.
/// `limit`: of the epipolar distance of an inlier.
std::optional<cv::Matx33d> essentialMatrix(
    const CameraModel& camera, const std::vector<std::optional<Eigen::Vector2d>>& from_px,
    const std::vector<std::optional<Eigen::Vector2d>>& to_px, double limit) {
  std::vector<cv::Point2d> from, to;
  for (std::size_t i = 0; i < from_px.size(); ++i) {
    if (!to_px[i]) continue;
    const cv::Point2d a = idealOf(camera, *from_px[i]), b = idealOf(camera, *to_px[i]);
    if (!std::isfinite(a.x) || !std::isfinite(b.x)) continue;
    from.push_back(a);
    to.push_back(b);
  }
  if (from.size() < kLeastInliers) return std::nullopt;
  // Half of them may be wrong, and the bound of an inlier is far beyond the noise of most: the
  // least median of squares (Rousseeuw 1984) asks for no more, and fits better than counting
  // inliers.
  const cv::Mat found =
      cv::findEssentialMat(from, to, 1.0, cv::Point2d(0.0, 0.0), cv::LMEDS, kSurely, limit);
  if (found.rows != 3) return std::nullopt;
  const cv::Matx33d E(found.ptr<double>());
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < from.size(); ++i)
    if (epipolarDistance(E, from[i], to[i]) <= limit) ++inliers;
  if (inliers < kLeastInliers || 2 * inliers < from.size()) return std::nullopt;
  return E;
}

}  // namespace

double ImageFixedParts::share() const {
  return fixed_.empty()
             ? 0.0
             : static_cast<double>(cv::countNonZero(fixed_)) / static_cast<double>(fixed_.total());
}

bool ImageFixedParts::contains(const Eigen::Vector2d& pixel) const {
  const cv::Point place(static_cast<int>(std::lround(pixel.x())),
                        static_cast<int>(std::lround(pixel.y())));
  return cv::Rect({}, fixed_.size()).contains(place) && fixed_.at<uchar>(place) != 0;
}

cv::Mat ImageFixedParts::sceneCentres(const cv::Mat& centres, const ImageOptions& options) const {
  if (fixed_.empty()) return centres;
  cv::Mat touching, scene;
  cv::dilate(fixed_, touching,
             cv::Mat::ones(options.template_size_px, options.template_size_px, CV_8U));
  cv::bitwise_not(touching, scene);
  if (!centres.empty()) cv::bitwise_and(scene, centres, scene);
  return scene;
}

/// Makes an image the reference.
void ImageFixedParts::take(const cv::Mat& image, const std::vector<Eigen::Vector2d>& features,
                           const ImageOptions& options, const cv::Mat& centres) {
  reference_ = image;
  corners_px_.clear();
  for (const Suspect& suspect : suspects_) corners_px_.push_back(suspect.pixel);
  for (const Eigen::Vector2d& pixel : features) corners_px_.emplace_back(pixel.array().round());
  first_spread_ = corners_px_.size();
  // Weak corners too: what is burnt in is often stronger than all of the scene.
  ImageOptions any = options;
  any.corner_quality = 0.0;
  for (const Corner& corner : detectCorners(image, {}, static_cast<int>(kMostCorners),
                                            options.template_size_px, any, centres))
    if (!isEdge(image, corner.pixel, options.template_size_px)) corners_px_.push_back(corner.pixel);
}

bool ImageFixedParts::add(const CameraModel& camera, const cv::Mat& image, double stamp_s,
                          const std::vector<Eigen::Vector2d>& features, const ImageOptions& options,
                          const cv::Mat& centres) {
  if (reference_.empty() || reference_.size() != image.size()) {
    last_stamp_s_ = stamp_s;
    take(image, features, options, centres);
    return false;
  }
  if (stamp_s - last_stamp_s_ < kComparisonPeriodS) return false;
  last_stamp_s_ = stamp_s;
  const std::size_t n = corners_px_.size();
  std::vector<bool> is_moved(n), is_fixed(n, false);
  const cv::Mat stays = whatStays(reference_, image, options);
  for (std::size_t i = 0; i < n; ++i)
    is_moved[i] = stays.at<uchar>(static_cast<int>(corners_px_[i].y()),
                                  static_cast<int>(corners_px_[i].x())) == 0;
  const auto spread = is_moved.begin() + static_cast<std::ptrdiff_t>(first_spread_);
  if (std::count(spread, is_moved.end(), true) <= std::count(spread, is_moved.end(), false))
    return false;

  std::vector<std::optional<Eigen::Vector2d>> moved_px(n);
  for (std::size_t i = 0; i < n; ++i)
    if (is_moved[i]) moved_px[i] = corners_px_[i];
  const double limit = kEpipolarSigmas * flowSigma_px(image.cols) / camera.calibration().fx;
  const auto E = essentialMatrix(camera, moved_px, trackPoints(reference_, image, moved_px), limit);
  for (std::size_t i = 0; E && i < n; ++i) {
    if (is_moved[i] || !isBestWhereItWas(reference_, image, corners_px_[i], options)) continue;
    const cv::Point2d ideal = idealOf(camera, corners_px_[i]);
    is_fixed[i] = epipolarDistance(*E, ideal, ideal) > limit;
  }
  judge(is_moved, is_fixed, options);
  grow(stays);
  take(image, features, options, centres);
  return true;
}

/// Adds to the record of each suspect what became of it, and new ones.
void ImageFixedParts::judge(const std::vector<bool>& is_moved, const std::vector<bool>& is_fixed,
                            const ImageOptions& options) {
  const std::size_t known = suspects_.size();  // the first of the corners
  for (std::size_t i = 0; i < corners_px_.size(); ++i) {
    if (i < known) {
      suspects_[i].fixed += is_fixed[i];
      suspects_[i].moved += is_moved[i];
      continue;
    }
    const bool is_near = std::any_of(suspects_.begin(), suspects_.end(), [&](const Suspect& s) {
      return (s.pixel - corners_px_[i]).cwiseAbs().maxCoeff() <= 0.5 * options.template_size_px;
    });
    if (is_fixed[i] && !is_near) suspects_.push_back({corners_px_[i]});
  }
  suspects_.erase(std::remove_if(suspects_.begin(), suspects_.end(),
                                 [](const Suspect& s) { return s.moved >= s.fixed; }),
                  suspects_.end());
}

/// The parts that stayed around an agreed suspect, and no farther from it than the next corner
/// would be: where little has moved yet, some of the scene hangs together with it.
void ImageFixedParts::grow(const cv::Mat& stays) {
  fixed_.release();
  std::vector<cv::Point> seeds;
  for (const Suspect& suspect : suspects_)
    if (suspect.fixed >= kAgreeing)
      seeds.emplace_back(static_cast<int>(suspect.pixel.x()), static_cast<int>(suspect.pixel.y()));
  if (seeds.empty()) return;
  const int reach_px = static_cast<int>(std::lround(std::sqrt(stays.total() / kMostCorners)));
  cv::Mat near = cv::Mat::zeros(stays.size(), CV_8U), part;
  for (const cv::Point& seed : seeds)
    cv::rectangle(near, seed - cv::Point(reach_px, reach_px), seed + cv::Point(reach_px, reach_px),
                  255, cv::FILLED);
  const int parts = cv::connectedComponents(stays, part);
  std::vector<uchar> is_fixed(static_cast<std::size_t>(parts), 0);
  for (const cv::Point& seed : seeds) is_fixed[static_cast<std::size_t>(part.at<int>(seed))] = 255;
  is_fixed[0] = 0;  // what does not stay
  fixed_.create(stays.size(), CV_8U);
  for (int v = 0; v < stays.rows; ++v)
    for (int u = 0; u < stays.cols; ++u)
      fixed_.at<uchar>(v, u) = is_fixed[static_cast<std::size_t>(part.at<int>(v, u))];
  cv::bitwise_and(fixed_, near, fixed_);
}

}  // namespace active_matching_slam
