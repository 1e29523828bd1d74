// Figures 4.2 and 4.3: a rigid rectangle of unknown place and direction in the image is pinned down
// by measuring its features, the most informative first, or the most informative per pixel.

#include <Eigen/LU>
#include <cmath>

#include "active_matching_slam/information/gaussian_information.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

constexpr double kEnoughBits = 1.0;  // pinned down when no feature has more information (page 52)
constexpr double kNoisePx = 1.0;

/// Corners and edges of a rectangle of 160 x 90 px, numbered along its rim.
std::vector<Eigen::Vector2d> rimPoints() {
  return {{-80, -45}, {-40, -45}, {0, -45}, {40, -45}, {80, -45}, {80, 0},
          {80, 45},   {40, 45},   {0, 45},  {-40, 45}, {-80, 45}, {-80, 0}};
}

/// d(pixel) / d(x, y, angle) at angle 0.
Eigen::Matrix<double, 2, 3> jacobianOf(const Eigen::Vector2d& point) {
  Eigen::Matrix<double, 2, 3> J;
  J << 1.0, 0.0, -point.y(), 0.0, 1.0, point.x();
  return J;
}

struct Step {
  int feature;
  double bits, area_px, entropy_bits_after;
};

struct Run {
  std::vector<Step> steps;
  double area_px = 0.0;
  std::vector<Eigen::Matrix2d> start, end;  ///< covariances of the features' places
};

std::vector<Eigen::Matrix2d> covariances(const Eigen::Matrix3d& P) {
  std::vector<Eigen::Matrix2d> result;
  for (const Eigen::Vector2d& point : rimPoints()) {
    const auto J = jacobianOf(point);
    result.push_back(J * P * J.transpose() + kNoisePx * kNoisePx * Eigen::Matrix2d::Identity());
  }
  return result;
}

Run pinDown(bool by_efficiency) {
  Eigen::Matrix3d P = Eigen::Vector3d(12.0 * 12.0, 9.0 * 9.0, 0.2 * 0.2).asDiagonal();
  const std::vector<Eigen::Vector2d> points = rimPoints();
  const int count = static_cast<int>(points.size());
  Run run;
  run.start = covariances(P);
  while (static_cast<int>(run.steps.size()) < count) {
    Eigen::MatrixXd H(2 * count, 3);
    for (int i = 0; i < count; ++i)
      H.middleRows<2>(2 * i) = jacobianOf(points[static_cast<std::size_t>(i)]);
    const Eigen::MatrixXd cross = P * H.transpose();
    const Eigen::MatrixXd S =
        H * cross + kNoisePx * kNoisePx * Eigen::MatrixXd::Identity(2 * count, 2 * count);
    const Eigen::VectorXd bits = stateInformationBits(P, cross, S);
    if (bits.maxCoeff() < kEnoughBits) break;
    int best = 0;
    double best_score = -1.0;
    for (int i = 0; i < count; ++i) {
      const double area_px = ellipseArea(S.block<2, 2>(2 * i, 2 * i));
      const double score = by_efficiency ? informationEfficiency(bits[i], area_px) : bits[i];
      if (bits[i] >= kEnoughBits && score > best_score) best = i, best_score = score;
    }
    const Eigen::Matrix2d S_best = S.block<2, 2>(2 * best, 2 * best);
    const Eigen::Matrix<double, 3, 2> cross_best = cross.middleCols<2>(2 * best);
    P -= cross_best * S_best.inverse() * cross_best.transpose();
    P = 0.5 * (P + P.transpose()).eval();
    const double area_px = ellipseArea(S_best);
    run.area_px += area_px;
    run.steps.push_back({best, bits[best], area_px, entropyBits(P).value_or(std::nan(""))});
  }
  run.end = covariances(P);
  return run;
}

ChartSeries ellipsesOf(const std::string& name, const std::vector<Eigen::Matrix2d>& covariances) {
  ChartSeries series{name, {}};
  const std::vector<Eigen::Vector2d> points = rimPoints();
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Matrix2d L = covariances[i].llt().matrixL();
    for (int k = 0; k <= 40; ++k) {
      const double angle = 2.0 * M_PI * k / 40.0;
      series.points.push_back(points[i] +
                              3.0 * (L * Eigen::Vector2d(std::cos(angle), std::sin(angle))));
    }
  }
  return series;
}

cv::Mat drawRun(const std::string& title, const Run& run) {
  LineChart chart{title, "u [px]", "v [px]"};
  chart.equal_axes = chart.y_down = true;
  chart.markers = false;
  chart.series = {ellipsesOf("before", run.start), ellipsesOf("after", run.end), {"measured", {}}};
  for (const Step& step : run.steps)
    chart.series.back().points.push_back(rimPoints()[static_cast<std::size_t>(step.feature)]);
  return drawLineChart(chart);
}

}  // namespace

ExperimentResult runPinDown(Workbench& /*bench*/) {
  const Run by_bits = pinDown(false), by_efficiency = pinDown(true);
  Table table(
      {"criterion", "step", "feature", "information_bits", "area_px", "entropy_bits_after"});
  const auto add = [&](const char* criterion, const Run& run) {
    for (std::size_t k = 0; k < run.steps.size(); ++k)
      table.add({criterion, static_cast<int>(k) + 1, run.steps[k].feature, run.steps[k].bits,
                 run.steps[k].area_px, run.steps[k].entropy_bits_after});
  };
  add("information", by_bits);
  add("efficiency", by_efficiency);
  ExperimentResult result;
  result.tables.emplace_back("", table);
  result.pictures.emplace_back(
      "", tilePictures({drawRun("most informative first", by_bits),
                        drawRun("most informative per pixel first", by_efficiency)},
                       2));
  const auto steps = [](const Run& run) { return static_cast<int>(run.steps.size()); };
  result.findings.push_back(
      {"measurements until no feature has 1 bit of information",
       "by efficiency one more than by information",
       text("%d by information, %d by efficiency", steps(by_bits), steps(by_efficiency)),
       verdict(steps(by_efficiency) > steps(by_bits))});
  result.findings.push_back({"area searched", "less by efficiency",
                             text("%.0f px by information, %.0f px by efficiency", by_bits.area_px,
                                  by_efficiency.area_px),
                             verdict(by_efficiency.area_px < by_bits.area_px)});
  return result;
}

}  // namespace active_matching_slam
