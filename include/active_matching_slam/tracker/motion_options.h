#pragma once

#include <string>

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// What the tracker is told of the camera's motion besides its images. Random errors grow as the
/// root of what they add up over, so that nothing depends on how often it is said.
struct MotionOptions {
  std::string motion_prior = "none";
  double odometry_timeout_s = 0.3;
  double odometry_sigma_m = 0.05;
  double odometry_sigma_rad = 0.05;
  double odometry_sigma_turn_rad = 0.01;
  double odometry_resolution_m = 0.001;
  double odometry_resolution_rad = 0.001;
  double gyro_sigma_rps = 0.001;
  double gyro_bias_sigma_rps = 0.1;
  double gyro_bias_walk_rps = 0.0001;
  double gyro_stamp_sigma_s = 0.002;

  bool hasOdometry() const { return motion_prior == "odometry"; }
  bool hasGyro() const { return motion_prior == "gyro"; }

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void MotionOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("motion_prior", "",
                    "what is known of the motion besides the images: none, odometry (of the robot; "
                    "makes the map metric) or gyro (of an IMU)")
            .atStartOnly(),
        o.motion_prior);
  visit(basicOption("odometry_timeout_s", "s",
                    "how long to wait for odometry or IMU of an image's time, and the longest gap "
                    "in it that is bridged; then constant velocity takes over"),
        o.odometry_timeout_s, 0.0, 10.0);
  visit(advancedOption("motion/odometry_sigma_m", "m",
                       "error of the odometry's displacement after a metre, standard deviation per "
                       "axis; grows as the root of the way. Where its messages state none"),
        o.odometry_sigma_m, 0.0, 10.0);
  visit(advancedOption("motion/odometry_sigma_rad", "rad",
                       "the same of its rotation, after a radian"),
        o.odometry_sigma_rad, 0.0, 3.0);
  visit(advancedOption("motion/odometry_sigma_turn_rad", "rad",
                       "the same of its rotation, after a metre"),
        o.odometry_sigma_turn_rad, 0.0, 3.0);
  visit(advancedOption("motion/odometry_resolution_m", "m",
                       "least error of a displacement from one image to the next"),
        o.odometry_resolution_m, 1e-6, 1.0);
  visit(advancedOption("motion/odometry_resolution_rad", "rad",
                       "least error of a rotation from one image to the next"),
        o.odometry_resolution_rad, 1e-6, 1.0);
  visit(advancedOption("motion/gyro_sigma_rps", "rad/s",
                       "noise of the gyroscope's mean over a second, standard deviation per axis "
                       "(its noise density)"),
        o.gyro_sigma_rps, 1e-6, 1.0);
  visit(advancedOption("motion/gyro_bias_sigma_rps", "rad/s",
                       "how large its bias may be at the start, standard deviation per axis")
            .atStartOnly(),
        o.gyro_bias_sigma_rps, 0.0, 10.0);
  visit(advancedOption("motion/gyro_bias_walk_rps", "rad/s",
                       "by how much its bias changes in a second; grows as the root of time"),
        o.gyro_bias_walk_rps, 0.0, 1.0);
  visit(advancedOption("motion/gyro_stamp_sigma_s", "s",
                       "how well the IMU's stamps agree with the images'"),
        o.gyro_stamp_sigma_s, 0.0, 1.0);
}

/// Throws std::invalid_argument naming the option at fault.
void checkMotionOptions(const MotionOptions& options);

}  // namespace active_matching_slam
