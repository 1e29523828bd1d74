#include "active_matching_slam/submaps/point_gaussian.h"

#include <stdexcept>
#include <string>

#include "active_matching_slam/math/slot.h"

namespace active_matching_slam {

std::unordered_map<FeatureId, int> indicesOf(const std::vector<FeatureId>& ids) {
  std::unordered_map<FeatureId, int> indices;
  indices.reserve(ids.size());
  for (std::size_t i = 0; i < ids.size(); ++i) indices[ids[i]] = static_cast<int>(i);
  return indices;
}

std::vector<int> indicesOf(const std::vector<FeatureId>& ids, const std::vector<FeatureId>& all) {
  const std::unordered_map<FeatureId, int> where = indicesOf(all);
  std::vector<char> asked(all.size(), 0);
  std::vector<int> indices;
  indices.reserve(ids.size());
  for (FeatureId id : ids) {
    const auto found = where.find(id);
    if (found == where.end()) {
      throw std::invalid_argument("point " + std::to_string(id) + " is not in this Gaussian");
    }
    if (asked[slot(found->second)]++) {
      throw std::invalid_argument("point " + std::to_string(id) + " is given twice");
    }
    indices.push_back(found->second);
  }
  return indices;
}

std::vector<int> rowsOf(int calibration_size, const std::vector<int>& points) {
  std::vector<int> rows;
  rows.reserve(3 * points.size());
  for (int point : points) {
    for (int axis = 0; axis < 3; ++axis) rows.push_back(calibration_size + 3 * point + axis);
  }
  return rows;
}

std::vector<int> othersOf(const std::vector<int>& indices, int count) {
  std::vector<char> named(slot(count), 0);
  for (int i : indices) named[slot(i)] = 1;
  std::vector<int> others;
  for (int i = 0; i < count; ++i) {
    if (!named[slot(i)]) others.push_back(i);
  }
  return others;
}

}  // namespace active_matching_slam
