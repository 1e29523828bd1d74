/// simulate_bag: renders a camera that moves through a textured scene into a bag, with camera_info
/// and exact ground truth as tf, as a pose topic and as a text file.

#include <boost/program_options.hpp>
#include <cstdio>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "active_matching_slam/simulation/robot_sensors.h"
#include "active_matching_slam/simulation/simulator.h"
#include "camera_bag_writer.h"
#include "common/progress_bar.h"
#include "common/tool_main.h"

namespace ams = active_matching_slam;
namespace po = boost::program_options;

namespace {

struct Arguments {
  ams::SimulatorOptions simulator;
  ams::RobotSensorOptions sensors;
  std::string output;
  bool odometry = false, imu = false;
  bool show_help = false;
  bool show_list = false;
};

/// A file under a temporary name that takes its place only when it is complete.
class PendingFile {
 public:
  explicit PendingFile(const std::string& path) : path_(path), pending_(path + ".part") {}
  ~PendingFile() {
    if (!done_) std::remove(pending_.c_str());
  }
  PendingFile(const PendingFile&) = delete;
  PendingFile& operator=(const PendingFile&) = delete;

  const std::string& pending() const { return pending_; }
  void commit() {
    if (std::rename(pending_.c_str(), path_.c_str()) != 0)
      throw std::runtime_error("cannot write '" + path_ + "'");
    done_ = true;
  }

 private:
  std::string path_, pending_;
  bool done_ = false;
};

void parseSize(const std::string& text, int& width, int& height) {
  char rest = 0;
  if (std::sscanf(text.c_str(), "%dx%d%c", &width, &height, &rest) != 2)
    throw std::invalid_argument("size is '" + text +
                                "', must be WIDTHxHEIGHT, for example 640x480");
}

po::options_description describeOptions(Arguments& a, std::string& size) {
  ams::SimulatorOptions& s = a.simulator;
  po::options_description options("simulate_bag --output X.bag [options]");
  options.add_options()                                                       //
      ("help,h", po::bool_switch(&a.show_help), "show this text")             //
      ("list", po::bool_switch(&a.show_list), "list the scenes and motions")  //
      ("output,o", po::value(&a.output),
       "the bag; X.groundtruth.txt and X.camera.yaml go along")                             //
      ("scene", po::value(&s.scene)->default_value(s.scene), "see --list")                  //
      ("motion", po::value(&s.motion)->default_value(s.motion), "see --list")               //
      ("size", po::value(&size)->default_value(size), "of the image, WxH [px]")             //
      ("rate", po::value(&s.rate_hz)->default_value(s.rate_hz), "frames a second")          //
      ("seconds", po::value(&s.duration_s)->default_value(s.duration_s), "length")          //
      ("seed", po::value(&s.seed)->default_value(s.seed), "of textures, motion and noise")  //
      ("distortion", po::value(&s.distortion)->default_value(s.distortion),
       "none, plumb_bob, rational_polynomial or equidistant")                                    //
      ("exposure-ms", po::value(&s.exposure_ms)->default_value(s.exposure_ms), "motion blur")    //
      ("noise", po::value(&s.noise)->default_value(s.noise), "sigma at mid-grey [grey levels]")  //
      ("drift", po::value(&s.drift)->default_value(s.drift),
       "slow changes of the light, 0 to 0.9")  //
      ("auto-exposure", po::value(&s.auto_exposure)->default_value(s.auto_exposure),
       "1: the gain follows the image, 0: it is fixed")  //
      ("vignetting", po::value(&s.vignetting)->default_value(s.vignetting),
       "loss in the corners")  //
      ("readout-ms", po::value(&s.readout_ms)->default_value(s.readout_ms),
       "rolling shutter: first to last row")                                 //
      ("occluder", po::bool_switch(&s.occluder), "a hand crosses the view")  //
      ("odometry", po::bool_switch(&a.odometry),
       "also /odom of a robot that carries the camera, with noise and a slip, and /tf_static")  //
      ("slip-m", po::value(&a.sensors.slip_m)->default_value(a.sensors.slip_m),
       "of the odometry, once, half way through [m]")                                     //
      ("imu", po::bool_switch(&a.imu), "also /imu, with noise and bias, and /tf_static")  //
      ("gyro-bias", po::value(&a.sensors.gyro_bias_rps)->default_value(a.sensors.gyro_bias_rps),
       "of the IMU, per axis, of either sign [rad/s]");
  return options;
}

Arguments parseArguments(int argc, char** argv) {
  Arguments arguments;
  std::string size = "640x480";
  const po::options_description options = describeOptions(arguments, size);
  po::variables_map values = ams::readArguments(argc, argv, options);
  po::notify(values);
  if (arguments.show_help) std::cout << options << '\n';
  parseSize(size, arguments.simulator.width, arguments.simulator.height);
  if (!arguments.show_help && !arguments.show_list && arguments.output.empty())
    throw std::invalid_argument("--output is missing: the bag to write");
  return arguments;
}

void printChoices() {
  const auto print = [](const char* title, const std::vector<ams::NamedChoice>& choices) {
    std::cout << title << '\n';
    for (const ams::NamedChoice& choice : choices)
      std::cout << "  " << std::left << std::setw(14) << choice.name << choice.description << '\n';
  };
  print("scenes", ams::sceneChoices());
  print("motions", ams::motionChoices());
}

void writeMatrix(std::ostream& out, const std::string& name, int rows, int columns,
                 const double* values) {
  out << name << ":\n  rows: " << rows << "\n  cols: " << columns << "\n  data: [";
  for (int i = 0; i < rows * columns; ++i) out << (i > 0 ? ", " : "") << values[i];
  out << "]\n";
}

/// The file that camera_calibration writes and camera_info_manager reads.
void writeCameraYaml(const std::string& path, const ams::CameraCalibration& calibration) {
  const sensor_msgs::CameraInfo info = ams::toCameraInfoMsg(calibration);
  std::ofstream out(path);
  out << std::setprecision(17) << "image_width: " << info.width << "\nimage_height: " << info.height
      << "\ncamera_name: " << calibration.name << '\n';
  writeMatrix(out, "camera_matrix", 3, 3, info.K.data());
  out << "distortion_model: " << info.distortion_model << '\n';
  writeMatrix(out, "distortion_coefficients", 1, static_cast<int>(info.D.size()), info.D.data());
  writeMatrix(out, "rectification_matrix", 3, 3, info.R.data());
  writeMatrix(out, "projection_matrix", 3, 4, info.P.data());
  if (!out.flush()) throw std::runtime_error("cannot write '" + path + "'");
}

void writeTumLine(std::ostream& out, const ros::Time& stamp,
                  const Eigen::Isometry3d& T_world_camera) {
  const Eigen::Vector3d p = T_world_camera.translation();
  const Eigen::Quaterniond q(T_world_camera.rotation());
  char seconds[32];
  std::snprintf(seconds, sizeof(seconds), "%u.%09u", stamp.sec, stamp.nsec);
  out << seconds << ' ' << p.x() << ' ' << p.y() << ' ' << p.z() << ' ' << q.x() << ' ' << q.y()
      << ' ' << q.z() << ' ' << q.w() << '\n';
}

/// X of X.bag.
std::string stemOf(const std::string& bag) {
  const std::string extension = ".bag";
  const bool has = bag.size() > extension.size() &&
                   bag.compare(bag.size() - extension.size(), extension.size(), extension) == 0;
  return has ? bag.substr(0, bag.size() - extension.size()) : bag;
}

std::string describe(const ams::SimulatorOptions& options) {
  return "scene " + options.scene + ", motion " + options.motion + ", seed " +
         std::to_string(options.seed);
}

/// What the robot's sensors say up to a stamp, between the images.
class SensorWriter {
 public:
  SensorWriter(const Arguments& arguments, const ams::Simulator& simulator) {
    ams::RobotSensorOptions options = arguments.sensors;
    options.seed = arguments.simulator.seed;
    const auto truth = [&simulator](double stamp_s) { return simulator.truthAt(stamp_s); };
    const double begin_s = ams::Simulator::kFirstStampS;
    const double end_s = begin_s + simulator.frameCount() / arguments.simulator.rate_hz;
    if (arguments.odometry) odometry_ = ams::simulateOdometry(truth, begin_s, end_s, options);
    if (arguments.imu) inertial_ = ams::simulateInertial(truth, begin_s, end_s, options);
  }
  void writeUntil(double stamp_s, ams::CameraBagWriter* bag) {
    if (odometry_written_ + inertial_written_ == 0 && !(odometry_.empty() && inertial_.empty()))
      bag->writeExtrinsics(ros::Time(stamp_s), ams::simulatedCameraOnBase());
    for (; odometry_written_ < odometry_.size(); ++odometry_written_) {
      const ams::SimulatedOdometry& sample = odometry_[odometry_written_];
      if (sample.stamp_s > stamp_s) break;
      bag->writeOdometry(ros::Time(sample.stamp_s), sample.T_odom_base);
    }
    for (; inertial_written_ < inertial_.size(); ++inertial_written_) {
      const ams::SimulatedInertial& sample = inertial_[inertial_written_];
      if (sample.stamp_s > stamp_s) break;
      bag->writeImu(ros::Time(sample.stamp_s), sample.angular_velocity, sample.acceleration);
    }
  }

 private:
  std::vector<ams::SimulatedOdometry> odometry_;
  std::vector<ams::SimulatedInertial> inertial_;
  std::size_t odometry_written_ = 0, inertial_written_ = 0;
};

void simulate(const Arguments& arguments) {
  ams::Simulator simulator(arguments.simulator);
  const ams::CameraCalibration& calibration = simulator.camera().calibration();
  const std::string stem = stemOf(arguments.output);
  ams::CameraBagWriter bag(arguments.output, calibration, "camera");
  PendingFile truth_file(stem + ".groundtruth.txt"), camera_file(stem + ".camera.yaml");
  writeCameraYaml(camera_file.pending(), calibration);
  std::ofstream truth(truth_file.pending());
  truth << std::setprecision(12)
        << "# stamp_s x y z qx qy qz qw: the camera's optical frame in the world [m]\n";

  SensorWriter sensors(arguments, simulator);
  ams::ProgressBar progress("simulate_bag", simulator.frameCount());
  while (const auto frame = simulator.next()) {
    const ros::Time stamp(frame->stamp_s);
    if (frame->index == 0) bag.writeSimulation(stamp, describe(arguments.simulator));
    sensors.writeUntil(frame->stamp_s, &bag);
    bag.writeTruth(stamp, frame->truth.T_world_camera);
    bag.writeImage(stamp, frame->image);
    writeTumLine(truth, stamp, frame->truth.T_world_camera);
    progress.advance(frame->index + 1, "");
  }
  sensors.writeUntil(std::numeric_limits<double>::infinity(), &bag);
  if (!truth.flush()) throw std::runtime_error("cannot write '" + stem + ".groundtruth.txt'");
  truth_file.commit();
  camera_file.commit();
  bag.close();
}

}  // namespace

int main(int argc, char** argv) {
  return ams::runTool("simulate_bag", [&] {
    const Arguments arguments = parseArguments(argc, argv);
    if (arguments.show_list) printChoices();
    if (!arguments.show_help && !arguments.show_list) simulate(arguments);
    return 0;
  });
}
