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
constexpr int kMostCorners = 300;  ///< Cost: one in each 32 x 32 pixels of a 640 x 480 image
constexpr double kMajority = 0.5;  ///< Derivation: by definition, most of the picture
constexpr double kSurely = 0.999;  ///< that RANSAC meets a sample without outlier. Standard: OpenCV
/// Epipolar distance of a static point, in standard deviations of the flow. Standard: chi-square
/// with one degree of freedom, 95 % (Hartley and Zisserman 2004, table 4.2).
constexpr double kEpipolarSigmas = 1.96;
/// Inliers below which an essential matrix is not believed. Derivation: three times its minimum of
/// five, so that ten confirm it.
constexpr int kLeastInliers = 15;
/// Of the eigenvalues of a patch's structure tensor, from which on it is an edge. Standard: SIFT's
/// (Lowe 2004, section 4.1), of the principal curvatures.
constexpr float kEdgeRatio = 10.0F;
/// Comparisons that must agree. Derivation: repeated texture deceives one, but not at two
/// distances.
constexpr int kAgreeing = 2;

/// Zero-mean normalised cross-correlation of the patches of two images around one pixel; 0 where
/// there is none.
double correlationAt(const cv::Mat& a, const cv::Mat& b, const Eigen::Vector2d& pixel, int size,
                     double minimum_contrast) {
  const cv::Rect window(static_cast<int>(pixel.x()) - size / 2,
                        static_cast<int>(pixel.y()) - size / 2, size, size);
  if ((window & cv::Rect(0, 0, a.cols, a.rows)) != window) return 0.0;
  cv::Scalar mean, deviation;
  for (const cv::Mat* image : {&a, &b}) {
    cv::meanStdDev((*image)(window), mean, deviation);
    if (deviation[0] < minimum_contrast) return 0.0;
  }
  cv::Mat score;
  cv::matchTemplate(a(window), b(window), score, cv::TM_CCOEFF_NORMED);
  return score.at<float>(0, 0);
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

/// Sampson distance of a point that is at `x` in both images (Hartley and Zisserman 2004,
/// eq. 11.9).
double epipolarDistance(const cv::Matx33d& E, const cv::Point2d& x) {
  const cv::Vec3d point(x.x, x.y, 1.0), line = E * point, back = E.t() * point;
  return std::abs(point.dot(line)) /
         std::sqrt(line[0] * line[0] + line[1] * line[1] + back[0] * back[0] + back[1] * back[1]);
}

}  // namespace

bool ImageFixedParts::contains(const Eigen::Vector2d& pixel, const ImageOptions& options) const {
  const double reach_px = 0.5 * options.template_size_px;
  return std::any_of(fixed_px_.begin(), fixed_px_.end(), [&](const Eigen::Vector2d& fixed) {
    return (fixed - pixel).cwiseAbs().maxCoeff() <= reach_px;
  });
}

/// Makes an image the reference.
void ImageFixedParts::take(const cv::Mat& image, const std::vector<Eigen::Vector2d>& features,
                           const ImageOptions& options, const cv::Mat& centres) {
  reference_ = image;
  corners_px_.clear();
  for (const Suspect& suspect : suspects_) corners_px_.push_back(suspect.pixel);
  for (const Eigen::Vector2d& pixel : features) corners_px_.emplace_back(pixel.array().round());
  // Weak corners too: what is burnt in is often stronger than all of the scene.
  ImageOptions any = options;
  any.corner_quality = 0.0;
  for (const Corner& corner :
       detectCorners(image, corners_px_, kMostCorners, options.template_size_px, any, centres))
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
  std::vector<bool> is_moved(n);
  for (std::size_t i = 0; i < n; ++i)
    is_moved[i] = correlationAt(reference_, image, corners_px_[i], options.template_size_px,
                                options.minimum_contrast) < options.match_threshold;
  const auto moved = std::count(is_moved.begin(), is_moved.end(), true);
  if (static_cast<double>(moved) < kMajority * static_cast<double>(n)) return false;

  std::vector<std::optional<Eigen::Vector2d>> from_px(n);
  for (std::size_t i = 0; i < n; ++i)
    if (is_moved[i]) from_px[i] = corners_px_[i];
  const auto to_px = trackPoints(reference_, image, from_px);
  std::vector<cv::Point2d> from, to;
  for (std::size_t i = 0; i < n; ++i) {
    if (!to_px[i]) continue;
    const cv::Point2d a = idealOf(camera, *from_px[i]), b = idealOf(camera, *to_px[i]);
    if (!std::isfinite(a.x) || !std::isfinite(b.x)) continue;
    from.push_back(a);
    to.push_back(b);
  }
  const double limit = kEpipolarSigmas * flowSigma_px(image.cols) / camera.calibration().fx;
  std::vector<bool> is_fixed(n, false);
  if (static_cast<int>(from.size()) >= kLeastInliers) {
    std::vector<uchar> inliers;
    const cv::Mat found = cv::findEssentialMat(from, to, 1.0, cv::Point2d(0.0, 0.0), cv::RANSAC,
                                               kSurely, limit, inliers);
    const int agreeing = cv::countNonZero(inliers);
    if (found.rows == 3 && agreeing >= kLeastInliers &&
        agreeing >= kMajority * static_cast<double>(from.size())) {
      const cv::Matx33d E(found.ptr<double>());
      for (std::size_t i = 0; i < n; ++i)
        is_fixed[i] = !is_moved[i] && epipolarDistance(E, idealOf(camera, corners_px_[i])) > limit;
    }
  }
  if (getenv("DBG")) fprintf(stderr, "t %.2f n %zu moved %ld tracked %zu fixed %ld suspects %zu known %zu\n", stamp_s, n, (long)moved, from.size(), (long)std::count(is_fixed.begin(), is_fixed.end(), true), suspects_.size(), fixed_px_.size());
  judge(is_moved, is_fixed, options);
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
  fixed_px_.clear();
  for (const Suspect& suspect : suspects_)
    if (suspect.fixed >= kAgreeing) fixed_px_.push_back(suspect.pixel);
}

}  // namespace active_matching_slam
