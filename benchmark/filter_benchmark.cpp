// Cost of the filter in a frame, by number of map features and of features measured. Half
// of the map are points, half inverse-depth features: the state has 12 + 4.5 features rows.

#include <benchmark/benchmark.h>

#include <random>
#include <vector>

#include "active_matching_slam/filter/ekf.h"

namespace active_matching_slam {
namespace {

CameraModel makeCamera() {
  CameraCalibration calibration;
  calibration.width = 640;
  calibration.height = 480;
  calibration.fx = calibration.fy = 450.0;
  calibration.cx = 320.0;
  calibration.cy = 240.0;
  calibration.distortion_model = DistortionModel::kPlumbBob;
  calibration.distortion = {-0.1, 0.01, 0.0, 0.0, 0.0};
  return CameraModel(calibration);
}

/// A map in front of the camera, correlated by a few frames.
Ekf makeFilter(const CameraModel& model, int features) {
  std::mt19937 engine(1);
  std::uniform_real_distribution<double> u(20.0, 620.0), v(20.0, 460.0), depth(1.0, 4.0);
  Ekf filter{FilterOptions()};
  filter.reset(CameraState(), 1e-4 * Eigen::Matrix<double, 12, 12>::Identity());
  for (int i = 0; i < features; ++i) {
    const double x = u(engine), y = v(engine), d = depth(engine);
    const Eigen::Vector2d pixel(x, y);
    if (i % 2 == 0) {
      filter.addInverseDepthFeature(model, pixel, 1.0 / d);
    } else {
      filter.addPointFeature(d * *model.unproject(pixel), 1e-3 * Eigen::Matrix3d::Identity());
    }
  }
  return filter;
}

std::vector<FeatureId> firstIds(const Ekf& filter, int count) {
  std::vector<FeatureId> ids;
  for (int i = 0; i < count; ++i) ids.push_back(filter.features()[i].id);
  return ids;
}

/// The camera stands still: the same image points again and again, with noise.
std::vector<FeatureMeasurement> measurementsOf(const PredictedMeasurements& first,
                                               std::mt19937& engine) {
  std::normal_distribution<double> noise(0.0, 1.0);
  std::vector<FeatureMeasurement> measurements;
  for (std::size_t i = 0; i < first.ids.size(); ++i) {
    const double du = noise(engine), dv = noise(engine);
    measurements.push_back(
        {first.ids[i], first.z.segment<2>(2 * i) + Eigen::Vector2d(du, dv), 0.0});
  }
  return measurements;
}

void predict(benchmark::State& state) {
  const CameraModel model = makeCamera();
  Ekf filter = makeFilter(model, static_cast<int>(state.range(0)));
  for (auto _ : state) filter.predict(1e-6);
  state.counters["rows"] = filter.stateSize();
}

void predictMeasurements(benchmark::State& state) {
  const CameraModel model = makeCamera();
  const Ekf filter = makeFilter(model, static_cast<int>(state.range(0)));
  const std::vector<FeatureId> ids = firstIds(filter, static_cast<int>(state.range(1)));
  for (auto _ : state) benchmark::DoNotOptimize(filter.predictMeasurements(model, ids));
  state.counters["rows"] = filter.stateSize();
}

void update(benchmark::State& state) {
  const CameraModel model = makeCamera();
  Ekf filter = makeFilter(model, static_cast<int>(state.range(0)));
  const auto ids = firstIds(filter, static_cast<int>(state.range(1)));
  const PredictedMeasurements first = filter.predictMeasurements(model, ids);
  std::mt19937 engine(2);
  int used = 0;
  for (auto _ : state) {
    state.PauseTiming();
    filter.predict(1.0 / 30.0);
    const auto measurements = measurementsOf(first, engine);
    state.ResumeTiming();
    used = filter.update(model, measurements).used;
  }
  state.counters["rows"] = filter.stateSize();
  state.counters["used"] = used;
}

/// All that a frame asks of the filter.
void frame(benchmark::State& state) {
  const CameraModel model = makeCamera();
  Ekf filter = makeFilter(model, static_cast<int>(state.range(0)));
  const auto ids = firstIds(filter, static_cast<int>(state.range(1)));
  const PredictedMeasurements first = filter.predictMeasurements(model, ids);
  std::mt19937 engine(2);
  int used = 0;
  for (auto _ : state) {
    filter.predict(1.0 / 30.0);
    benchmark::DoNotOptimize(filter.predictMeasurements(model, ids));
    used = filter.update(model, measurementsOf(first, engine)).used;
  }
  state.counters["rows"] = filter.stateSize();
  state.counters["used"] = used;
}

#define AMS_SIZES               \
  ArgNames({"map", "measured"}) \
      ->Args({20, 10})          \
      ->Args({100, 30})         \
      ->Args({100, 60})         \
      ->Args({150, 60})         \
      ->Args({150, 100})        \
      ->Args({200, 100})        \
      ->Unit(benchmark::kMicrosecond)

BENCHMARK(predict)->ArgName("map")->Arg(20)->Arg(100)->Arg(150)->Arg(200)->Unit(
    benchmark::kMicrosecond);
BENCHMARK(predictMeasurements)->AMS_SIZES;
BENCHMARK(update)->AMS_SIZES;
BENCHMARK(frame)->AMS_SIZES;

}  // namespace
}  // namespace active_matching_slam

BENCHMARK_MAIN();
