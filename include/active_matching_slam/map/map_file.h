#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_calibration.h"
#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/filter/feature_state.h"
#include "active_matching_slam/information/mutual_information_graph.h"
#include "active_matching_slam/map/feature_map.h"
#include "active_matching_slam/submaps/submap_tree.h"

namespace active_matching_slam {

/// All that a tracker must know to go on where it was.
struct MapFileContent {
  CameraCalibration camera;  ///< the map belongs to
  CameraState camera_state;
  std::vector<FeatureState> features;  ///< ascending id
  Eigen::MatrixXd covariance;          ///< camera, then features in their order
  std::vector<MapFeature> map;         ///< the same ids in the same order
  MutualInformationGraph graph;        ///< of the map and of what has left it; may be empty
  Conditional trunk;                   ///< separators out of view, given features of the map
  std::vector<Leaf> submaps;           ///< ascending id, given features of the map or the trunk
  int next_submap = 0;
  std::vector<MapFeature> frozen;  ///< those of trunk and submaps, ascending id
  FeatureId next_id = 0;
  int scale_source = 0;                                ///< the tracker's ScaleSource
  int template_size_px = 0, source_patch_size_px = 0;  ///< of ImageOptions
};

/// Binary, little-endian: 8 bytes that name the format, version (u32), CRC-32 of all that follows
/// (u32), size of the rest in bytes (u64), content. Doubles are stored as they are, so that a map
/// read back equals the one written bit for bit. Throws std::invalid_argument when the content does
/// not fit together.
std::string serializeMap(const MapFileContent& content);

/// Reads what serializeMap() wrote. Any other bytes throw std::runtime_error with the cause; no
/// more memory is asked for than a few times the size of `bytes`.
MapFileContent parseMap(const std::string& bytes);

/// Written beside `path` first and renamed, so that a crash leaves either the old file or the new
/// one. Throws std::runtime_error naming file and cause, and then leaves an old file untouched.
void writeMapFile(const std::string& path, const MapFileContent& content);

/// Throws std::runtime_error naming file and cause.
MapFileContent readMapFile(const std::string& path);

}  // namespace active_matching_slam
