#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/map/relocaliser.h"

namespace active_matching_slam {

/// Unit of one map in that of another.
struct UnitRatio {
  double factor = 1.0;     ///< by which lengths of the other are to be multiplied
  double log_sigma = 0.0;  ///< standard deviation of its logarithm
};

/// Of two maps of the same place, of which both filters' cameras saw the same image: the ratio of
/// the depths of what is in view next to each other, the median over landmarks. `sights`: of
/// landmarks of `map` in this image. As uncertain as their spread, and as the depths of each map
/// are together. Empty where fewer than five landmarks of the one have one of the other nearby.
std::optional<UnitRatio> unitRatio(const CameraModel& camera, const Ekf& map, const Ekf& other,
                                   const std::vector<FeatureMeasurement>& sights);

/// Whether the two cameras that were found in a map lie to each other as those of another map, in
/// which both were tracked, and that has its unit times `unit`.
bool agree(const CameraModel& camera, const Ekf& map, const Relocalisation& first,
           const Relocalisation& second, const Eigen::Isometry3d& T_first_second,
           const UnitRatio& unit);

/// Features of another map in a filter.
struct JoinedFeatures {
  std::vector<FeatureId> ids;  ///< in the other map; in the filter they have new ones, ascending
  Eigen::Isometry3d T_map_other = Eigen::Isometry3d::Identity();  ///< after multiplying by factor
  double factor = 1.0;

  Eigen::Isometry3d operator()(const Eigen::Isometry3d& T_other) const {
    Eigen::Isometry3d scaled = T_other;
    scaled.translation() *= factor;
    return T_map_other * scaled;
  }
};

/// Adds features `ids` of another map to a filter, as seen from its camera now (inverse depth). The
/// two cameras are one: what is known of a feature in relation to the other's camera is taken to
/// that of the filter, with all that is unknown of both cameras, of the other map and of the ratio
/// of units. What the maps have in common but the camera, the calibration, is left out. The first
/// new id is that which nextId() was or the other's, whichever is larger.
JoinedFeatures joinFeatures(const Ekf& other, const std::vector<FeatureId>& ids,
                            const UnitRatio& unit, Ekf* filter);

}  // namespace active_matching_slam
