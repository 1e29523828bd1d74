#pragma once

#include <string>
#include <vector>

namespace active_matching_slam {

/// What came of one golden vector.
struct GoldenVectorReport {
  std::string name;
  int compared = 0;                      ///< values compared
  std::vector<std::string> differences;  ///< where and by how much; empty: passed
  bool passed() const { return differences.empty() && compared > 0; }
};

/// Runs the matchers on one golden vector (a JSON file of format 1: a matching problem with the
/// traces, weights, trees and associations that it must bring) and compares all that the file
/// holds, parts that are null left out. A file that cannot be read counts as a difference; nothing
/// is thrown.
GoldenVectorReport checkGoldenVector(const std::string& path);

/// The vectors (*.json) of a folder, by name. Throws std::runtime_error when it cannot be read.
std::vector<std::string> goldenVectorsIn(const std::string& folder);

}  // namespace active_matching_slam
