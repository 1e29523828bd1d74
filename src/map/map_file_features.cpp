// Camera, features and graph of a map file.

#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>

#include "map_file_parts.h"

namespace active_matching_slam {
namespace {

constexpr std::int64_t kMaximumRateCount = std::int64_t{1} << 53;
/// How a feature's kind is stored.
enum : std::uint8_t { kStoredInverseDepth, kStoredPoint, kStoredInverseDepthFromOrigin, kKinds };
/// Bytes of a link of the graph.
constexpr std::size_t kLinkSize = 8 + 8 + 8 + 8;

/// Something learnt, with a proper covariance, or nothing.
bool isSlope(const SourcePatch& patch) {
  const Eigen::Matrix2d& information = patch.slope_information_px2;
  if (information.isZero(0.0)) return patch.slope_per_px.isZero(0.0);
  return patch.slope_per_px.allFinite() && information.allFinite() &&
         information(0, 1) == information(1, 0) && information(0, 0) > 0.0 &&
         information(0, 0) * information(1, 1) > information(0, 1) * information(0, 1);
}

}  // namespace

void write(const CameraCalibration& camera, ByteWriter* out) {
  out->integer(static_cast<std::int64_t>(camera.name.size()));
  out->bytes(camera.name.data(), camera.name.size());
  out->integer(camera.width);
  out->integer(camera.height);
  for (double value : {camera.fx, camera.fy, camera.cx, camera.cy}) out->real(value);
  out->integer(static_cast<int>(camera.distortion_model));
  out->integer(static_cast<std::int64_t>(camera.distortion.size()));
  for (double value : camera.distortion) out->real(value);
}

CameraCalibration readCamera(ByteReader* in) {
  CameraCalibration camera;
  const std::size_t name_size = in->integer("length of the camera's name", 0, kMaximumCameraName);
  camera.name.assign(in->bytes(name_size), name_size);
  constexpr int kMaximumSide = 1 << 16;
  camera.width = in->smallInteger("image width", 1, kMaximumSide);
  camera.height = in->smallInteger("image height", 1, kMaximumSide);
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value = in->real();
  camera.distortion_model = static_cast<DistortionModel>(
      in->smallInteger("distortion model", 0, static_cast<int>(DistortionModel::kEquidistant)));
  camera.distortion.resize(in->integer("number of distortion values", 0, kMaximumDistortion));
  for (double& value : camera.distortion) value = in->real();
  return camera;
}

void write(const CameraState& camera, ByteWriter* out) {
  out->reals(camera.position_world);
  out->reals(camera.q_world_camera.coeffs());
  out->reals(camera.velocity_world);
  out->reals(camera.angular_velocity_camera);
  for (double value : {camera.readout_s, camera.lens.focal, camera.lens.radial}) out->real(value);
  out->reals(camera.lens.centre);
}

CameraState readCameraState(std::uint32_t version, ByteReader* in) {
  CameraState camera;
  in->reals(camera.position_world);
  in->reals(camera.q_world_camera.coeffs());
  in->reals(camera.velocity_world);
  in->reals(camera.angular_velocity_camera);
  if (version < 2) return camera;
  for (double* value : {&camera.readout_s, &camera.lens.focal, &camera.lens.radial})
    *value = in->real();
  in->reals(camera.lens.centre);
  return camera;
}

void write(const FeatureState& feature, ByteWriter* out) {
  out->integer(feature.id);
  out->number(static_cast<std::uint8_t>(feature.kind == FeatureKind::kPoint ? kStoredPoint
                                        : feature.anchored_at_origin ? kStoredInverseDepthFromOrigin
                                                                     : kStoredInverseDepth));
  out->reals(feature.anchor_world);
  out->reals(feature.bearing_world);
  out->reals(feature.tangent_world);
  out->real(feature.inverse_depth);
  out->reals(feature.point_world);
}

FeatureState readFeatureState(ByteReader* in, int offset) {
  FeatureState feature;
  feature.id = in->integer();
  const auto kind = in->number<std::uint8_t>();
  if (kind >= kKinds) throw std::runtime_error("feature of unknown kind " + std::to_string(kind));
  feature.kind = kind == kStoredPoint ? FeatureKind::kPoint : FeatureKind::kInverseDepth;
  feature.anchored_at_origin = kind == kStoredInverseDepthFromOrigin;
  feature.offset = offset;
  in->reals(feature.anchor_world);
  in->reals(feature.bearing_world);
  in->reals(feature.tangent_world);
  feature.inverse_depth = in->real();
  in->reals(feature.point_world);
  return feature;
}

void write(const MapFeature& feature, ByteWriter* out) {
  out->integer(feature.id);
  out->integer(feature.known);
  out->integer(feature.attempts);
  out->integer(feature.successes);
  out->real(feature.recent_rate);
  for (const std::int64_t count : {feature.rates.successes, feature.rates.failures,
                                   feature.rates.spurious, feature.rates.pixels})
    out->integer(count);
  out->integer(feature.first_frame);
  out->integer(feature.last_matched_frame);
  const SourcePatch& patch = feature.patch;
  out->reals(patch.pixel);
  out->reals(patch.center);
  out->reals(patch.T_world_camera.linear());
  out->reals(patch.T_world_camera.translation());
  out->reals(patch.slope_per_px);
  out->reals(patch.slope_information_px2);
  out->integer(patch.image.rows);
  for (int row = 0; row < patch.image.rows; ++row)
    out->bytes(patch.image.ptr(row), patch.image.cols);
}

MapFeature readMapFeature(std::uint32_t version, ByteReader* in) {
  constexpr int kMaximumCount = std::numeric_limits<int>::max();
  MapFeature feature;
  feature.id = in->integer();
  feature.known = in->flag();
  feature.attempts = in->smallInteger("searches of a feature", 0, kMaximumCount);
  feature.successes = in->smallInteger("matches of a feature", 0, feature.attempts);
  feature.recent_rate = in->real();
  for (std::int64_t* count : {&feature.rates.successes, &feature.rates.failures,
                              &feature.rates.spurious, &feature.rates.pixels})
    *count = in->integer("a count of a feature's rates", 0, kMaximumRateCount);
  feature.first_frame = in->integer();
  feature.last_matched_frame = in->integer();
  SourcePatch& patch = feature.patch;
  in->reals(patch.pixel);
  in->reals(patch.center);
  Eigen::Matrix3d R;
  Eigen::Vector3d t;
  in->reals(R);
  in->reals(t);
  patch.T_world_camera.linear() = R;
  patch.T_world_camera.translation() = t;
  if (version >= 3) {
    in->reals(patch.slope_per_px);
    in->reals(patch.slope_information_px2);
  }
  const int size = in->smallInteger("side of a patch", 1, kMaximumPatchSize);
  const char* pixels = in->bytes(static_cast<std::size_t>(size) * size);
  patch.image.create(size, size, CV_8UC1);
  std::memcpy(patch.image.data, pixels, static_cast<std::size_t>(size) * size);
  return feature;
}

void checkMapFeature(const MapFeature& feature, const MapFileContent& content) {
  const std::string name = "feature " + std::to_string(feature.id);
  const SourcePatch& patch = feature.patch;
  if (patch.image.type() != CV_8UC1 || patch.image.rows != content.source_patch_size_px ||
      patch.image.cols != content.source_patch_size_px)
    throw std::invalid_argument(name +
                                " has a patch of another size than image/source_patch_size_px");
  const Eigen::Matrix3d R = patch.T_world_camera.linear();
  if (!((R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff() <= 1e-6) ||
      !(R.determinant() > 0.0))
    throw std::invalid_argument(name + " was first seen from a pose that is not a rotation");
  if (!patch.T_world_camera.translation().allFinite() || !patch.pixel.allFinite() ||
      !(patch.center.minCoeff() >= 0.0) ||
      !(patch.center.maxCoeff() <= content.source_patch_size_px - 1))
    throw std::invalid_argument(name + " has a patch whose centre is out of range");
  if (!isSlope(patch))
    throw std::invalid_argument(name + " lies in a surface whose slope is not known");
  if (!(feature.recent_rate >= 0.0 && feature.recent_rate <= 1.0))
    throw std::invalid_argument(name + " has a rate of matches outside [0, 1]");
}

MutualInformationGraph readGraph(ByteReader* in) {
  MutualInformationGraph graph;
  const auto count = [in](const char* what, std::size_t size) {
    return static_cast<std::size_t>(
        in->integer(what, 0, static_cast<std::int64_t>(in->remaining() / size)));
  };
  graph.ids.resize(count("number of features in the graph", 8));
  for (std::int64_t& id : graph.ids) id = in->integer();
  graph.links.resize(count("number of links in the graph", kLinkSize));
  for (InformationLink& link : graph.links) {
    link.first = in->integer();
    link.second = in->integer();
    link.information_bits = in->real();
    link.frames = in->smallInteger("frames of a link", 1, std::numeric_limits<int>::max());
  }
  return graph;
}

void write(const MutualInformationGraph& graph, ByteWriter* out) {
  out->integer(static_cast<std::int64_t>(graph.ids.size()));
  for (const std::int64_t id : graph.ids) out->integer(id);
  out->integer(static_cast<std::int64_t>(graph.links.size()));
  for (const InformationLink& link : graph.links) {
    out->integer(link.first);
    out->integer(link.second);
    out->real(link.information_bits);
    out->integer(link.frames);
  }
}

}  // namespace active_matching_slam
