#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/image/image_options.h"

namespace active_matching_slam {

/// Finds what is fixed to the image and no part of the scene: burnt-in text, the dots of a
/// projector beside the lens, dirt, a gripper or the robot itself. Two images are compared, between
/// which most of the picture has moved. What has moved gives their essential matrix (5 points,
/// LMedS; Nister 2004). A patch that looks the same at the same pixel, where no static point of
/// the scene may be by that matrix, is fixed. What obeys it, as all that is far away does while
/// nothing rotates, is not judged; nor is anything while most of the picture stays. Poses and map
/// play no part, so that it holds for a start as well, and where most features are of such parts.
class ImageFixedParts {
 public:
  void reset() { *this = ImageFixedParts(); }

  /// An image (8-bit grey) at `stamp_s`; `features`: where those of the map are in it, so that they
  /// are judged as well as other corners. `centres`: pixels that may be looked at (CV_8U; empty:
  /// all). True when a comparison has ended: what is fixed may be another.
  bool add(const CameraModel& camera, const cv::Mat& image, double stamp_s,
           const std::vector<Eigen::Vector2d>& features, const ImageOptions& options,
           const cv::Mat& centres = cv::Mat());

  double share() const { return share_; }  ///< of the image's pixels
  /// CV_8U of the image's size, 255: fixed to the image, 0: not known to be; empty: nothing is.
  const cv::Mat& fixed() const { return fixed_; }
  bool contains(const Eigen::Vector2d& pixel) const;
  /// Of `centres`, those around which a template shows nothing that is fixed.
  cv::Mat sceneCentres(const cv::Mat& centres) const;

 private:
  /// A corner that was found fixed once at least.
  struct Suspect {
    Eigen::Vector2d pixel;
    int fixed = 1, moved = 0;  ///< comparisons in which it was so
  };
  /// Of a comparison: one is taken with each image, so that no image takes long.
  enum class Step { kTake, kCompare, kTrack, kFit };

  void take(const cv::Mat& image, const std::vector<Eigen::Vector2d>& features,
            const ImageOptions& options, const cv::Mat& centres);
  bool compare(const cv::Mat& image, const ImageOptions& options);
  bool isMoved(std::size_t corner) const;
  void track(const CameraModel& camera);
  void fitMotion(int samples);
  void judge(const CameraModel& camera, const ImageOptions& options);
  void grow(int template_size_px);

  Step step_ = Step::kTake;
  double last_stamp_s_ = 0.0;   ///< of the reference, or of the last image compared with it
  cv::Mat reference_, second_;  ///< the images compared
  /// In the reference, whole numbers: the suspects, features, and corners all over the image.
  std::vector<Eigen::Vector2d> corners_px_;
  std::size_t first_spread_ = 0;  ///< of those all over: they say what most of the picture does
  cv::Mat stays_;                 ///< 255 where both images look the same
  std::vector<cv::Point2d> from_, to_;  ///< what moved, normalised
  int samples_ = 0;
  cv::RNG random_;
  double least_median_ = 0.0;  ///< of the epipolar distances by the best essential matrix so far
  cv::Matx33d E_;              ///< that one
  std::vector<Suspect> suspects_;
  cv::Mat fixed_, scene_centres_;
  double share_ = 0.0;
};

}  // namespace active_matching_slam
