#include "active_matching_slam/evaluation/trajectory.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <locale>
#include <numeric>
#include <sstream>
#include <stdexcept>

#include "active_matching_slam/evaluation/text_file.h"

namespace active_matching_slam {
namespace {

StampedPose parseLine(const std::string& line, const std::string& place) {
  std::istringstream stream(line);
  stream.imbue(std::locale::classic());
  double value[8];
  for (int i = 0; i < 8; ++i) {
    if (!(stream >> value[i]) || !std::isfinite(value[i]))
      throw std::runtime_error(place + ": number " + std::to_string(i + 1) +
                               " of 8 (stamp tx ty tz qx qy qz qw) is missing or not a number");
  }
  std::string rest;
  if (stream >> rest && rest[0] != '#')
    throw std::runtime_error(place + ": more than 8 numbers (stamp tx ty tz qx qy qz qw)");
  const Eigen::Quaterniond q(value[7], value[4], value[5], value[6]);
  if (std::abs(q.norm() - 1.0) > 0.05)
    throw std::runtime_error(place + ": the quaternion has norm " + numberText(q.norm()) +
                             ", must be 1");
  StampedPose pose;
  pose.stamp_s = value[0];
  pose.T_world_camera.linear() = q.normalized().toRotationMatrix();
  pose.T_world_camera.translation() << value[1], value[2], value[3];
  return pose;
}

std::vector<int> orderByStamp(const Trajectory& trajectory) {
  std::vector<int> order(trajectory.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return trajectory[a].stamp_s < trajectory[b].stamp_s; });
  return order;
}

/// Position in `order` of the pose nearest to `stamp_s`; the earlier of two equally near.
int nearest(const Trajectory& trajectory, const std::vector<int>& order, double stamp_s) {
  const auto stampOf = [&](int i) { return trajectory[order[i]].stamp_s; };
  const auto after =
      std::lower_bound(order.begin(), order.end(), stamp_s,
                       [&](int i, double stamp) { return trajectory[i].stamp_s < stamp; });
  int best = static_cast<int>(after - order.begin());
  if (best == static_cast<int>(order.size()) ||
      (best > 0 && stamp_s - stampOf(best - 1) <= stampOf(best) - stamp_s))
    --best;
  while (best > 0 && stampOf(best - 1) == stampOf(best)) --best;
  return best;
}

}  // namespace

Trajectory readTrajectoryTum(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  Trajectory trajectory;
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    const std::size_t begin = line.find_first_not_of(" \t\r");
    if (begin == std::string::npos || line[begin] == '#') continue;
    trajectory.push_back(parseLine(line, path + ": line " + std::to_string(number)));
  }
  if (file.bad()) throw std::runtime_error(path + ": cannot be read to its end");
  return trajectory;
}

std::string trajectoryTumText(const Trajectory& trajectory) {
  std::string text = "# stamp[s] tx ty tz qx qy qz qw (T_world_camera, optical frame)\n";
  char line[256];
  for (const StampedPose& pose : trajectory) {
    Eigen::Quaterniond q(pose.T_world_camera.linear());
    if (q.w() < 0.0) q.coeffs() = -q.coeffs();
    const Eigen::Vector3d t = pose.T_world_camera.translation();
    std::snprintf(line, sizeof(line), "%.9f %.9f %.9f %.9f %.9f %.9f %.9f %.9f\n", pose.stamp_s,
                  t.x(), t.y(), t.z(), q.x(), q.y(), q.z(), q.w());
    text += line;
  }
  return text;
}

void writeTrajectoryTum(const std::string& path, const Trajectory& trajectory) {
  writeTextFile(path, trajectoryTumText(trajectory));
}

std::vector<std::pair<int, int>> associateByStamp(const Trajectory& estimate,
                                                  const Trajectory& truth,
                                                  double maximum_difference_s) {
  std::vector<std::pair<int, int>> pairs;
  if (estimate.empty() || truth.empty()) return pairs;
  const std::vector<int> estimate_order = orderByStamp(estimate);
  const std::vector<int> truth_order = orderByStamp(truth);
  for (int i = 0; i < static_cast<int>(estimate_order.size()); ++i) {
    const double stamp_s = estimate[estimate_order[i]].stamp_s;
    const int t = nearest(truth, truth_order, stamp_s);
    const double truth_stamp_s = truth[truth_order[t]].stamp_s;
    if (!(std::abs(truth_stamp_s - stamp_s) <= maximum_difference_s)) continue;
    if (nearest(estimate, estimate_order, truth_stamp_s) != i) continue;
    pairs.emplace_back(estimate_order[i], truth_order[t]);
  }
  return pairs;
}

std::vector<PosePair> pairPoses(const Trajectory& estimate, const Trajectory& truth,
                                double maximum_difference_s) {
  std::vector<PosePair> pairs;
  for (const auto& [e, t] : associateByStamp(estimate, truth, maximum_difference_s))
    pairs.push_back({estimate[e].stamp_s, estimate[e].T_world_camera, truth[t].T_world_camera});
  return pairs;
}

Excursion measureExcursion(const Trajectory& trajectory) {
  Excursion result;
  if (trajectory.empty()) return result;
  const Eigen::Vector3d first = trajectory.front().T_world_camera.translation();
  Eigen::Vector3d previous = first;
  for (const StampedPose& pose : trajectory) {
    const Eigen::Vector3d position = pose.T_world_camera.translation();
    result.path_length += (position - previous).norm();
    result.displacement = (position - first).norm();
    result.excursion = std::max(result.excursion, result.displacement);
    previous = position;
  }
  return result;
}

}  // namespace active_matching_slam
