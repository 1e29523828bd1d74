#include <boost/crc.hpp>
#include <cmath>
#include <cstring>
#include <limits>
#include <set>
#include <stdexcept>

#include "active_matching_slam/image/image_options.h"
#include "active_matching_slam/information/mutual_information_accumulator.h"
#include "active_matching_slam/map/map_file.h"

namespace active_matching_slam {
namespace {

/// Both line ends reveal a transfer as text.
constexpr char kMagic[9] = "AMSMAP\r\n";
constexpr std::uint32_t kVersion = 6;
constexpr std::size_t kHeaderSize = 8 + 4 + 4 + 8;
constexpr std::size_t kMaximumName = 1024, kMaximumDistortion = 16;
constexpr std::size_t kMinimumFeature = 8 + 1 + 13 * 8;  ///< bytes of a FeatureState
constexpr int kMaximumPatchSize = 255;
constexpr std::int64_t kMaximumRateCount = std::int64_t{1} << 53;
/// How a feature's kind is stored.
enum : std::uint8_t { kStoredInverseDepth, kStoredPoint, kStoredInverseDepthFromOrigin, kKinds };

class Writer {
 public:
  void bytes(const void* data, std::size_t size) {
    out_.append(static_cast<const char*>(data), size);
  }
  template <typename Unsigned>
  void number(Unsigned value) {
    for (std::size_t i = 0; i < sizeof(value); ++i)
      out_.push_back(static_cast<char>(static_cast<std::uint64_t>(value) >> (8 * i) & 0xff));
  }
  void integer(std::int64_t value) { number(static_cast<std::uint64_t>(value)); }
  void real(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof(bits));
    number(bits);
  }
  template <typename Derived>
  void reals(const Eigen::MatrixBase<Derived>& values) {
    for (Eigen::Index j = 0; j < values.cols(); ++j)
      for (Eigen::Index i = 0; i < values.rows(); ++i) real(values(i, j));
  }
  const std::string& content() const { return out_; }

 private:
  std::string out_;
};

class Reader {
 public:
  Reader(const std::string& bytes, std::size_t offset) : bytes_(bytes), offset_(offset) {}

  std::size_t remaining() const { return bytes_.size() - offset_; }
  const char* bytes(std::size_t size) {
    if (size > remaining()) throw std::runtime_error("it ends too early");
    offset_ += size;
    return bytes_.data() + (offset_ - size);
  }
  template <typename Unsigned>
  Unsigned number() {
    const char* data = bytes(sizeof(Unsigned));
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < sizeof(Unsigned); ++i)
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(data[i])) << (8 * i);
    return static_cast<Unsigned>(value);
  }
  std::int64_t integer() { return static_cast<std::int64_t>(number<std::uint64_t>()); }
  /// An integer within [low, high]; the error names it.
  std::int64_t integer(const char* name, std::int64_t low, std::int64_t high) {
    const std::int64_t value = integer();
    if (value < low || value > high)
      throw std::runtime_error(std::string(name) + " = " + std::to_string(value) + " is outside [" +
                               std::to_string(low) + ", " + std::to_string(high) + "]");
    return value;
  }
  int smallInteger(const char* name, int low, int high) {
    return static_cast<int>(integer(name, low, high));
  }
  double real() {
    const auto bits = number<std::uint64_t>();
    double value;
    std::memcpy(&value, &bits, sizeof(value));
    if (!std::isfinite(value)) throw std::runtime_error("it holds a number that is not finite");
    return value;
  }
  template <typename Derived>
  void reals(Eigen::MatrixBase<Derived>& values) {
    for (Eigen::Index j = 0; j < values.cols(); ++j)
      for (Eigen::Index i = 0; i < values.rows(); ++i) values(i, j) = real();
  }
  bool flag() { return smallInteger("flag", 0, 1) != 0; }

 private:
  const std::string& bytes_;
  std::size_t offset_;
};

void write(const CameraCalibration& camera, Writer* out) {
  out->integer(static_cast<std::int64_t>(camera.name.size()));
  out->bytes(camera.name.data(), camera.name.size());
  out->integer(camera.width);
  out->integer(camera.height);
  for (double value : {camera.fx, camera.fy, camera.cx, camera.cy}) out->real(value);
  out->integer(static_cast<int>(camera.distortion_model));
  out->integer(static_cast<std::int64_t>(camera.distortion.size()));
  for (double value : camera.distortion) out->real(value);
}

CameraCalibration readCamera(Reader* in) {
  CameraCalibration camera;
  const std::size_t name_size = in->integer("length of the camera's name", 0, kMaximumName);
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

void write(const CameraState& camera, Writer* out) {
  out->reals(camera.position_world);
  out->reals(camera.q_world_camera.coeffs());
  out->reals(camera.velocity_world);
  out->reals(camera.angular_velocity_camera);
  for (double value : {camera.readout_s, camera.lens.focal, camera.lens.radial}) out->real(value);
  out->reals(camera.lens.centre);
}

CameraState readCameraState(std::uint32_t version, Reader* in) {
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

void write(const FeatureState& feature, Writer* out) {
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

FeatureState readFeatureState(Reader* in, int offset) {
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

void write(const MapFeature& feature, Writer* out) {
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

MapFeature readMapFeature(std::uint32_t version, Reader* in) {
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

/// Something learnt, with a proper covariance, or nothing.
bool isSlope(const SourcePatch& patch) {
  const Eigen::Matrix2d& information = patch.slope_information_px2;
  if (information.isZero(0.0)) return patch.slope_per_px.isZero(0.0);
  return patch.slope_per_px.allFinite() && information.allFinite() &&
         information(0, 1) == information(1, 0) && information(0, 0) > 0.0 &&
         information(0, 0) * information(1, 1) > information(0, 1) * information(0, 1);
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

void checkSubmaps(const MapFileContent& content);

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

/// Bytes of a link of the graph.
constexpr std::size_t kLinkSize = 8 + 8 + 8 + 8;

MutualInformationGraph readGraph(Reader* in) {
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

void write(const MutualInformationGraph& graph, Writer* out) {
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

void write(const StoredSubmap& submap, Writer* out) {
  out->integer(submap.id);
  out->real(submap.lost_bits);
  for (const auto* ids : {&submap.ids, &submap.given_ids}) {
    out->integer(static_cast<std::int64_t>(ids->size()));
    for (const FeatureId id : *ids) out->integer(id);
  }
  out->reals(submap.mean);
  out->reals(submap.given_mean);
  out->reals(submap.K);
  out->reals(submap.Q);
}

StoredSubmap readSubmap(Reader* in) {
  StoredSubmap submap;
  submap.id = in->smallInteger("number of a submap", -1, std::numeric_limits<int>::max() - 1);
  submap.lost_bits = in->real();
  for (auto* ids : {&submap.ids, &submap.given_ids}) {
    ids->resize(static_cast<std::size_t>(in->integer(
        "number of features of a submap", 0, static_cast<std::int64_t>(in->remaining() / 8))));
    for (FeatureId& id : *ids) id = in->integer();
  }
  const std::size_t rows = 3 * submap.ids.size();
  const std::size_t columns =
      rows == 0 ? 0 : CameraError::kCalibrationSize + 3 * submap.given_ids.size();
  // Known before anything is allocated.
  if (rows > 0 && in->remaining() / 8 / rows < columns + rows)
    throw std::runtime_error("a submap ends too early");
  const auto n = static_cast<Eigen::Index>(rows), m = static_cast<Eigen::Index>(columns);
  submap.mean.resize(n);
  submap.given_mean.resize(m);
  submap.K.resize(n, m);
  submap.Q.resize(n, n);
  in->reals(submap.mean);
  in->reals(submap.given_mean);
  in->reals(submap.K);
  in->reals(submap.Q);
  return submap;
}

/// Features of trunk and submaps hang on what is there, and each is there once.
void checkSubmaps(const MapFileContent& content) {
  const auto refuse = [](const std::string& what) { throw std::invalid_argument(what); };
  std::set<FeatureId> active, frozen;
  for (const FeatureState& feature : content.features) active.insert(feature.id);
  std::set<FeatureId> anchors = active;
  const auto checkOne = [&](const StoredSubmap& submap, const std::string& name) {
    const auto rows = 3 * static_cast<Eigen::Index>(submap.ids.size());
    const auto columns = rows == 0 ? 0
                                   : CameraError::kCalibrationSize +
                                         3 * static_cast<Eigen::Index>(submap.given_ids.size());
    if (submap.mean.size() != rows || submap.given_mean.size() != columns ||
        submap.K.rows() != rows || submap.K.cols() != columns || submap.Q.rows() != rows ||
        submap.Q.cols() != rows)
      refuse(name + " has matrices of another size than its features");
    if (!submap.mean.allFinite() || !submap.given_mean.allFinite() || !submap.K.allFinite() ||
        !submap.Q.allFinite() || !std::isfinite(submap.lost_bits))
      refuse(name + " holds a number that is not finite");
    if (rows > 0 && !(submap.Q.diagonal().minCoeff() >= 0.0))
      refuse(name + " has a negative variance");
    for (const FeatureId id : submap.ids)
      if (id < 0 || id >= content.next_id || active.count(id) > 0 || !frozen.insert(id).second)
        refuse(name + " holds feature " + std::to_string(id) + ", which is unknown or elsewhere");
    for (const FeatureId id : submap.given_ids)
      if (anchors.count(id) == 0)
        refuse(name + " hangs on feature " + std::to_string(id) + ", which is not in the map");
  };
  checkOne(content.trunk, "the trunk");
  anchors.insert(content.trunk.ids.begin(), content.trunk.ids.end());
  int last = -1;
  for (const StoredSubmap& submap : content.submaps) {
    if (submap.id <= last || submap.id >= content.next_submap)
      refuse("submap " + std::to_string(submap.id) + " is out of order");
    last = submap.id;
    checkOne(submap, "submap " + std::to_string(submap.id));
  }
  if (frozen.size() != content.frozen.size())
    refuse("submaps and their features are different in number");
  auto expected = frozen.begin();
  for (const MapFeature& feature : content.frozen) {
    if (feature.id != *expected++) refuse("submaps and their features are different ones");
    checkMapFeature(feature, content);
  }
}

MapFileContent readContent(std::uint32_t version, Reader* in) {
  MapFileContent content;
  content.camera = readCamera(in);
  content.template_size_px = in->smallInteger("template size", 1, kMaximumPatchSize);
  content.source_patch_size_px = in->smallInteger("source patch size", 1, kMaximumPatchSize);
  content.scale_source = in->smallInteger("scale source", 0, 255);
  content.next_id = in->integer();
  content.camera_state = readCameraState(version, in);
  const auto count = static_cast<std::size_t>(in->integer(
      "number of features", 0, static_cast<std::int64_t>(in->remaining() / kMinimumFeature)));
  content.features.reserve(count);
  content.map.reserve(count);
  std::size_t size = CameraError::kSize;
  for (std::size_t i = 0; i < count; ++i) {
    content.features.push_back(readFeatureState(in, static_cast<int>(size)));
    size += content.features.back().size();
  }
  for (std::size_t i = 0; i < count; ++i) content.map.push_back(readMapFeature(version, in));
  if (version >= 5) content.graph = readGraph(in);
  if (version >= 6) {
    content.trunk = readSubmap(in);
    content.next_submap =
        in->smallInteger("next number of a submap", 0, std::numeric_limits<int>::max());
    // The least that a submap takes: id, bits, two counts.
    const auto submaps =
        in->integer("number of submaps", 0, static_cast<std::int64_t>(in->remaining() / (4 * 8)));
    for (std::int64_t k = 0; k < submaps; ++k) content.submaps.push_back(readSubmap(in));
    const auto frozen = in->integer("number of features laid aside", 0,
                                    static_cast<std::int64_t>(in->remaining() / 8));
    for (std::int64_t k = 0; k < frozen; ++k) content.frozen.push_back(readMapFeature(version, in));
  }
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
  if (content.camera.name.size() > kMaximumName ||
      content.camera.distortion.size() > kMaximumDistortion || content.scale_source < 0 ||
      content.scale_source > 255)
    throw std::invalid_argument("the camera's name or distortion or the scale source is too large");
  Writer body;
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
  write(content.trunk, &body);
  body.integer(content.next_submap);
  body.integer(static_cast<std::int64_t>(content.submaps.size()));
  for (const StoredSubmap& submap : content.submaps) write(submap, &body);
  body.integer(static_cast<std::int64_t>(content.frozen.size()));
  for (const MapFeature& feature : content.frozen) write(feature, &body);
  for (Eigen::Index j = 0; j < content.covariance.cols(); ++j)
    for (Eigen::Index i = j; i < content.covariance.rows(); ++i)
      body.real(content.covariance(i, j));

  Writer sized;
  sized.number(static_cast<std::uint64_t>(body.content().size()));
  sized.bytes(body.content().data(), body.content().size());
  Writer file;
  file.bytes(kMagic, 8);
  file.number(kVersion);
  file.number(checksum(sized.content().data(), sized.content().size()));
  file.bytes(sized.content().data(), sized.content().size());
  return file.content();
}

MapFileContent parseMap(const std::string& bytes) {
  if (bytes.compare(0, 8, kMagic, 8) != 0) throw std::runtime_error("it is not a map file");
  Reader in(bytes, 8);
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
