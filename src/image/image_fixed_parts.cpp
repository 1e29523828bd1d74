#include "active_matching_slam/image/image_fixed_parts.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <set>

#include "active_matching_slam/image/corners.h"
#include "active_matching_slam/image/feature_flow.h"

namespace active_matching_slam {
namespace {

/// Least time between two comparisons [s]. Cost: how soon it is known; one is spread over ten
/// images.
constexpr double kComparisonPeriodS = 0.2;
/// Cost: one in each 32 x 32 pixels of a 640 x 480 image.
constexpr std::size_t kMostCorners = 300;
constexpr std::size_t kMinimalPoints = 5;  ///< Standard: of an essential matrix (Nister 2004)
/// Samples of as many points. Derivation: where half of the matches are wrong, one is without a
/// wrong one with 95 %: log 0.05 / log(1 - 0.5^5).
constexpr int kSamples = 96;
constexpr int kSamplesPerImage = 12;  ///< Cost: half a millisecond each
/// Epipolar distance of a static point, in standard deviations of the flow. Standard: chi-square
/// with one degree of freedom, 95 % (Hartley and Zisserman 2004, table 4.2).
constexpr double kEpipolarSigmas = 1.96;
/// Inliers below which an essential matrix is not taken. Derivation: three times its minimum of
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

/// Of a patch around a whole pixel.
cv::Rect windowAround(const Eigen::Vector2d& pixel, int size) {
  return {static_cast<int>(pixel.x()) - size / 2, static_cast<int>(pixel.y()) - size / 2, size,
          size};
}

/// Whether a patch is found at its own pixel rather than beside it: one that is not sharp looks the
/// same a pixel away.
bool isBestWhereItWas(const cv::Mat& first, const cv::Mat& second, const Eigen::Vector2d& pixel,
                      const ImageOptions& options) {
  const int size = options.template_size_px;
  const cv::Rect window = windowAround(pixel, size), around = windowAround(pixel, size + 2);
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
  cv::cornerEigenValsAndVecs(image(windowAround(pixel, size)), eigen, size, 3);
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

}  // namespace

bool ImageFixedParts::contains(const Eigen::Vector2d& pixel) const {
  const cv::Point place(static_cast<int>(std::lround(pixel.x())),
                        static_cast<int>(std::lround(pixel.y())));
  return cv::Rect({}, fixed_.size()).contains(place) && fixed_.at<uchar>(place) != 0;
}

cv::Mat ImageFixedParts::sceneCentres(const cv::Mat& centres) const {
  if (scene_centres_.empty()) return centres;
  if (centres.empty()) return scene_centres_;
  return scene_centres_ & centres;
}

/// Makes an image the reference.
void ImageFixedParts::take(const cv::Mat& image, const std::vector<Eigen::Vector2d>& features,
                           const ImageOptions& options, const cv::Mat& centres) {
  reference_ = image.clone();  // its memory may be used again
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
  if (reference_.size() != image.size()) step_ = Step::kTake;
  switch (step_) {
    case Step::kTake:
      last_stamp_s_ = stamp_s;
      take(image, features, options, centres);
      step_ = Step::kCompare;
      break;
    case Step::kCompare:
      if (stamp_s - last_stamp_s_ < kComparisonPeriodS) break;
      last_stamp_s_ = stamp_s;
      if (compare(image, options)) step_ = Step::kTrack;
      break;
    case Step::kTrack:
      track(camera);
      step_ = Step::kFit;
      break;
    case Step::kFit:
      fitMotion(kSamplesPerImage);
      if (samples_ < kSamples) break;
      judge(camera, options);
      step_ = Step::kTake;
      return true;
  }
  return false;
}

/// Whether most of the picture has moved since the reference.
bool ImageFixedParts::compare(const cv::Mat& image, const ImageOptions& options) {
  second_ = image.clone();
  stays_ = whatStays(reference_, second_, options);
  std::ptrdiff_t moved = 0, all = 0;
  for (std::size_t i = first_spread_; i < corners_px_.size(); ++i, ++all) moved += isMoved(i);
  return 2 * moved > all;
}

bool ImageFixedParts::isMoved(std::size_t corner) const {
  return stays_.at<uchar>(static_cast<int>(corners_px_[corner].y()),
                          static_cast<int>(corners_px_[corner].x())) == 0;
}

/// Where the corners that moved have gone to.
void ImageFixedParts::track(const CameraModel& camera) {
  std::vector<std::optional<Eigen::Vector2d>> moved_px(corners_px_.size());
  for (std::size_t i = 0; i < corners_px_.size(); ++i)
    if (isMoved(i)) moved_px[i] = corners_px_[i];
  const auto to_px = trackPoints(reference_, second_, moved_px);
  from_.clear();
  to_.clear();
  for (std::size_t i = 0; i < corners_px_.size(); ++i) {
    if (!to_px[i]) continue;
    const cv::Point2d a = idealOf(camera, *moved_px[i]), b = idealOf(camera, *to_px[i]);
    if (!std::isfinite(a.x) || !std::isfinite(b.x)) continue;
    from_.push_back(a);
    to_.push_back(b);
  }
  samples_ = 0;
  random_ = cv::RNG();
  least_median_ = std::numeric_limits<double>::infinity();
}

/// Essential matrices of five points each; that is kept by which half of the points err least.
void ImageFixedParts::fitMotion(int samples) {
  samples_ += samples;
  if (from_.size() < kLeastInliers) return;
  std::vector<double> distances(from_.size());
  for (int k = 0; k < samples; ++k) {
    std::set<int> chosen;
    while (chosen.size() < kMinimalPoints)
      chosen.insert(random_.uniform(0, static_cast<int>(from_.size())));
    std::vector<cv::Point2d> from, to;
    for (const int i : chosen) {
      from.push_back(from_[static_cast<std::size_t>(i)]);
      to.push_back(to_[static_cast<std::size_t>(i)]);
    }
    const cv::Mat found = cv::findEssentialMat(from, to);  // all that fit, one below the other
    for (int row = 0; row + 3 <= found.rows; row += 3) {
      const cv::Matx33d E(found.ptr<double>(row));
      for (std::size_t i = 0; i < from_.size(); ++i)
        distances[i] = epipolarDistance(E, from_[i], to_[i]);
      const auto median = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
      std::nth_element(distances.begin(), median, distances.end());
      if (!(*median < least_median_)) continue;
      least_median_ = *median;
      E_ = E;
    }
  }
}

/// Adds to the record of each suspect what became of it, and new ones.
void ImageFixedParts::judge(const CameraModel& camera, const ImageOptions& options) {
  const double limit = kEpipolarSigmas * flowSigma_px(second_.cols) / camera.calibration().fx;
  std::size_t inliers = 0;
  for (std::size_t i = 0; i < from_.size(); ++i)
    inliers += epipolarDistance(E_, from_[i], to_[i]) <= limit;
  const bool is_known = inliers >= kLeastInliers && 2 * inliers >= from_.size();
  const auto isFixed = [&](std::size_t i) {
    if (!is_known || isMoved(i) || !isBestWhereItWas(reference_, second_, corners_px_[i], options))
      return false;
    const cv::Point2d ideal = idealOf(camera, corners_px_[i]);
    return epipolarDistance(E_, ideal, ideal) > limit;
  };
  const std::size_t known = suspects_.size();  // the first of the corners
  for (std::size_t i = 0; i < corners_px_.size(); ++i) {
    if (i < known) {
      suspects_[i].fixed += isFixed(i);
      suspects_[i].moved += isMoved(i);
      continue;
    }
    const bool is_near = std::any_of(suspects_.begin(), suspects_.end(), [&](const Suspect& s) {
      return (s.pixel - corners_px_[i]).cwiseAbs().maxCoeff() <= 0.5 * options.template_size_px;
    });
    if (!is_near && isFixed(i)) suspects_.push_back({corners_px_[i]});
  }
  suspects_.erase(std::remove_if(suspects_.begin(), suspects_.end(),
                                 [](const Suspect& s) { return s.moved >= s.fixed; }),
                  suspects_.end());
  grow(options.template_size_px);
}

/// The parts that stayed around an agreed suspect, and no farther from it than the next corner
/// would be: where little has moved yet, some of the scene hangs together with it.
void ImageFixedParts::grow(int template_size_px) {
  fixed_.release();
  scene_centres_.release();
  share_ = 0.0;
  std::vector<cv::Point> seeds;
  for (const Suspect& suspect : suspects_)
    if (suspect.fixed >= kAgreeing)
      seeds.emplace_back(static_cast<int>(suspect.pixel.x()), static_cast<int>(suspect.pixel.y()));
  if (seeds.empty()) return;
  const int reach_px = static_cast<int>(std::lround(std::sqrt(stays_.total() / kMostCorners)));
  cv::Mat near = cv::Mat::zeros(stays_.size(), CV_8U), part;
  for (const cv::Point& seed : seeds)
    cv::rectangle(near, seed - cv::Point(reach_px, reach_px), seed + cv::Point(reach_px, reach_px),
                  255, cv::FILLED);
  const int parts = cv::connectedComponents(stays_, part);
  std::vector<uchar> is_fixed(static_cast<std::size_t>(parts), 0);
  for (const cv::Point& seed : seeds) is_fixed[static_cast<std::size_t>(part.at<int>(seed))] = 255;
  is_fixed[0] = 0;  // what does not stay
  fixed_.create(stays_.size(), CV_8U);
  for (int v = 0; v < stays_.rows; ++v)
    for (int u = 0; u < stays_.cols; ++u)
      fixed_.at<uchar>(v, u) = is_fixed[static_cast<std::size_t>(part.at<int>(v, u))];
  cv::bitwise_and(fixed_, near, fixed_);
  share_ = static_cast<double>(cv::countNonZero(fixed_)) / static_cast<double>(fixed_.total());
  cv::Mat touching;
  cv::dilate(fixed_, touching, cv::Mat::ones(template_size_px, template_size_px, CV_8U));
  cv::bitwise_not(touching, scene_centres_);
}

}  // namespace active_matching_slam
