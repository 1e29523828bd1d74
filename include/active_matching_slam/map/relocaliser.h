#pragma once

#include <Eigen/Geometry>
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
  std::vector<Landmark> usableLandmarks(const Ekf& filter, const FeatureMap& map) const;
  std::optional<Relocalisation> prove(const CameraModel& camera, const cv::Mat& image,
                                      const std::vector<Landmark>& landmarks,
                                      Eigen::Isometry3d T_world_camera,
                                      const ImageMask& mask) const;
  std::vector<Sighting> matchDescriptors(const cv::Mat& image,
                                         const std::vector<Landmark>& landmarks,
                                         const ImageMask& mask) const;
  std::optional<Eigen::Isometry3d> solvePose(const CameraModel& camera,
                                             const std::vector<Sighting>& sightings) const;
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
