#pragma once

#include "active_matching_slam/map/map_file.h"
#include "byte_stream.h"

namespace active_matching_slam {

// What a map file is made of, one after the other. Readers throw std::runtime_error for what can't
// be, checks std::invalid_argument naming what does not fit together.

constexpr std::size_t kMaximumCameraName = 1024, kMaximumDistortion = 16;
constexpr std::size_t kMinimumStoredFeature = 8 + 1 + 13 * 8;  ///< bytes of a FeatureState
constexpr int kMaximumPatchSize = 255;

void write(const CameraCalibration& camera, ByteWriter* out);
CameraCalibration readCamera(ByteReader* in);
void write(const CameraState& camera, ByteWriter* out);
CameraState readCameraState(std::uint32_t version, ByteReader* in);
void write(const FeatureState& feature, ByteWriter* out);
FeatureState readFeatureState(ByteReader* in, int offset);
void write(const MapFeature& feature, ByteWriter* out);
MapFeature readMapFeature(std::uint32_t version, ByteReader* in);
void checkMapFeature(const MapFeature& feature, const MapFileContent& content);
void write(const MutualInformationGraph& graph, ByteWriter* out);
MutualInformationGraph readGraph(ByteReader* in);

/// Trunk, submaps and the features in them.
void writeSubmaps(const MapFileContent& content, ByteWriter* out);
void readSubmaps(std::uint32_t version, ByteReader* in, MapFileContent* content);
/// Features of trunk and submaps hang on what is there, and each is there once.
void checkSubmaps(const MapFileContent& content);

}  // namespace active_matching_slam
