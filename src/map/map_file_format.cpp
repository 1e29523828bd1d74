#include <boost/crc.hpp>
#include <stdexcept>

#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/information/mutual_information_accumulator.h"
#include "map_file_parts.h"

namespace active_matching_slam {
namespace {

/// Both line ends reveal a transfer as text.
constexpr char kMagic[9] = "AMSMAP\r\n";
constexpr std::uint32_t kVersion = 6;
constexpr std::size_t kHeaderSize = 8 + 4 + 4 + 8;

void check(const MapFileContent& content) {
  checkCalibration(content.camera);
  ImageOptions image;
  image.template_size_px = content.template_size_px;
  image.source_patch_size_px = content.source_patch_size_px;
  checkImageOptions(image);
  if (content.source_patch_size_px > kMaximumPatchSize)
    throw std::invalid_argument("image/source_patch_size_px is beyond what a map file holds");
  Ekf(FilterOptions())
      .restore(content.camera_state, content.features, content.covariance, content.next_id);
  MutualInformationAccumulator{content.graph};
  if (content.map.size() != content.features.size())
    throw std::invalid_argument("map and filter hold different numbers of features");
  for (std::size_t i = 0; i < content.map.size(); ++i) {
    if (content.map[i].id != content.features[i].id)
      throw std::invalid_argument("map and filter hold different features");
    checkMapFeature(content.map[i], content);
  }
  checkSubmaps(content);
}

MapFileContent readContent(std::uint32_t version, ByteReader* in) {
  MapFileContent content;
  content.camera = readCamera(in);
  content.template_size_px = in->smallInteger("template size", 1, kMaximumPatchSize);
  content.source_patch_size_px = in->smallInteger("source patch size", 1, kMaximumPatchSize);
  content.scale_source = in->smallInteger("scale source", 0, 255);
  content.next_id = in->integer();
  content.camera_state = readCameraState(version, in);
  const auto count = static_cast<std::size_t>(in->integer(
      "number of features", 0, static_cast<std::int64_t>(in->remaining() / kMinimumStoredFeature)));
  content.features.reserve(count);
  content.map.reserve(count);
  std::size_t size = CameraError::kSize;
  for (std::size_t i = 0; i < count; ++i) {
    content.features.push_back(readFeatureState(in, static_cast<int>(size)));
    size += content.features.back().size();
  }
  for (std::size_t i = 0; i < count; ++i) content.map.push_back(readMapFeature(version, in));
  if (version >= 5) content.graph = readGraph(in);
  if (version >= 6) readSubmaps(version, in, &content);
  // Nothing but the lower triangle is left; so its size is known before it is allocated. Version 1
  // has no calibration in it.
  const std::size_t calibration = version < 2 ? CameraError::kCalibrationSize : 0;
  const std::size_t stored = size - calibration;
  if (in->remaining() != 8 * (stored * (stored + 1) / 2))
    throw std::runtime_error("the covariance is not that of " + std::to_string(count) +
                             " features");
  const auto place = [calibration](std::size_t i) {
    return i < CameraError::kMotionSize ? i : i + calibration;
  };
  content.covariance = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t j = 0; j < stored; ++j)
    for (std::size_t i = j; i < stored; ++i)
      content.covariance(place(i), place(j)) = content.covariance(place(j), place(i)) = in->real();
  if (calibration > 0)
    content.covariance.diagonal().segment<CameraError::kCalibrationSize>(CameraError::kMotionSize) =
        calibrationSigmas(FilterOptions()).array().square();
  return content;
}

std::uint32_t checksum(const char* data, std::size_t size) {
  boost::crc_32_type crc;
  crc.process_bytes(data, size);
  return crc.checksum();
}

}  // namespace

std::string serializeMap(const MapFileContent& content) {
  check(content);
  if (content.camera.name.size() > kMaximumCameraName ||
      content.camera.distortion.size() > kMaximumDistortion || content.scale_source < 0 ||
      content.scale_source > 255)
    throw std::invalid_argument("the camera's name or distortion or the scale source is too large");
  ByteWriter body;
  write(content.camera, &body);
  body.integer(content.template_size_px);
  body.integer(content.source_patch_size_px);
  body.integer(content.scale_source);
  body.integer(content.next_id);
  write(content.camera_state, &body);
  body.integer(static_cast<std::int64_t>(content.features.size()));
  for (const FeatureState& feature : content.features) write(feature, &body);
  for (const MapFeature& feature : content.map) write(feature, &body);
  write(content.graph, &body);
  writeSubmaps(content, &body);
  for (Eigen::Index j = 0; j < content.covariance.cols(); ++j)
    for (Eigen::Index i = j; i < content.covariance.rows(); ++i)
      body.real(content.covariance(i, j));

  ByteWriter sized;
  sized.number(static_cast<std::uint64_t>(body.content().size()));
  sized.bytes(body.content().data(), body.content().size());
  ByteWriter file;
  file.bytes(kMagic, 8);
  file.number(kVersion);
  file.number(checksum(sized.content().data(), sized.content().size()));
  file.bytes(sized.content().data(), sized.content().size());
  return file.content();
}

MapFileContent parseMap(const std::string& bytes) {
  if (bytes.compare(0, 8, kMagic, 8) != 0) throw std::runtime_error("it is not a map file");
  ByteReader in(bytes, 8);
  const auto version = in.number<std::uint32_t>();
  if (version == 0 || version > kVersion)
    throw std::runtime_error("version " + std::to_string(version) +
                             " of the format is not known here, only up to " +
                             std::to_string(kVersion));
  const auto expected_checksum = in.number<std::uint32_t>();
  const auto size = in.number<std::uint64_t>();
  if (size != in.remaining())
    throw std::runtime_error("it holds " + std::to_string(bytes.size()) + " bytes instead of " +
                             std::to_string(size) + " + " + std::to_string(kHeaderSize));
  if (checksum(bytes.data() + 16, bytes.size() - 16) != expected_checksum)
    throw std::runtime_error("it is damaged: the checksum does not match");
  try {
    MapFileContent content = readContent(version, &in);
    check(content);
    return content;
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(error.what());
  }
}

}  // namespace active_matching_slam
