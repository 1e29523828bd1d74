#include "active_matching_slam/evaluation/trajectory_plot.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <functional>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "active_matching_slam/evaluation/plot_canvas.h"
#include "active_matching_slam/evaluation/run_report.h"
#include "active_matching_slam/evaluation/text_file.h"

namespace active_matching_slam {
namespace {

const cv::Scalar kEstimateColour(180, 90, 20), kTruthColour(60, 60, 210),
    kPointColour(165, 165, 165);

/// Directions of the two views: x right, y forward, z up, as rows.
Eigen::Matrix3d viewDirections(const Trajectory& trajectory) {
  Eigen::Matrix3d mean = Eigen::Matrix3d::Zero();
  for (const StampedPose& pose : trajectory) mean += pose.T_world_camera.linear();
  Eigen::Vector3d up = -mean.col(1);
  if (up.norm() < 1e-6 * (1.0 + mean.norm())) up = -Eigen::Vector3d::UnitY();
  up.normalize();
  Eigen::Vector3d forward = mean.col(2) - up * up.dot(mean.col(2));
  if (forward.norm() < 1e-3 * (1.0 + mean.norm())) forward = up.unitOrthogonal();
  forward.normalize();
  Eigen::Matrix3d directions;
  directions.row(0) = forward.cross(up);
  directions.row(1) = forward;
  directions.row(2) = up;
  return directions;
}

struct Scene {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::vector<Eigen::Vector3d>> estimate, truth;  ///< pieces without gaps in time
};

std::vector<std::vector<Eigen::Vector3d>> pieces(const Trajectory& trajectory,
                                                 const Eigen::Matrix3d& directions) {
  std::vector<double> steps;
  for (std::size_t i = 1; i < trajectory.size(); ++i)
    steps.push_back(trajectory[i].stamp_s - trajectory[i - 1].stamp_s);
  const double longest_s = 4.0 * percentile(steps, 0.5);
  std::vector<std::vector<Eigen::Vector3d>> result;
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    if (i == 0 || steps[i - 1] > longest_s || steps[i - 1] < 0.0) result.emplace_back();
    result.back().push_back(directions * trajectory[i].T_world_camera.translation());
  }
  return result;
}

/// The trajectories and the bulk of the map, the latter only as far as the trajectories stay
/// visible.
Eigen::AlignedBox3d boundsOf(const Scene& scene) {
  Eigen::AlignedBox3d box;
  for (const auto* lines : {&scene.estimate, &scene.truth})
    for (const auto& line : *lines)
      for (const Eigen::Vector3d& p : line) box.extend(p);
  const double reach = 2.5 * box.sizes().maxCoeff();
  const Eigen::AlignedBox3d limit(box.min().array() - reach, box.max().array() + reach);
  for (int axis = 0; axis < 3 && !scene.points.empty(); ++axis) {
    std::vector<double> values;
    for (const Eigen::Vector3d& p : scene.points) values.push_back(p(axis));
    Eigen::Vector3d low = box.min(), high = box.max();
    low(axis) = std::max(limit.min()(axis), std::min(low(axis), percentile(values, 0.03)));
    high(axis) = std::min(limit.max()(axis), std::max(high(axis), percentile(values, 0.97)));
    box.extend(low);
    box.extend(high);
  }
  const double margin = std::max(0.06 * box.sizes().maxCoeff(), 1e-6);
  return Eigen::AlignedBox3d(box.min().array() - margin, box.max().array() + margin);
}

void drawView(const Scene& scene, int horizontal, int vertical, PlotCanvas* canvas) {
  const auto flat = [&](const Eigen::Vector3d& p) {
    return Eigen::Vector2d(p(horizontal), p(vertical));
  };
  for (const Eigen::Vector3d& p : scene.points) canvas->dot(flat(p), 2.3, kPointColour);
  const auto drawLines = [&](const std::vector<std::vector<Eigen::Vector3d>>& lines,
                             const cv::Scalar& colour, int thickness) {
    for (const auto& line : lines) {
      std::vector<Eigen::Vector2d> flat_line;
      for (const Eigen::Vector3d& p : line) flat_line.push_back(flat(p));
      canvas->polyline(flat_line, colour, thickness);
    }
  };
  drawLines(scene.truth, kTruthColour, 3);  // seen beside an estimate that covers it
  drawLines(scene.estimate, kEstimateColour, 1);
  canvas->ring(flat(scene.estimate.front().front()), 6.0, kEstimateColour);
  canvas->square(flat(scene.estimate.back().back()), 5.0, kEstimateColour);
}

void drawLegend(const TrajectoryPlot& plot, cv::Mat* image) {
  const int y = image->rows - 22;
  int x = 70;
  const auto entry = [&](const std::string& name, const std::function<void(cv::Point)>& symbol) {
    symbol({x, y});
    putPlotText(image, name, {x + 40, y + 5}, 0.5);
    x += 60 + plotTextWidth(name, 0.5) + 24;
  };
  const auto line = [&](const cv::Scalar& colour) {
    return [image, colour](cv::Point p) {
      cv::line(*image, p, p + cv::Point(32, 0), colour, 2, cv::LINE_AA);
    };
  };
  entry("estimate", line(kEstimateColour));
  if (!plot.truth.empty()) entry("truth", line(kTruthColour));
  if (!plot.points.empty())
    entry("map", [&](cv::Point p) {
      for (int i = 0; i < 3; ++i)
        cv::circle(*image, p + cv::Point(6 + 10 * i, i % 2 ? -3 : 3), 2, kPointColour, -1,
                   cv::LINE_AA);
    });
  entry("start", [&](cv::Point p) {
    cv::circle(*image, p + cv::Point(24, 0), 6, kEstimateColour, 2, cv::LINE_AA);
  });
  entry("end", [&](cv::Point p) {
    cv::rectangle(*image, p + cv::Point(19, -5), p + cv::Point(29, 5), kEstimateColour, -1,
                  cv::LINE_AA);
  });
}

}  // namespace

cv::Mat drawTrajectoryPlot(const TrajectoryPlot& plot, int width_px, int height_px) {
  cv::Mat image(height_px, width_px, CV_8UC3, cv::Scalar(255, 255, 255));
  putPlotText(&image, plot.title, {70, 34}, 0.65);
  if (plot.estimate.empty()) {
    putPlotText(&image, "no frame was tracked", {width_px / 2 - 90, height_px / 2}, 0.65);
    return image;
  }
  const Eigen::Matrix3d directions = viewDirections(plot.estimate);
  Scene scene;
  scene.estimate = pieces(plot.estimate, directions);
  scene.truth = pieces(plot.truth, directions);
  for (const Eigen::Vector3d& point : plot.points) scene.points.push_back(directions * point);

  const Eigen::AlignedBox3d box = boundsOf(scene);
  const int top = 70, bottom = 100, side = 70, gap = 80, panel_height = height_px - top - bottom;
  const int panel_width = (width_px - 2 * side - gap) / 2;
  const Eigen::Vector3d size = box.sizes();
  const double pixels_per_unit = std::min({panel_width / size.x(), panel_width / size.y(),
                                           panel_height / size.y(), panel_height / size.z()});
  const auto view = [&](int left, int horizontal, int vertical, const std::string& title,
                        const std::string& across, const std::string& upwards) {
    const Eigen::Vector2d center(box.center()(horizontal), box.center()(vertical));
    PlotCanvas canvas(&image, cv::Rect(left, top, panel_width, panel_height), center,
                      pixels_per_unit);
    canvas.drawGrid(across + " [" + plot.unit + "]", upwards + " [" + plot.unit + "]", title);
    drawView(scene, horizontal, vertical, &canvas);
    canvas.drawScaleBar(plot.unit);
    canvas.drawFrame();
  };
  view(side, 0, 1, "from above", "right", "forward");
  view(side + panel_width + gap, 1, 2, "from the side", "forward", "up");
  drawLegend(plot, &image);
  return image;
}

TrajectoryPlot trajectoryPlotOf(const RunReport& report) {
  const RunSummary summary = report.summary();
  const bool metric = summary.scale_source != ScaleSource::kFree;
  TrajectoryPlot plot;
  plot.estimate = report.trajectory();
  plot.points = report.mapPoints();
  plot.unit = metric ? "m" : "map units";
  char text[160];
  std::snprintf(text, sizeof(text), "%d of %d frames tracked", summary.frames_tracked,
                summary.frames);
  plot.title = text;
  const auto pairs =
      pairPoses(plot.estimate, report.truth().trajectory, report.truth().association_s);
  const auto alignment = align(pairs, metric ? AlignmentKind::kRigid : AlignmentKind::kSimilarity);
  if (!alignment) return plot;
  plot.truth = report.truth().trajectory;
  plot.unit = "m";
  for (StampedPose& pose : plot.estimate) pose.T_world_camera = (*alignment)(pose.T_world_camera);
  for (Eigen::Vector3d& point : plot.points) point = (*alignment)(point);
  std::snprintf(text, sizeof(text), ", ATE %.1f mm after %s alignment",
                1000.0 * absoluteTrajectoryError(pairs, *alignment), metric ? "SE(3)" : "Sim(3)");
  plot.title += text;
  return plot;
}

void writeTrajectoryPlot(const std::string& path, const TrajectoryPlot& plot) {
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", drawTrajectoryPlot(plot), png))
    throw std::runtime_error(path + ": cannot be encoded as PNG");
  writeTextFile(path, std::string(png.begin(), png.end()));
}

}  // namespace active_matching_slam
