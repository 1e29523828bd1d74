#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {

/// A flat target of known size that may come into view at any time.
struct TargetDescription {
  enum class Kind { kNone, kTag, kChessboard };
  Kind kind = Kind::kNone;
  std::string dictionary;     ///< of the tag: see tagDictionaries()
  int id = 0;                 ///< of the tag, in its dictionary
  double size_m = 0.0;        ///< side of the tag's black square
  int columns = 0, rows = 0;  ///< inner corners of the chessboard
  double square_m = 0.0;      ///< side of a square of the chessboard
};

/// Names of OpenCV (DICT_4X4_50) and of AprilTag (tag36h11); empty where OpenCV came without its
/// aruco module.
const std::vector<std::string>& tagDictionaries();

/// Throws std::invalid_argument with the field, its value and what is allowed. A target of kind
/// kNone is fine.
void checkTarget(const TargetDescription& target);

/// Four corners of a target in an image.
struct TargetSighting {
  std::vector<Eigen::Vector2d> pixels;       ///< refined to a fraction of a pixel
  std::vector<Eigen::Vector2d> positions_m;  ///< in the target's plane, one a pixel
};

/// Finds a target by OpenCV: aruco's detector for tags, findChessboardCorners for chessboards, of
/// which the four outermost inner corners are given.
class TargetDetector {
 public:
  /// Throws as checkTarget().
  explicit TargetDetector(const TargetDescription& target);
  const TargetDescription& target() const { return target_; }
  /// `image`: 8-bit grey. Without pixels when the target is not seen whole.
  TargetSighting detect(const cv::Mat& image) const;

 private:
  TargetDescription target_;
};

/// A square tag as it is printed, 8-bit grey, of `side_px`, without the white around it. Throws as
/// checkTarget().
cv::Mat drawTag(const TargetDescription& tag, int side_px);

}  // namespace active_matching_slam
