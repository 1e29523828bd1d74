#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <vector>

#include "active_matching_slam/simulation/simulator.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {

/// A short simulated film with truth, and the camera that took it.
struct Film {
  CameraModel camera;
  std::vector<SimulatedFrame> frames;
};

/// A calm hand in a room.
inline SimulatorOptions filmOptions(double duration_s, cv::Size size = {320, 240}) {
  SimulatorOptions options;
  options.duration_s = duration_s;
  options.width = size.width;
  options.height = size.height;
  return options;
}

inline Film makeFilm(const SimulatorOptions& options) {
  Simulator simulator(options);
  Film film{simulator.camera(), {}};
  while (auto frame = simulator.next()) film.frames.push_back(*frame);
  return film;
}

/// Rendered once.
inline const Film& slowFilm() {
  static const Film film = makeFilm(filmOptions(6.0));
  return film;
}

/// Largest error of a short film at 320 x 240, over the path. A slow start from rest leaves
/// translation and rotation hard to tell apart, which dominates it.
inline constexpr double kFractionOfPath = 0.02;

inline Tracker slowTracker(const TrackerOptions& options = {}) {
  return Tracker(slowFilm().camera, options);
}

using Frames = std::vector<std::shared_ptr<const TrackedFrame>>;

/// Tracks frames [first, last) of a film.
inline Frames trackFrames(const Film& film, Tracker* tracker, int first, int last) {
  Frames result;
  for (int i = first; i < last; ++i)
    result.push_back(tracker->track(film.frames[i].image, film.frames[i].stamp_s));
  return result;
}

struct PathFit {
  double rms_m;   ///< distance of positions after alignment by a similarity
  double path_m;  ///< true length
  double scale;   ///< metres a map unit
};

/// `frames` are those of the film from `first` on.
inline PathFit fitPath(const Film& film, const Frames& frames, int first = 0) {
  const int n = static_cast<int>(frames.size());
  Eigen::Matrix3Xd estimate(3, n), truth(3, n);
  double path_m = 0.0;
  for (int i = 0; i < n; ++i) {
    estimate.col(i) = frames[i]->camera.position_world;
    truth.col(i) = film.frames[first + i].truth.T_world_camera.translation();
    if (i > 0) path_m += (truth.col(i) - truth.col(i - 1)).norm();
  }
  const Eigen::Matrix4d similarity = Eigen::umeyama(estimate, truth, true);
  const Eigen::Matrix3Xd rest = (similarity.topLeftCorner<3, 3>() * estimate).colwise() +
                                similarity.topRightCorner<3, 1>() - truth;
  return {std::sqrt(rest.colwise().squaredNorm().mean()), path_m,
          similarity.topLeftCorner<3, 1>().norm()};
}

/// Everything a frame says about space is a number.
inline bool isFinite(const TrackedFrame& frame) {
  bool finite =
      frame.camera.position_world.allFinite() && frame.camera.q_world_camera.coeffs().allFinite() &&
      frame.camera.velocity_world.allFinite() && frame.camera.angular_velocity_camera.allFinite() &&
      frame.camera_covariance.allFinite() && std::isfinite(frame.nis);
  for (const TrackedFeature& feature : frame.features)
    finite = finite && feature.position_world.allFinite() && feature.covariance_world.allFinite() &&
             feature.predicted_px.allFinite() && feature.innovation_covariance_px2.allFinite() &&
             feature.matched_px.allFinite() && std::isfinite(feature.score);
  return finite;
}

/// The same numbers, bit for bit.
inline bool sameState(const TrackedFrame& a, const TrackedFrame& b) {
  if (a.state != b.state || a.features.size() != b.features.size()) return false;
  bool same = a.camera.position_world == b.camera.position_world &&
              a.camera.q_world_camera.coeffs() == b.camera.q_world_camera.coeffs() &&
              a.camera.velocity_world == b.camera.velocity_world &&
              a.camera.angular_velocity_camera == b.camera.angular_velocity_camera &&
              a.camera_covariance == b.camera_covariance;
  for (std::size_t i = 0; i < a.features.size(); ++i)
    same = same && a.features[i].id == b.features[i].id &&
           a.features[i].position_world == b.features[i].position_world &&
           a.features[i].covariance_world == b.features[i].covariance_world;
  return same;
}

}  // namespace active_matching_slam
