#include "active_matching_slam/tracker/motion_history.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>

#include "active_matching_slam/math/rotation.h"

namespace active_matching_slam {
namespace {

/// A stamp that runs back by less is a late sample; by more, the time is another [s]. Cost: with a
/// clock that was set back nothing is taken for so long.
constexpr double kClockStepS = 1.0;
/// Samples that are kept. Cost: memory; at 1 kHz those of a minute, and recordings of an hour at 50
/// Hz.
constexpr std::size_t kMostSamples = 200000;
/// Of velocities that messages state [m/s, rad/s]. Standard: drivers write 1e3 and more where they
/// measure nothing; larger ones would only lose digits.
constexpr double kMostSigma = 1e3;
/// Stamps that differ by less are the same [s]. Derivation: of seconds since 1970 a double
/// holds 2.4e-7.
constexpr double kSameStampS = 1e-6;

std::string inSeconds(double value_s) {
  std::ostringstream text;
  text.precision(3);
  text << value_s << " s";
  return text.str();
}

/// Appends in order of stamps; see MotionHistory::add().
template <class Sample>
std::string append(const Sample& sample, std::deque<Sample>* samples) {
  if (!std::isfinite(sample.stamp_s)) return "without a stamp: left out";
  if (!samples->empty()) {
    const double back_s = samples->back().stamp_s - sample.stamp_s;
    if (back_s > kClockStepS) {
      samples->clear();
      samples->push_back(sample);
      return "the stamp ran back by " + inSeconds(back_s) + ": what came before is forgotten";
    }
    if (back_s > 0.0) return "late by " + inSeconds(back_s) + ", after a newer one: left out";
    if (back_s == 0.0) return "";  // said twice
  }
  samples->push_back(sample);
  if (samples->size() > kMostSamples) samples->pop_front();
  return "";
}

/// The first sample at or after a time.
template <class Sample>
typename std::deque<Sample>::const_iterator atOrAfter(const std::deque<Sample>& samples,
                                                      double stamp_s) {
  return std::lower_bound(samples.begin(), samples.end(), stamp_s,
                          [](const Sample& s, double t) { return s.stamp_s < t; });
}

/// Why samples do not tell of all of an interval; empty: they do.
template <class Sample>
std::string whatIsMissing(const std::deque<Sample>& samples, double from_s, double to_s,
                          double longest_gap_s) {
  if (samples.empty()) return "none has come";
  const double first_s = samples.front().stamp_s, last_s = samples.back().stamp_s;
  if (last_s < to_s - kSameStampS) {
    const double behind_s = to_s - last_s;
    if (behind_s > std::max(kClockStepS, longest_gap_s))
      return "the newest is " + inSeconds(behind_s) +
             " older than the image: it has stopped, or its clock is another";
    return "none has come since " + inSeconds(behind_s) + " before the image";
  }
  if (first_s > from_s + kSameStampS) {
    const double ahead_s = first_s - from_s;
    if (ahead_s > std::max(kClockStepS, longest_gap_s))
      return "the oldest is " + inSeconds(ahead_s) +
             " newer than the image: it has only begun, or its clock is another";
    return "it begins " + inSeconds(ahead_s) + " after the image before";
  }
  auto next = atOrAfter(samples, from_s);
  if (next == samples.begin()) ++next;
  for (; next != samples.end(); ++next) {
    const double gap_s = next->stamp_s - std::prev(next)->stamp_s;
    if (gap_s > longest_gap_s) {
      const double ahead_s = next->stamp_s - to_s;
      return "a gap of " + inSeconds(gap_s) + " in it" +
             (ahead_s > std::max(kClockStepS, longest_gap_s)
                  ? ", and what follows is " + inSeconds(ahead_s) +
                        " newer than the image: it had stopped, or its clock is another"
                  : "");
    }
    if (next->stamp_s >= to_s) break;
  }
  return "";
}

/// Between two samples, of the nearer one's covariance of velocity.
OdometrySample interpolated(const std::deque<OdometrySample>& samples, double stamp_s) {
  const auto after = atOrAfter(samples, stamp_s);
  if (after == samples.end()) return samples.back();
  if (after == samples.begin() || after->stamp_s == stamp_s) return *after;
  const OdometrySample &a = *std::prev(after), &b = *after;
  const double share = (stamp_s - a.stamp_s) / (b.stamp_s - a.stamp_s);
  OdometrySample sample = b;
  sample.stamp_s = stamp_s;
  sample.T_odom_base.translation() =
      (1.0 - share) * a.T_odom_base.translation() + share * b.T_odom_base.translation();
  sample.T_odom_base.linear() = Eigen::Quaterniond(a.T_odom_base.linear())
                                    .slerp(share, Eigen::Quaterniond(b.T_odom_base.linear()))
                                    .toRotationMatrix();
  sample.pose_covariance = (1.0 - share) * a.pose_covariance + share * b.pose_covariance;
  return sample;
}

Eigen::Vector3d interpolated(const std::deque<GyroSample>& samples, double stamp_s) {
  const auto after = atOrAfter(samples, stamp_s);
  if (after == samples.end()) return samples.back().angular_velocity;
  if (after == samples.begin()) return after->angular_velocity;
  const GyroSample &a = *std::prev(after), &b = *after;
  const double share = (stamp_s - a.stamp_s) / (b.stamp_s - a.stamp_s);
  return (1.0 - share) * a.angular_velocity + share * b.angular_velocity;
}

/// Or left at zero, by which is not stated what it is.
bool isStated(const Matrix6& C) { return C.allFinite() && C.diagonal().minCoeff() >= 0.0; }

bool isCovariance(const Matrix6& C) { return isStated(C) && C.diagonal().maxCoeff() > 0.0; }

}  // namespace

void checkMotionOptions(const MotionOptions& options) {
  checkFields(options);
  checkChoice("motion_prior", options.motion_prior, {"none", "odometry", "gyro"});
}

MotionHistory::MotionHistory(const MotionOptions& options) : options_(options) {
  checkMotionOptions(options);
}

void MotionHistory::setOptions(const MotionOptions& options) {
  checkMotionOptions(options);
  options_ = options;
}

std::string MotionHistory::add(const OdometrySample& sample) {
  const double norm = Eigen::Quaterniond(sample.T_odom_base.linear()).norm();
  if (!sample.T_odom_base.matrix().allFinite() || !(std::abs(norm - 1.0) < 1e-3))
    return "its pose is none: left out";
  if (isStated(sample.pose_covariance) && isStated(sample.twist_covariance))
    return append(sample, &odometry_);
  OdometrySample without = sample;
  for (Matrix6* covariance : {&without.pose_covariance, &without.twist_covariance})
    if (!isStated(*covariance)) covariance->setZero();
  const std::string wrong = append(without, &odometry_);
  return wrong.empty() ? "its covariance is none (negative, or not finite): the options count"
                       : wrong;
}

std::string MotionHistory::add(const GyroSample& sample) {
  if (!sample.angular_velocity.allFinite()) return "its angular velocity is not finite: left out";
  return append(sample, &gyro_);
}

double MotionHistory::newest_s() const {
  if (options_.hasOdometry() && !odometry_.empty()) return odometry_.back().stamp_s;
  if (options_.hasGyro() && !gyro_.empty()) return gyro_.back().stamp_s;
  return -std::numeric_limits<double>::infinity();
}

std::optional<MotionMeasurement> MotionHistory::between(double from_s, double to_s,
                                                        std::string* why) const {
  why->clear();
  if (!(to_s > from_s)) return std::nullopt;
  *why = options_.hasGyro() ? whatIsMissing(gyro_, from_s, to_s, options_.odometry_timeout_s)
                            : whatIsMissing(odometry_, from_s, to_s, options_.odometry_timeout_s);
  if (!why->empty()) return std::nullopt;
  if (!T_base_camera_) {
    *why = "where the camera is on the robot is not known";
    return std::nullopt;
  }
  return options_.hasGyro() ? gyroBetween(from_s, to_s) : odometryBetween(from_s, to_s);
}

/// Of a displacement and rotation in the base's frame at the end: what the messages state, of the
/// velocity or else of the growth of the pose's covariance; of axes without any, by the options.
Matrix6 MotionHistory::covarianceOf(const OdometrySample& from, const OdometrySample& to,
                                    double interval_s, const Eigen::Isometry3d& T_from_to) const {
  const auto square = [](double x) { return x * x; };
  const double way_m = T_from_to.translation().norm();
  const double turn_rad =
      vectorFromRotation(Eigen::Quaterniond(T_from_to.linear()).normalized()).norm();
  Eigen::Matrix<double, 6, 1> by_options;
  by_options.head<3>().setConstant(square(options_.odometry_sigma_m) * way_m);
  by_options.tail<3>().setConstant(square(options_.odometry_sigma_rad) * turn_rad +
                                   square(options_.odometry_sigma_turn_rad) * way_m);
  Matrix6 stated = Matrix6::Zero();
  if (isCovariance(to.twist_covariance)) {
    stated = square(interval_s) * to.twist_covariance;
  } else if (const Matrix6 grown = to.pose_covariance - from.pose_covariance; isCovariance(grown)) {
    Matrix6 R = Matrix6::Zero();
    R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = to.T_odom_base.linear().transpose();
    stated = R * grown * R.transpose();
  }
  Matrix6 C = Matrix6::Zero();
  for (int i = 0; i < 6; ++i) {
    const double most = square(kMostSigma * interval_s);
    C(i, i) = stated(i, i) > 0.0 ? std::min(stated(i, i), most) : by_options[i];
    C(i, i) += square(i < 3 ? options_.odometry_resolution_m : options_.odometry_resolution_rad);
  }
  return C;
}

MotionMeasurement MotionHistory::odometryBetween(double from_s, double to_s) const {
  const double interval_s = to_s - from_s;
  const OdometrySample from = interpolated(odometry_, from_s), to = interpolated(odometry_, to_s);
  const Eigen::Isometry3d T_from_to = from.T_odom_base.inverse() * to.T_odom_base;
  const Eigen::Isometry3d T_camera_base = T_base_camera_->inverse();
  const Eigen::Isometry3d T_start_end = T_camera_base * T_from_to * *T_base_camera_;
  // T_from_to exp(e): the camera's displacement has the error R_start_camera_of_end (t x + I) e.
  const Matrix6 C = covarianceOf(from, to, interval_s, T_from_to);
  const Eigen::Matrix3d R_end = T_camera_base.linear();
  const Eigen::Matrix3d R_start = T_camera_base.linear() * T_from_to.linear();
  Eigen::Matrix<double, 3, 6> J;
  J << R_start, -R_start * skew(T_base_camera_->translation());
  MotionMeasurement motion;
  motion.angular_velocity_camera.mean =
      vectorFromRotation(Eigen::Quaterniond(T_start_end.linear()).normalized()) / interval_s;
  motion.angular_velocity_camera.covariance =
      R_end * C.bottomRightCorner<3, 3>() * R_end.transpose() / (interval_s * interval_s);
  motion.velocity_start.emplace();
  motion.velocity_start->mean = T_start_end.translation() / interval_s;
  motion.velocity_start->covariance = J * C * J.transpose() / (interval_s * interval_s);
  return motion;
}

MotionMeasurement MotionHistory::gyroBetween(double from_s, double to_s) const {
  const double interval_s = to_s - from_s;
  const Eigen::Vector3d first = interpolated(gyro_, from_s), last = interpolated(gyro_, to_s);
  // Linear from sample to sample: each step turns by its mean rate.
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();
  Eigen::Vector3d before = first;
  double before_s = from_s;
  const auto step = [&](double stamp_s, const Eigen::Vector3d& rate) {
    turn = turn * rotationFromVector(0.5 * (stamp_s - before_s) * (before + rate));
    before = rate;
    before_s = stamp_s;
  };
  for (auto it = atOrAfter(gyro_, from_s); it != gyro_.end() && it->stamp_s < to_s; ++it)
    step(it->stamp_s, it->angular_velocity);
  step(to_s, last);
  const Eigen::Matrix3d R_camera_imu = T_base_camera_->linear().transpose();
  const double noise = options_.gyro_sigma_rps * options_.gyro_sigma_rps / interval_s;
  // Read so much later, the interval would have lost at its begin what it gains at its end.
  const Eigen::Vector3d by_stamp =
      R_camera_imu * (last - first) * (options_.gyro_stamp_sigma_s / interval_s);
  MotionMeasurement motion;
  motion.angular_velocity_camera.mean =
      R_camera_imu * vectorFromRotation(turn.normalized()) / interval_s;
  motion.angular_velocity_camera.covariance =
      noise * Eigen::Matrix3d::Identity() + by_stamp * by_stamp.transpose();
  motion.is_biased = true;
  motion.bias_walk_rps = options_.gyro_bias_walk_rps * std::sqrt(interval_s);
  return motion;
}

}  // namespace active_matching_slam
