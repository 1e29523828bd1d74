// Trunk and submaps in a map file.

#include <cmath>
#include <limits>
#include <set>
#include <stdexcept>

#include "map_file_parts.h"

namespace active_matching_slam {
namespace {

void write(const Leaf& submap, ByteWriter* out) {
  out->integer(submap.id);
  out->real(submap.lost_bits);
  for (const auto* ids : {&submap.points.ids, &submap.points.given_ids}) {
    out->integer(static_cast<std::int64_t>(ids->size()));
    for (const FeatureId id : *ids) out->integer(id);
  }
  out->reals(submap.points.mean);
  out->reals(submap.points.given_mean);
  out->reals(submap.points.K);
  out->reals(submap.points.Q);
}

Leaf readSubmap(ByteReader* in) {
  Leaf submap;
  Conditional& points = submap.points;
  submap.id = in->smallInteger("number of a submap", -1, std::numeric_limits<int>::max() - 1);
  submap.lost_bits = in->real();
  for (auto* ids : {&points.ids, &points.given_ids}) {
    ids->resize(static_cast<std::size_t>(in->integer(
        "number of features of a submap", 0, static_cast<std::int64_t>(in->remaining() / 8))));
    for (FeatureId& id : *ids) id = in->integer();
  }
  const std::size_t rows = 3 * points.ids.size();
  const std::size_t columns =
      rows == 0 ? 0 : CameraError::kCalibrationSize + 3 * points.given_ids.size();
  // Known before anything is allocated.
  if (rows > 0 && in->remaining() / 8 / rows < columns + rows)
    throw std::runtime_error("a submap ends too early");
  const auto n = static_cast<Eigen::Index>(rows), m = static_cast<Eigen::Index>(columns);
  points.mean.resize(n);
  points.given_mean.resize(m);
  points.K.resize(n, m);
  points.Q.resize(n, n);
  in->reals(points.mean);
  in->reals(points.given_mean);
  in->reals(points.K);
  in->reals(points.Q);
  return submap;
}

}  // namespace

void writeSubmaps(const MapFileContent& content, ByteWriter* out) {
  write(Leaf{-1, content.trunk, 0.0}, out);
  out->integer(content.next_submap);
  out->integer(static_cast<std::int64_t>(content.submaps.size()));
  for (const Leaf& submap : content.submaps) write(submap, out);
  out->integer(static_cast<std::int64_t>(content.frozen.size()));
  for (const MapFeature& feature : content.frozen) write(feature, out);
}

void readSubmaps(std::uint32_t version, ByteReader* in, MapFileContent* content) {
  const Leaf trunk = readSubmap(in);
  if (trunk.id != -1 || trunk.lost_bits != 0.0 || std::signbit(trunk.lost_bits))
    throw std::runtime_error("the trunk has the number or the bits of a submap");
  content->trunk = trunk.points;
  content->next_submap =
      in->smallInteger("next number of a submap", 0, std::numeric_limits<int>::max());
  // The least that a submap takes: id, bits, two counts.
  const auto submaps =
      in->integer("number of submaps", 0, static_cast<std::int64_t>(in->remaining() / (4 * 8)));
  for (std::int64_t k = 0; k < submaps; ++k) content->submaps.push_back(readSubmap(in));
  const auto frozen = in->integer("number of features laid aside", 0,
                                  static_cast<std::int64_t>(in->remaining() / 8));
  for (std::int64_t k = 0; k < frozen; ++k) content->frozen.push_back(readMapFeature(version, in));
}

void checkSubmaps(const MapFileContent& content) {
  const auto refuse = [](const std::string& what) { throw std::invalid_argument(what); };
  std::set<FeatureId> active, frozen;
  for (const FeatureState& feature : content.features) active.insert(feature.id);
  std::set<FeatureId> anchors = active;
  const auto checkOne = [&](const Conditional& submap, const std::string& name) {
    const auto rows = 3 * static_cast<Eigen::Index>(submap.ids.size());
    const auto columns = rows == 0 ? 0
                                   : CameraError::kCalibrationSize +
                                         3 * static_cast<Eigen::Index>(submap.given_ids.size());
    if (submap.mean.size() != rows || submap.given_mean.size() != columns ||
        submap.K.rows() != rows || submap.K.cols() != columns || submap.Q.rows() != rows ||
        submap.Q.cols() != rows)
      refuse(name + " has matrices of another size than its features");
    if (!submap.mean.allFinite() || !submap.given_mean.allFinite() || !submap.K.allFinite() ||
        !submap.Q.allFinite())
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
  for (const Leaf& submap : content.submaps) {
    if (submap.id <= last || submap.id >= content.next_submap)
      refuse("submap " + std::to_string(submap.id) + " is out of order");
    last = submap.id;
    const std::string name = "submap " + std::to_string(submap.id);
    checkOne(submap.points, name);
    if (!std::isfinite(submap.lost_bits)) refuse(name + " holds a number that is not finite");
  }
  if (frozen.size() != content.frozen.size())
    refuse("submaps and their features are different in number");
  auto expected = frozen.begin();
  for (const MapFeature& feature : content.frozen) {
    if (feature.id != *expected++) refuse("submaps and their features are different ones");
    checkMapFeature(feature, content);
  }
}

}  // namespace active_matching_slam
