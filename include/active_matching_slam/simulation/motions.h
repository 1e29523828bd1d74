#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "active_matching_slam/simulation/named_choice.h"
#include "active_matching_slam/simulation/scene.h"

namespace active_matching_slam {

/// constant + rate s + sum of amplitude * sin(rate * s + phase).
class HarmonicSum {
 public:
  void add(double amplitude, double rate_rad_s, double phase_rad);
  void addConstant(double value) { constant_ += value; }
  void addRate(double rate) { rate_ += rate; }
  /// Shifts the sum so that it starts at `value` for s = 0.
  void startAt(double value);
  void scale(double factor);
  double value(double s) const;
  double derivative(double s) const;
  /// Bounds that no value exceeds, of a sum without a rate.
  double lowest() const { return constant_ - totalAmplitude(); }
  double highest() const { return constant_ + totalAmplitude(); }

 private:
  struct Term {
    double amplitude, rate, phase;
  };
  double totalAmplitude() const;
  std::vector<Term> terms_;
  double constant_ = 0.0, rate_ = 0.0;
};

/// Truth of a moving camera at one time.
struct MotionSample {
  Eigen::Isometry3d T_world_camera;         ///< optical frame: x right, y down, z forward
  Eigen::Vector3d velocity_world;           ///< [m/s]
  Eigen::Vector3d angular_velocity_camera;  ///< [rad/s], in the camera frame
};

/// A smooth motion in closed form: position and yaw, pitch, roll are sums of harmonics of a time
/// that starts slowly, so the camera is at rest at t = 0. Immutable.
class Motion {
 public:
  /// Position (start frame, [m]) x, y, z, then yaw (about y), pitch (about x), roll (about z)
  /// [rad].
  using Components = std::array<HarmonicSum, 6>;
  Motion(const Eigen::Isometry3d& T_world_start, const Components& components);

  /// Any t_s; at rest at the start for t_s <= 0.
  MotionSample at(double t_s) const;

 private:
  Eigen::Isometry3d T_world_start_;
  Components components_;
};

const std::vector<NamedChoice>& motionChoices();

/// A motion that stays within the reach of the stage. Throws std::invalid_argument that lists the
/// names for any other name.
Motion createMotion(const std::string& name, const Stage& stage, std::uint64_t seed = 1);

}  // namespace active_matching_slam
