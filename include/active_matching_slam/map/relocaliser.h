#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/image/image_mask.h"
#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/map/relocaliser_options.h"

namespace active_matching_slam {

struct Relocalisation {
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  std::vector<FeatureMeasurement> inliers;  ///< ascending id, sub-pixel
  int searched = 0;                         ///< features that should be seen; the inliers' base
  double rms_px = 0.0;                      ///< of the inliers, both axes together
};

/// A feature whose place is known.
struct Landmark {
  const MapFeature* feature;
  FeatureState state;
};

class CornerScan;

/// An image in which the camera is looked for, in one place after another, and how far that has
/// come. A Relocaliser goes on with it step by step, each of which takes a bounded time.
class CameraLook {
 public:
  /// `image`: 8-bit grey, of the camera's size; not to be written to any more.
  explicit CameraLook(const cv::Mat& image, const ImageMask& mask = {});

  const cv::Mat& image() const { return image_; }
  const ImageMask& mask() const { return mask_; }
  /// Nothing is left to be done in the place in hand.
  bool isOver() const { return stage_ == Stage::kOver; }
  /// Where the camera was when the image was taken, if it is in the place in hand at all: not
  /// proven. Empty until the look is over, or when there is none.
  const std::optional<Eigen::Isometry3d>& pose() const { return T_world_camera_; }
  /// Another place: what is known of the image is kept.
  void beginPlace();

 private:
  friend class Relocaliser;
  enum class Stage { kCorners, kMatch, kConsensus, kOver };
  struct Sighting {
    FeatureId id;
    Eigen::Vector2d pixel;
  };

  cv::Mat image_;
  ImageMask mask_;
  std::shared_ptr<CornerScan> corners_;
  Stage stage_ = Stage::kCorners;
  // Of the place in hand.
  std::size_t landmark_ = 0;  ///< the next to be matched
  std::vector<Sighting> sightings_;
  int draws_ = 0;  ///< made for a consensus
  std::size_t inliers_ = 0;
  std::optional<Eigen::Isometry3d> best_, T_world_camera_;
};

/// Finds the camera in a map from one image, without any guess where it is: descriptors (ORB,
/// Rublee et al. 2011) of the features at first sight against corners of the image at several
/// scales, a pose by RANSAC, and then the proof: most features that the pose says are visible must
/// match there by their warped templates. Deterministic. The map is used as if it were certain.
class Relocaliser {
 public:
  /// Throws for options out of range.
  Relocaliser(const RelocaliserOptions& options, const MapOptions& map, const ImageOptions& image);

  /// `camera`: with its lens as known by now. `image`: 8-bit grey of the camera's size. Empty when
  /// the place can't be told with certainty. The camera of `filter` plays no part. `mask`: which
  /// part of the image is used.
  std::optional<Relocalisation> find(const CameraModel& camera, const cv::Mat& image,
                                     const Ekf& filter, const FeatureMap& map,
                                     const ImageMask& mask = {}) const;

  /// The same in a map of these landmarks, ascending id, wherever they are kept.
  std::optional<Relocalisation> find(const CameraModel& camera, const cv::Mat& image,
                                     const std::vector<Landmark>& landmarks,
                                     const ImageMask& mask = {}) const;

  /// One step of a look among these landmarks, of the place in hand; they may have moved since the
  /// step before. Nothing when the look is over.
  void step(const CameraModel& camera, const std::vector<Landmark>& landmarks,
            CameraLook* look) const;
  /// Time that the next step takes by a model [ms].
  static double stepMs(const std::vector<Landmark>& landmarks, const CameraLook& look);

  /// Whether most landmarks that a camera at about `T_world_camera` should see are where they
  /// should be: the camera is then there. Empty when it is not.
  std::optional<Relocalisation> prove(const CameraModel& camera, const cv::Mat& image,
                                      const std::vector<Landmark>& landmarks,
                                      Eigen::Isometry3d T_world_camera,
                                      const ImageMask& mask) const;
  static double proofMs(const std::vector<Landmark>& landmarks);

  /// Features of known depth, ascending id.
  std::vector<Landmark> usableLandmarks(const Ekf& filter, const FeatureMap& map) const;

  /// The same by `matches` in the place of descriptors. Some of them may be wrong.
  std::optional<Relocalisation> findByMatches(const CameraModel& camera, const cv::Mat& image,
                                              const Ekf& filter, const FeatureMap& map,
                                              const std::vector<FeatureMeasurement>& matches,
                                              const ImageMask& mask = {}) const;

  /// Whether enough features have a known depth; else find() would search for ever in vain.
  bool canFind(const Ekf& filter, const FeatureMap& map) const;

 private:
  struct Sighting {
    const Landmark* landmark;
    Eigen::Vector2d pixel;
  };
  static void matchDescriptors(const std::vector<Landmark>& landmarks, CameraLook* look);
  void drawConsensus(const CameraModel& camera, const std::vector<Landmark>& landmarks,
                     CameraLook* look) const;
  struct Consensus {
    Eigen::Isometry3d T_world_camera;
    std::size_t inliers = 0;
  };
  std::optional<Consensus> solvePose(const CameraModel& camera,
                                     const std::vector<Sighting>& sightings, int draws) const;
  /// Searches all that should be seen within `radius_px`; returns how many that are.
  int searchVisible(const CameraModel& camera, const cv::Mat& image,
                    const std::vector<Landmark>& landmarks, const Eigen::Isometry3d& T_world_camera,
                    double radius_px, const ImageMask& mask, std::vector<Sighting>* found) const;
  Eigen::Isometry3d refinePose(const CameraModel& camera, const std::vector<Sighting>& sightings,
                               Eigen::Isometry3d T_world_camera) const;
  /// Distance of a sighting from where the pose predicts it; infinite when it predicts none.
  double residual(const CameraModel& camera, const Sighting& sighting,
                  const Eigen::Isometry3d& T_world_camera) const;

  RelocaliserOptions options_;
  MapOptions map_options_;
  ImageOptions image_options_;
};

}  // namespace active_matching_slam
