#include "active_matching_slam/evaluation/corridor_laps.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/evaluation/consistency.h"
#include "active_matching_slam/math/quantile.h"
#include "corridor_run.h"

namespace active_matching_slam {
namespace {

double meanValue(const std::vector<double>& values) {
  double sum = 0.0;
  for (double value : values) sum += value;
  return values.empty() ? 0.0 : sum / static_cast<double>(values.size());
}

}  // namespace

CorridorResult CorridorRun::run() {
  const double length = CorridorWorld::lapLength();
  const int frames = static_cast<int>(std::round(options_.laps * length / kSpeed * kRate));
  std::vector<double> nees, error, ms;
  int lap = 0;
  LapSummary summary;
  const auto finishLap = [&]() {
    summary.nees = meanValue(nees);
    summary.nees_median = medianOf(nees);
    summary.error_m = meanValue(error);
    summary.frame_ms = medianOf(ms);
    summary.points = static_cast<int>(filter_.features().size()) + tree_.frozenCount();
    summary.trunk = static_cast<int>(tree_.trunk().ids().size());
    summary.leaves = static_cast<int>(tree_.leaves().size());
    result_.laps.push_back(summary);
    summary = {};
    nees.clear();
    error.clear();
    ms.clear();
  };
  for (frame_ = 1; frame_ <= frames; ++frame_) {
    const double walked = kSpeed * frame_ / kRate;
    if (static_cast<int>(walked / length) != lap) {
      finishLap();
      lap = static_cast<int>(walked / length);
    }
    lap_ = lap;
    truth_ = world_.camera(walked, frame_ / kRate);
    const double start = processorMs();
    step();
    ms.push_back(processorMs() - start);
    bound();
    const auto off = poseError(filter_.camera().poseWorldCamera(), truth_);
    error.push_back(off.head<3>().norm());
    const auto value =
        normalisedErrorSquared(off, filter_.cameraCovariance().topLeftCorner<6, 6>());
    nees.push_back(value.value_or(1e9));
    summary.active_most =
        std::max(summary.active_most, static_cast<int>(filter_.features().size()));
  }
  finishLap();
  result_.freeze_ms = medianOf(freeze_ms_);
  result_.activate_ms = medianOf(activate_ms_);
  return result_;
}

CorridorResult runCorridorLaps(const CorridorOptions& options, std::uint64_t seed) {
  return CorridorRun(options, seed).run();
}

}  // namespace active_matching_slam
