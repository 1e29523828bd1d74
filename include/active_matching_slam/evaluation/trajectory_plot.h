#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/evaluation/trajectory.h"

namespace active_matching_slam {

class RunReport;

/// What a picture of a run shows, all in one world frame.
struct TrajectoryPlot {
  Trajectory estimate;
  Trajectory truth;                     ///< may be empty
  std::vector<Eigen::Vector3d> points;  ///< the map
  std::string title;
  std::string unit = "m";  ///< of all lengths
};

/// The run's trajectory and map, brought onto the truth where there is one (SE(3) when the scale is
/// metric, else Sim(3)).
TrajectoryPlot trajectoryPlotOf(const RunReport& report);

/// Two views beside each other, one from above and one from the side, to the same scale: axes with
/// units, grid, scale bar and legend. 'Above' is where the camera's upper image edge points on
/// average, since the world frame need not know gravity. 8-bit BGR; empty trajectories draw as an
/// empty picture that says so.
cv::Mat drawTrajectoryPlot(const TrajectoryPlot& plot, int width_px = 1600, int height_px = 800);

/// Writes the picture as PNG. Throws std::runtime_error naming the file.
void writeTrajectoryPlot(const std::string& path, const TrajectoryPlot& plot);

}  // namespace active_matching_slam
