#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <random>
#include <vector>

#include "active_matching_slam/evaluation/point_list_search.h"
#include "active_matching_slam/matching/measurement_prior.h"

namespace active_matching_slam {

/// A hand-held camera that looks at a map of points: what its matching problems are like.
struct SimulatedProblemOptions {
  int features = 11;
  int width = 640, height = 480;  ///< [px]
  double rate_hz = 30.0;          ///< of the frames
  double focal_per_width = 0.8;   ///< focal length over image width
  double nearest_m = 0.8, farthest_m = 4.0;
  double acceleration = 6.0;          ///< sigma of the unknown linear acceleration [m/s^2]
  double angular_acceleration = 6.0;  ///< sigma of the unknown angular acceleration [rad/s^2]
  double pose_sigma_m = 0.003, pose_sigma_rad = 0.002;  ///< of the camera before the motion
  double map_sigma_m = 0.004;                           ///< of each point, on its own
  double noise_sigma_px = 1.0;
  double true_positive = 0.9;    ///< probability that a feature answers where it is
  double false_positive = 2e-5;  ///< clutter per pixel
  /// Fraction of the features that lie on a repeated texture and answer at its neighbours too.
  double repeated_fraction = 0.0;
  double repeat_px = 12.0;  ///< pitch of the repeated texture
};

/// One frame: what the filter predicts, what the image answers, and the truth.
struct SimulatedProblem {
  MeasurementPrior prior;
  std::vector<std::vector<Eigen::Vector2d>> points;  ///< [f] all matches of f anywhere near [px]
  std::vector<std::vector<double>> scores;
  std::vector<Eigen::Vector2d> true_pixel;  ///< [f] where the feature is, seen or not [px]
  std::vector<int> true_point;  ///< [f] index of the true match in points[f], -1: not seen

  PointListSearch search() const { return PointListSearch(points, scores); }
};

/// Draws problems whose truth follows the prediction exactly: the camera's error is common to all
/// features, the errors of map and image are each feature's own. Deterministic in its seed.
class ProblemSimulator {
 public:
  /// Throws std::invalid_argument for options out of range.
  ProblemSimulator(const SimulatedProblemOptions& options, std::uint64_t seed);
  SimulatedProblem next();

 private:
  double uniform(double low, double high);
  double normal();
  void addClutter(SimulatedProblem& problem, int feature, const Eigen::Vector2d& truth);

  SimulatedProblemOptions options_;
  std::mt19937_64 random_;
};

}  // namespace active_matching_slam
