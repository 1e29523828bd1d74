#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>
#include <vector>

#include "active_matching_slam/math/rotation.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

std::string slipText(const MotionFusion& fusion, double interval_s, const char* what,
                     const char* unit) {
  std::ostringstream text;
  text.precision(2);
  text << what << " is off by " << fusion.innovation * interval_s << " " << unit << ", where "
       << fusion.innovation_sigma * interval_s
       << " is likely: taken for slip (if it goes on: the camera's place on the robot, or the "
          "clock?)";
  return text.str();
}

}  // namespace

/// Whether lengths are in metres. Those of a service are as good as whoever called it: odometry
/// finds the scale anew.
bool Tracker::Implementation::isMetric() const {
  return scale_source_ != ScaleSource::kFree && scale_source_ != ScaleSource::kService;
}

/// Fuses what is known of the motion, after predict().
void Tracker::Implementation::measureMotion() {
  if (!motion_) return;
  motion_report_ = filter_.measureMotion(*motion_, corrected());
  const MotionFusion& rotation = motion_report_.rotation;
  if (motion_report_.translation && motion_report_.translation->inflation > 1.0)
    motion_fault_ =
        slipText(*motion_report_.translation, predicted_interval_s_, "displacement", "m");
  else if (rotation.inflation > 1.0)
    motion_fault_ = slipText(rotation, predicted_interval_s_, "rotation", "rad");
}

/// Variance of the impulses that a jerk allows for. A gyroscope does not slip: what it says of
/// turning holds in a jerk as well.
Eigen::Matrix<double, 6, 1> Tracker::Implementation::widestImpulse() const {
  Eigen::Matrix<double, 6, 1> widest =
      impulseVariance(motion_noise_.widest(), predicted_interval_s_);
  if (motion_ && motion_->is_biased)
    if (const auto impulse = filter_.impulse()) widest.tail<3>() = impulse->tail<3>();
  return widest;
}

/// Learns the accelerations that a constant velocity leaves out: from what was measured of them
/// first, before the image found little left; in a jerk, in which that was wrong, from the image.
void Tracker::Implementation::learnMotion(const UpdateReport& report, const Accelerations& allowed,
                                          bool is_jerk) {
  UpdateReport learnt = report;
  Accelerations taken = allowed;
  if (motion_ && (!is_jerk || motion_->is_biased)) {
    learnt.angular = motion_report_.rotation.impulse;
    taken.angular_rps2 = motion_noise_.expected().angular_rps2;
  }
  if (motion_ && motion_report_.translation && !is_jerk)
    learnt.linear = motion_report_.translation->impulse;
  motion_noise_.learn(learnt, taken, predicted_interval_s_);
}

/// Most of the features in view have become points.
bool Tracker::Implementation::areDepthsKnown() const {
  const std::vector<VisibleFeature> visible = visibleFeatures();
  const auto points = std::count_if(visible.begin(), visible.end(), [this](const auto& feature) {
    return filter_.find(feature.id)->kind == FeatureKind::kPoint;
  });
  return 2 * points > static_cast<std::ptrdiff_t>(visible.size());
}

/// Lengths are not in metres yet, and depths are known well enough to say what is one.
bool Tracker::Implementation::canBecomeMetric() {
  if (isMetric() || !options_.mapping || poor_frames_ > 0 || state_ != TrackingState::kTracking)
    return false;
  if (initialiser_.isDone() || (!initialiser_.areDepthsGuessed() && areDepthsKnown())) return true;
  scale_finder_.reset();  // depths that are corrected correct the way as well
  return false;
}

/// While the scale is free: finds it by how far the odometry has gone meanwhile, and makes the map
/// metric as soon as it is known well enough. What is left of its error is uncertainty of all
/// lengths from there on, which the odometry's displacements go on to correct.
void Tracker::Implementation::findScale(TrackedFrame* frame) {
  if (!motion_ || !unscaled_velocity_ || !canBecomeMetric()) return;
  const CameraState& camera = filter_.camera();
  const double dt = predicted_interval_s_;
  const Eigen::Matrix3d R_start =
      (camera.q_world_camera * rotationFromVector(-camera.angular_velocity_camera * dt))
          .toRotationMatrix();
  const Eigen::Matrix3d P_velocity =
      filter_.cameraCovariance().block<3, 3>(CameraError::kVelocity, CameraError::kVelocity);
  scale_finder_.add({dt * camera.velocity_world, dt * dt * P_velocity},
                    {dt * (R_start * unscaled_velocity_->mean),
                     dt * dt * (R_start * unscaled_velocity_->covariance * R_start.transpose())});
  if (scale_finder_.isContradicted()) {
    motion_fault_ =
        "it goes another way than the camera: is the camera's place on the robot right?";
    scale_finder_.reset();
    return;
  }
  const auto scale = scale_finder_.scale();
  if (!scale) return;
  becomeMetric(1.0 / scale->map_units_per_m, scale->relative_sigma, ScaleSource::kOdometry, frame);
}

/// Takes lengths times `factor` for metres, known to `relative_sigma`.
void Tracker::Implementation::becomeMetric(double factor, double relative_sigma, ScaleSource source,
                                           TrackedFrame* frame) {
  initialiser_.end();  // its adjustment would leave the unit of length free
  frame->rescaled_by = factor;
  rescale(factor);
  submaps_.openTrunk(&filter_);
  filter_.loosenScale(relative_sigma);
  submaps_.closeTrunk(&filter_);
  scale_source_ = source;
  frame->reason =
      "the map is metric from here on: its scale is known by " + scaleSourceName(source);
}

}  // namespace active_matching_slam
