#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/simulation/motions.h"
#include "active_matching_slam/simulation/occluder.h"
#include "active_matching_slam/simulation/renderer.h"
#include "active_matching_slam/simulation/scenes.h"
#include "active_matching_slam/simulation/sensor.h"

namespace active_matching_slam {

struct SimulatorOptions {
  std::string scene = "room";            ///< see sceneChoices()
  std::string motion = "slow";           ///< see motionChoices()
  int width = 640, height = 480;         ///< 64 to 4096 [px]
  double rate_hz = 30.0;                 ///< 0.1 to 1000
  double duration_s = 30.0;              ///< 0 (one frame) to 36000
  std::uint64_t seed = 1;                ///< of textures, motion, noise and drift
  std::string distortion = "plumb_bob";  ///< none, plumb_bob, rational_polynomial, equidistant
  double exposure_ms = 8.0;              ///< 0 to 100, at most the frame interval; 0: no blur
  double noise = 1.5;                    ///< standard deviation at mid-grey [grey levels], 0 to 50
  double vignetting = 0.2;               ///< loss of light in the corners, 0 to 0.9
  double drift = 0.12;                   ///< amplitude of slow changes of the light, 0 to 0.9
  bool auto_exposure = true;             ///< gain follows the mean of the image, with a lag
  double readout_ms = 0.0;               ///< rolling shutter: time from first to last row, 0 to 100
  bool occluder = false;                 ///< a hand crosses the view
};

/// Throws std::invalid_argument with name, value and allowed range or list.
void checkSimulatorOptions(const SimulatorOptions& options);

/// A calibration that fits the size: about 63 degrees wide, equidistant about 136.
CameraCalibration makeSimulatedCalibration(int width, int height, const std::string& distortion);

struct SimulatedFrame {
  int index = 0;
  double stamp_s = 0.0;  ///< 1 + index / rate: the middle of the exposure (of the middle row)
  cv::Mat image;         ///< CV_8UC1
  MotionSample truth;    ///< at the stamp
  double gain = 1.0;     ///< exposure that was applied
};

/// A camera that moves through a scene: photo-like frames with exact truth. The same options give
/// the same frames, bit for bit.
class Simulator {
 public:
  /// The first stamp; not 0, which means 'no time' to many programs.
  static constexpr double kFirstStampS = 1.0;

  /// Throws as checkSimulatorOptions().
  explicit Simulator(const SimulatorOptions& options);

  const SimulatorOptions& options() const { return options_; }
  const CameraModel& camera() const { return camera_; }
  const Scene& scene() const { return scene_; }  ///< geometry; textures are released
  int frameCount() const;

  /// The next frame, or nothing after the last. Every image has memory of its own.
  std::optional<SimulatedFrame> next();

  /// Truth at any stamp.
  MotionSample truthAt(double stamp_s) const { return motion_.at(stamp_s - kFirstStampS); }

 private:
  void renderLight(double t_s, cv::Mat& radiance) const;
  int samplesFor(double t_s) const;
  double lightAt(double t_s) const;

  SimulatorOptions options_;
  CameraModel camera_;
  Scene scene_;
  Motion motion_;
  Renderer renderer_;
  Sensor sensor_;
  Occluder occluder_;
  HarmonicSum drift_;
  cv::Mat radiance_;
  int next_index_ = 0;
  double gain_ = 1.0;
};

}  // namespace active_matching_slam
