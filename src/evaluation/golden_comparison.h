#pragma once

#include <yaml-cpp/yaml.h>

#include <functional>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/golden_vectors.h"
#include "active_matching_slam/evaluation/point_list_search.h"
#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam::golden {

/// Tolerances of the format.
inline constexpr double kBits = 1e-6, kWeight = 1e-6, kRelative = 1e-9, kDistance = 1e-8;
inline constexpr double kLeastWeight = 1e-9;

struct Problem {
  MeasurementPrior prior;
  std::vector<std::vector<Eigen::Vector2d>> points;
  std::vector<std::vector<double>> scores;

  PointListSearch search() const { return PointListSearch(points, scores); }
};

/// Throws std::runtime_error naming the field that is missing or of a wrong size.
Problem readProblem(const YAML::Node& input);

/// Match indices of one feature to ids, which are the candidate indices of the file.
std::vector<int> candidatesOf(const PointListSearch& search, int feature,
                              const std::vector<int>& matches);
/// The same for one match (or -1) of each feature.
std::vector<int> candidatePerFeature(const PointListSearch& search,
                                     const std::vector<int>& matches);

/// Collects differences between a file and what was computed. A value that the file lacks, or that
/// is of another type, is a difference.
class Comparison {
 public:
  explicit Comparison(GoldenVectorReport& report) : report_(report) {}

  /// Checks the part `name` of the file; nothing happens where that is missing or null, and what
  /// `check` throws counts as a difference.
  void section(const YAML::Node& file, const std::string& name,
               const std::function<void(const YAML::Node&)>& check);
  void number(const std::string& what, const YAML::Node& expected, double actual, double absolute,
              double relative = 0.0);
  void integer(const std::string& what, const YAML::Node& expected, std::int64_t actual);
  void integers(const std::string& what, const YAML::Node& expected,
                const std::vector<int>& actual);
  void fail(const std::string& difference) { report_.differences.push_back(difference); }
  std::size_t differences() const { return report_.differences.size(); }

 private:
  template <typename Value>
  bool read(const std::string& what, const YAML::Node& expected, Value& value);

  GoldenVectorReport& report_;
};

/// The parts of a file. Those that are missing or null are left out.
void checkInformation(const YAML::Node& file, const MeasurementPrior& prior, Comparison& compare);
void checkTraces(const YAML::Node& file, const Problem& problem, Comparison& compare);

}  // namespace active_matching_slam::golden
