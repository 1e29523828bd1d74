#include "active_matching_slam/simulation/simulator.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/math/option_field.h"
#include "active_matching_slam/simulation/random.h"

namespace active_matching_slam {
namespace {

/// Auto exposure: wanted mean of the image (1 = white), lag, and limits of the gain.
constexpr double kTargetMean = 0.44;
constexpr double kExposureLagS = 0.5;
constexpr double kLeastGain = 0.2, kMostGain = 6.0;

const SimulatorOptions& checked(const SimulatorOptions& options) {
  checkSimulatorOptions(options);
  return options;
}

const std::vector<NamedChoice>& distortionChoices() {
  static const std::vector<NamedChoice> choices = {
      {"none", ""}, {"plumb_bob", ""}, {"rational_polynomial", ""}, {"equidistant", ""}};
  return choices;
}

}  // namespace

void checkSimulatorOptions(const SimulatorOptions& o) {
  checkChoice("scene", o.scene, sceneChoices());
  checkChoice("motion", o.motion, motionChoices());
  checkChoice("distortion", o.distortion, distortionChoices());
  checkRange("width", o.width, 64, 4096);
  checkRange("height", o.height, 64, 4096);
  checkRange("rate_hz", o.rate_hz, 0.1, 1000.0);
  checkRange("duration_s", o.duration_s, 0.0, 36000.0);
  checkRange("exposure_ms", o.exposure_ms, 0.0, std::min(100.0, 1000.0 / o.rate_hz));
  checkRange("noise", o.noise, 0.0, 50.0);
  checkRange("vignetting", o.vignetting, 0.0, 0.9);
  checkRange("drift", o.drift, 0.0, 0.9);
  checkRange("readout_ms", o.readout_ms, 0.0, 100.0);
}

CameraCalibration makeSimulatedCalibration(int width, int height, const std::string& distortion) {
  checkChoice("distortion", distortion, distortionChoices());
  CameraCalibration c;
  c.name = "simulated";
  c.width = width;
  c.height = height;
  c.distortion_model = distortionModelFromName(distortion);
  c.fx = c.fy = 0.82 * width;
  // A principal point off the middle, as real ones are.
  c.cx = 0.5 * (width - 1) + 0.006 * width;
  c.cy = 0.5 * (height - 1) - 0.004 * width;
  switch (c.distortion_model) {
    case DistortionModel::kNone:
      break;
    case DistortionModel::kPlumbBob:
      c.distortion = {-0.18, 0.06, 0.0004, -0.0003, 0.0};
      break;
    case DistortionModel::kRationalPolynomial:
      c.distortion = {0.12, 0.02, 0.0003, -0.0002, 0.001, 0.3, 0.04, 0.002};
      break;
    case DistortionModel::kEquidistant:
      c.fx = c.fy = 0.42 * width;
      c.distortion = {-0.012, 0.004, -0.002, 0.0003};
      break;
  }
  return c;
}

Simulator::Simulator(const SimulatorOptions& options)
    : options_(checked(options)),
      camera_(makeSimulatedCalibration(options.width, options.height, options.distortion)),
      scene_(createScene(options.scene, options.seed)),
      motion_(createMotion(options.motion, scene_.stage, options.seed)),
      renderer_(camera_, scene_, options.readout_ms > 0.0),
      sensor_(options.width, options.height, options.noise, options.vignetting),
      occluder_(options.seed) {
  for (Surface& surface : scene_.surfaces) surface.albedo.release();  // the renderer has its own
  Random random = Random(options.seed).fork(0x44524946);
  for (int i = 0; i < 3; ++i)
    drift_.add(options.drift / 3.0, 2.0 * M_PI * random.uniform(0.02, 0.25),
               random.uniform(0.0, 2.0 * M_PI));
}

int Simulator::frameCount() const {
  return static_cast<int>(std::floor(options_.duration_s * options_.rate_hz + 1e-9)) +
         (options_.duration_s * options_.rate_hz < 1.0 ? 1 : 0);
}

int Simulator::samplesFor(double t_s) const {
  const MotionSample truth = motion_.at(t_s);
  const double exposure_s = 1e-3 * options_.exposure_ms;
  // Blur of a point two metres away (scenes differ, this only sets the quality).
  const double focal = camera_.calibration().fx;
  const double speed = truth.angular_velocity_camera.norm() +
                       truth.velocity_world.norm() / (2.0 * scene_.stage.size_m);
  const double blur_px = speed * focal * exposure_s;
  return Renderer::kPattern * std::clamp(static_cast<int>(std::ceil(blur_px / 3.0)), 1, 8);
}

void Simulator::renderLight(double t_s, cv::Mat& radiance) const {
  const double exposure_s = 1e-3 * options_.exposure_ms, readout_s = 1e-3 * options_.readout_ms;
  const int samples = samplesFor(t_s);
  const auto pose_of_row = [&](int sample, double row) {
    const double moment = exposure_s * ((sample + 0.5) / samples - 0.5);
    const double row_delay = readout_s * (row / (options_.height - 1) - 0.5);
    return motion_.at(t_s + moment + row_delay).T_world_camera;
  };
  renderer_.render(pose_of_row, samples, radiance);
}

double Simulator::lightAt(double t_s) const { return 1.0 + drift_.value(t_s); }

std::optional<SimulatedFrame> Simulator::next() {
  if (next_index_ >= frameCount()) return std::nullopt;
  SimulatedFrame frame;
  frame.index = next_index_++;
  const double t_s = frame.index / options_.rate_hz;
  frame.stamp_s = kFirstStampS + t_s;
  frame.truth = motion_.at(t_s);
  renderLight(t_s, radiance_);
  if (options_.occluder) occluder_.cover(t_s, 1e-3 * options_.exposure_ms, radiance_);

  const double light = lightAt(t_s);
  const double mean = std::max(cv::mean(radiance_)[0] * light, 1e-6);
  if (frame.index == 0) gain_ = std::clamp(kTargetMean / mean, kLeastGain, kMostGain);
  frame.gain = light * gain_;
  sensor_.expose(radiance_, frame.gain, Random(options_.seed).fork(frame.index).next(),
                 frame.image);
  if (options_.auto_exposure) {
    const double fraction = 1.0 - std::exp(-1.0 / (options_.rate_hz * kExposureLagS));
    gain_ =
        std::clamp(gain_ * std::pow(kTargetMean / (gain_ * mean), fraction), kLeastGain, kMostGain);
  }
  return frame;
}

}  // namespace active_matching_slam
