#include "sequence.h"

#include <cmath>
#include <fstream>
#include <limits>
#include <stdexcept>

#include "active_matching_slam/evaluation/recorded_sequence.h"
#include "active_matching_slam/simulation/simulator.h"

namespace active_matching_slam {
namespace {

struct Definition {
  const char* name;
  const char* scene;   ///< of the simulator; null for a recording
  const char* motion;  ///< of the simulator; the folder of a recording
  int width, height;   ///< of the simulator
  double seconds;
  double sigma_acceleration, sigma_angular_acceleration;
};

/// Accelerations in map units (the median depth) and radians. A slow hand's are a fraction of a
/// fast one's.
constexpr Definition kDefinitions[] = {
    {"office_slow", "office", "slow", 1024, 768, 8.0, 0.8, 0.9},
    {"office_fast", "office", "jerky", 1024, 768, 8.0, 1.5, 2.5},
    {"walkway_slow", "walkway", "slow", 1024, 768, 8.0, 0.8, 0.9},
    {"walkway_fast", "walkway", "jerky", 1024, 768, 8.0, 1.5, 2.5},
    {"walkway_straight", "walkway", "forward", 1024, 768, 8.0, 0.8, 0.9},
    {"two_depths", "two_depths", "circle", 640, 480, 12.0, 1.0, 1.0},
    {"wall", "wall", "sideways", 640, 480, 12.0, 1.0, 1.0},
    {"planks", "planks", "forward", 640, 480, 8.0, 1.0, 1.0},
    {"corridor", "corridor", "forward", 640, 480, 12.0, 1.0, 1.0},
    {"corridor_end", "corridor_end", "sweep", 640, 480, 15.0, 1.0, 1.0},
    {"corridor_loop", "corridor_loop", "loop", 640, 480, 40.0, 1.0, 1.0},
    {"desk", nullptr, "davison_monoslam_desk", 0, 0, 15.0, 4.0, 4.0},
    {"checkerboard", nullptr, "uzh_vamr_checkerboard", 0, 0, 15.0, 4.0, 4.0},
};

const Definition& definitionOf(const std::string& name) {
  for (const Definition& definition : kDefinitions)
    if (name == definition.name) return definition;
  throw std::invalid_argument("no sequence '" + name + "'");
}

void simulate(const Definition& definition, bool quick, Sequence* sequence) {
  SimulatorOptions options;
  options.scene = definition.scene;
  options.motion = definition.motion;
  options.width = quick ? definition.width / 2 : definition.width;
  options.height = quick ? definition.height / 2 : definition.height;
  options.duration_s = quick ? 4.0 : definition.seconds;
  Simulator simulator(options);
  sequence->camera = simulator.camera();
  sequence->surfaces = simulator.scene().surfaces;
  while (const auto frame = simulator.next()) {
    sequence->images.push_back(frame->image);
    sequence->stamps_s.push_back(frame->stamp_s);
    sequence->truth.push_back({frame->stamp_s, frame->truth.T_world_camera});
  }
}

void readRecording(const Definition& definition, const std::string& data_folder, bool quick,
                   Sequence* sequence) {
  const std::string folder = data_folder + "/" + definition.motion;
  const RecordedSequence recording(folder);
  sequence->camera = recording.camera();
  recording.forEachFrame([&](const cv::Mat& image, double stamp_s) {
    if (!sequence->stamps_s.empty() &&
        stamp_s > sequence->stamps_s.front() + (quick ? 4.0 : definition.seconds))
      return false;
    sequence->images.push_back(image);
    sequence->stamps_s.push_back(stamp_s);
    return true;
  });
  for (const char* file : {"/groundtruth.txt", "/groundtruth_pseudo.txt"})
    if (std::ifstream(folder + file)) sequence->truth = readTrajectoryTum(folder + file);
}

}  // namespace

bool isRecordedName(const std::string& name) { return definitionOf(name).scene == nullptr; }

Sequence loadSequence(const std::string& name, const std::string& data_folder, bool quick) {
  const Definition& definition = definitionOf(name);
  Sequence sequence{name, CameraModel(makeSimulatedCalibration(512, 384, "none"))};
  sequence.sigma_acceleration = definition.sigma_acceleration;
  sequence.sigma_angular_acceleration = definition.sigma_angular_acceleration;
  if (definition.scene)
    simulate(definition, quick, &sequence);
  else
    readRecording(definition, data_folder, quick, &sequence);
  return sequence;
}

std::vector<int> imagesAtRate(int images, int every) {
  std::vector<int> indices;
  for (int i = 0; i < images; i += i < kFullRateFrames ? 1 : every) indices.push_back(i);
  return indices;
}

std::optional<Eigen::Vector3d> firstHit(const std::vector<Surface>& surfaces,
                                        const Eigen::Vector3d& from,
                                        const Eigen::Vector3d& direction) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const Surface& surface : surfaces) {
    const Eigen::Vector3d normal = surface.normal();
    const double towards = normal.dot(direction);
    if (towards >= 0.0) continue;
    const double distance = normal.dot(surface.origin - from) / towards;
    if (distance <= 0.0 || distance >= nearest) continue;
    const Eigen::Vector3d on_surface = from + distance * direction - surface.origin;
    const double u = on_surface.dot(surface.u_axis), v = on_surface.dot(surface.v_axis);
    if (u < 0.0 || v < 0.0 || u > surface.width_m || v > surface.height_m) continue;
    nearest = distance;
  }
  if (!std::isfinite(nearest)) return std::nullopt;
  return from + nearest * direction;
}

}  // namespace active_matching_slam
