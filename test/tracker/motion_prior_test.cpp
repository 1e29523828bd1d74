// What odometry and a gyroscope make of a film, and what becomes of it without them.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>

#include "active_matching_slam/simulation/robot_sensors.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

/// A room, and what a robot that carries the camera through it would say.
struct RobotFilm {
  Film film;
  std::vector<SimulatedOdometry> odometry;
  std::vector<SimulatedInertial> inertial;
};

RobotFilm makeRobotFilm(const SimulatorOptions& options) {
  const Simulator simulator(options);
  const auto truth = [&](double stamp_s) { return simulator.truthAt(stamp_s); };
  const double begin_s = Simulator::kFirstStampS, end_s = begin_s + options.duration_s;
  RobotSensorOptions sensors;
  return {makeFilm(options), simulateOdometry(truth, begin_s, end_s, sensors),
          simulateInertial(truth, begin_s, end_s, sensors)};
}

const RobotFilm& robotFilm() {
  static const RobotFilm robot = makeRobotFilm(filmOptions(8.0));
  return robot;
}

TrackerOptions withPrior(const std::string& prior) {
  TrackerOptions options;
  options.motion.motion_prior = prior;
  options.initialisation.last_parallax_deg = 0.5;  // a short film
  return options;
}

std::shared_ptr<MotionHistory> historyOf(const RobotFilm& robot, const MotionOptions& options) {
  auto history = std::make_shared<MotionHistory>(options);
  history->setCamera(simulatedCameraOnBase());
  for (const SimulatedOdometry& sample : robot.odometry)
    history->add(
        OdometrySample{sample.stamp_s, sample.T_odom_base, Matrix6::Zero(), Matrix6::Zero()});
  for (const SimulatedInertial& sample : robot.inertial)
    history->add(GyroSample{sample.stamp_s, sample.angular_velocity});
  return history;
}

Frames trackRobot(const RobotFilm& robot, const TrackerOptions& options) {
  Tracker tracker(robot.film.camera, options);
  tracker.setMotionHistory(historyOf(robot, options.motion));
  return trackFrames(robot.film, &tracker, 0, static_cast<int>(robot.film.frames.size()));
}

const Frames& framesByOdometry() {
  static const Frames frames = trackRobot(robotFilm(), withPrior("odometry"));
  return frames;
}

/// The frames whose lengths are in metres.
Frames metric(const Frames& frames, int* first) {
  *first = 0;
  while (*first < static_cast<int>(frames.size()) &&
         frames[*first]->scale_source != ScaleSource::kOdometry)
    ++*first;
  return Frames(frames.begin() + *first, frames.end());
}

TEST(MotionPrior, OdometryMakesTheMapMetric) {
  const Frames& frames = framesByOdometry();
  int first = 0;
  const Frames in_metres = metric(frames, &first);
  ASSERT_GT(in_metres.size(), frames.size() / 2);
  const PathFit fit = fitPath(robotFilm().film, in_metres, first);
  EXPECT_NEAR(fit.scale, 1.0, 0.02);
  EXPECT_LT(fit.rms_m, kFractionOfPath * fit.path_m);
  const TrackedFrame& last = *frames.back();
  EXPECT_GT(last.scale_sigma, 0.0);
  EXPECT_LT(last.scale_sigma, 0.05);
  EXPECT_LT(std::abs(fit.scale - 1.0), 4.0 * last.scale_sigma);
  EXPECT_EQ(last.motion_source, "odometry");
  EXPECT_EQ(scaleSourceName(last.scale_source), "odometry");
}

TEST(MotionPrior, AllLengthsAreRescaledOnceAndSaidSo) {
  int rescaled = 0;
  const Frames& frames = framesByOdometry();
  for (std::size_t i = 1; i < frames.size(); ++i) {
    if (frames[i]->rescaled_by == 1.0) continue;
    ++rescaled;
    EXPECT_EQ(frames[i - 1]->scale_source, ScaleSource::kFree);
    EXPECT_EQ(frames[i]->scale_source, ScaleSource::kOdometry);
    const double before = frames[i - 1]->camera.position_world.norm();
    EXPECT_NEAR(frames[i]->camera.position_world.norm(), frames[i]->rescaled_by * before,
                0.2 * frames[i]->rescaled_by * before);
  }
  EXPECT_EQ(rescaled, 1);
}

TEST(MotionPrior, AGyroscopeHalvesTheGatesOfAHastyHand) {
  SimulatorOptions options = filmOptions(4.0);
  options.motion = "jerky";
  const RobotFilm robot = makeRobotFilm(options);
  const Frames by_gyro = trackRobot(robot, withPrior("gyro"));
  const Frames by_images = trackRobot(robot, TrackerOptions());
  double gates_by_gyro = 0.0, gates_by_images = 0.0;
  for (std::size_t i = 0; i < by_gyro.size(); ++i) {
    EXPECT_EQ(by_gyro[i]->state, TrackingState::kTracking);
    if (i < 30) continue;  // the start, in which nothing is known of depths
    gates_by_gyro += by_gyro[i]->matching.statistics.pixels_full_gates;
    gates_by_images += by_images[i]->matching.statistics.pixels_full_gates;
  }
  EXPECT_LT(gates_by_gyro, 0.5 * gates_by_images);
}

TEST(MotionPrior, TheBiasOfAGyroscopeIsFound) {
  const Frames by_gyro = trackRobot(robotFilm(), withPrior("gyro"));
  ASSERT_TRUE(by_gyro.back()->camera.gyro_bias_rps);
  const RobotSensorOptions sensors;
  EXPECT_NEAR(by_gyro.back()->camera.gyro_bias_rps->norm(), std::sqrt(3.0) * sensors.gyro_bias_rps,
              0.2 * sensors.gyro_bias_rps);
}

TEST(MotionPrior, ABlackoutOfASecondIsBridgedByOdometry) {
  const RobotFilm& robot = robotFilm();
  for (const int dark : {110, 170}) {
    Tracker tracker(robot.film.camera, withPrior("odometry"));
    tracker.setMotionHistory(historyOf(robot, tracker.options().motion));
    const cv::Mat black = cv::Mat::zeros(robot.film.frames[0].image.size(), CV_8UC1);
    std::shared_ptr<const TrackedFrame> last;
    for (int i = 0; i < dark + 40; ++i) {
      const SimulatedFrame& frame = robot.film.frames[i];
      // Not twice the same picture.
      cv::Mat dim = black + cv::Scalar(i % 2);
      last = tracker.track(i >= dark && i < dark + 30 ? dim : frame.image, frame.stamp_s);
      if (i > 60) EXPECT_EQ(last->state, TrackingState::kTracking) << i << ": " << last->reason;
    }
    EXPECT_EQ(last->times_lost, 0);
    EXPECT_EQ(last->resets, 0);
    EXPECT_EQ(last->map, 0);
  }
}

TEST(MotionPrior, WithoutWhatItAsksForNothingIsOtherwise) {
  const RobotFilm& robot = robotFilm();
  Tracker plain(robot.film.camera, withPrior("none"));
  Tracker alone(robot.film.camera, withPrior("odometry"));
  Tracker starved(robot.film.camera, withPrior("odometry"));
  starved.setMotionHistory(std::make_shared<MotionHistory>(starved.options().motion));
  for (int i = 0; i < 60; ++i) {
    const SimulatedFrame& frame = robot.film.frames[i];
    const auto expected = plain.track(frame.image, frame.stamp_s);
    EXPECT_TRUE(sameState(*expected, *alone.track(frame.image, frame.stamp_s))) << i;
    const auto frame_of_starved = starved.track(frame.image, frame.stamp_s);
    EXPECT_TRUE(sameState(*expected, *frame_of_starved)) << i;
    EXPECT_EQ(frame_of_starved->motion_source, "");
    if (i > 0) EXPECT_NE(frame_of_starved->motion_fault, "");
  }
}

TEST(MotionPrior, OdometryThatStopsLeavesTheMapMetricAndIsMissed) {
  const RobotFilm& robot = robotFilm();
  const MotionOptions options = withPrior("odometry").motion;
  auto history = std::make_shared<MotionHistory>(options);
  history->setCamera(simulatedCameraOnBase());
  Tracker tracker(robot.film.camera, withPrior("odometry"));
  tracker.setMotionHistory(history);
  std::size_t given = 0;
  std::shared_ptr<const TrackedFrame> last;
  for (const SimulatedFrame& frame : robot.film.frames) {
    for (; given < robot.odometry.size() && robot.odometry[given].stamp_s < 7.0; ++given)
      history->add(OdometrySample{robot.odometry[given].stamp_s, robot.odometry[given].T_odom_base,
                                  Matrix6::Zero(), Matrix6::Zero()});
    last = tracker.track(frame.image, frame.stamp_s);
  }
  EXPECT_EQ(last->state, TrackingState::kTracking);
  EXPECT_EQ(last->scale_source, ScaleSource::kOdometry);
  EXPECT_EQ(last->motion_source, "");
  EXPECT_NE(last->motion_fault, "");
}

TEST(MotionPrior, ACameraThatIsElsewhereOnTheRobotThanSaidIsNotMadeMetric) {
  const RobotFilm& robot = robotFilm();
  auto history = historyOf(robot, withPrior("odometry").motion);
  Eigen::Isometry3d turned = simulatedCameraOnBase();
  turned.linear() = turned.linear() * Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitZ());
  history->setCamera(turned);
  Tracker tracker(robot.film.camera, withPrior("odometry"));
  tracker.setMotionHistory(history);
  bool is_told = false;
  std::shared_ptr<const TrackedFrame> last;
  for (const SimulatedFrame& frame : robot.film.frames) {
    last = tracker.track(frame.image, frame.stamp_s);
    is_told |= last->motion_fault.find("camera's place on the robot") != std::string::npos;
    EXPECT_TRUE(isFinite(*last));
  }
  EXPECT_TRUE(is_told);
}

}  // namespace
}  // namespace active_matching_slam
