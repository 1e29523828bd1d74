#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace active_matching_slam {
namespace test {

/// Golden matching problems beside the test data, sorted; empty when there are none.
inline std::vector<std::string> vectorFiles() {
  std::vector<std::string> files;
  const char* data = std::getenv("AMS_DATA");
  if (data == nullptr) return files;
  const std::filesystem::path folder = std::filesystem::path(data) / ".." / "vectors";
  if (!std::filesystem::is_directory(folder)) return files;
  for (const auto& entry : std::filesystem::directory_iterator(folder)) {
    if (entry.path().extension() == ".json") files.push_back(entry.path().string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

inline nlohmann::json readJson(const std::string& path) {
  std::ifstream file(path);
  return nlohmann::json::parse(file);
}

inline Eigen::MatrixXd matrixOf(const nlohmann::json& rows) {
  const Eigen::Index n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd matrix(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index k = 0; k < n; ++k) matrix(i, k) = rows[i][k].get<double>();
  }
  return matrix;
}

}  // namespace test
}  // namespace active_matching_slam
