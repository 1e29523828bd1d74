// A folder of images or a video, a calibration and, where known, the true poses, to a bag that the
// tracker plays without any remapping.

#include <boost/filesystem.hpp>
#include <boost/program_options.hpp>
#include <cctype>
#include <cmath>
#include <fstream>
#include <iostream>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_calibration.h"
#include "camera_bag_writer.h"
#include "common/tool_main.h"

namespace active_matching_slam {
namespace {

namespace fs = boost::filesystem;
namespace po = boost::program_options;

struct Settings {
  std::string images, times, camera_info, ground_truth, odometry, imu, output, frame_id;
  std::vector<double> extrinsics;  ///< X Y Z QX QY QZ QW, or none
  double rate_hz = 0.0;
  bool grey = false, compressed = false;
};

struct TimedName {
  ros::Time stamp;
  std::string name;  ///< may be empty: the order decides
};

struct TimedPose {
  ros::Time stamp;
  Eigen::Isometry3d T_world_child;
};

struct TimedInertial {
  ros::Time stamp;
  Eigen::Vector3d angular_velocity, acceleration;
};

[[noreturn]] void fail(const std::string& what) { throw std::runtime_error(what); }

/// Decimal seconds, exact to the nanosecond (a double is not, for seconds since 1970).
ros::Time parseStamp(const std::string& text, const std::string& where) {
  const std::size_t dot = std::min(text.find('.'), text.size());
  const std::string whole = text.substr(0, dot);
  const std::string fraction = dot < text.size() ? text.substr(dot + 1) : "";
  const auto digits = [](const std::string& part) {
    return std::all_of(part.begin(), part.end(), [](unsigned char c) { return std::isdigit(c); });
  };
  if (digits(whole) && digits(fraction) && !whole.empty() && whole.size() <= 10 &&
      std::stoull(whole) <= 0xFFFFFFFFull) {
    const std::string nanoseconds = (fraction + "000000000").substr(0, 9);
    return ros::Time(static_cast<std::uint32_t>(std::stoull(whole)),
                     static_cast<std::uint32_t>(std::stoul(nanoseconds)));
  }
  std::istringstream stream(text);
  double seconds = -1.0;
  if (!(stream >> seconds) || !stream.eof() || !(seconds >= 0.0 && seconds < 4294967295.0))
    fail(where + ": '" + text + "' is not a time in seconds from 0 to 4294967295");
  return ros::Time(seconds);
}

/// Calls `use(words, place)` for each line that holds something else than a comment.
template <typename Use>
void forEachLine(const std::string& path, Use use) {
  std::ifstream file(path);
  if (!file) fail(path + ": cannot be read");
  std::string line;
  for (int number = 1; std::getline(file, line); ++number) {
    std::istringstream stream(line.substr(0, line.find('#')));
    std::vector<std::string> words;
    for (std::string word; stream >> word;) words.push_back(word);
    if (!words.empty()) use(words, path + " line " + std::to_string(number));
  }
}

std::vector<TimedName> readTimes(const std::string& path) {
  std::vector<TimedName> times;
  forEachLine(path, [&](const std::vector<std::string>& words, const std::string& place) {
    times.push_back({parseStamp(words[0], place), words.size() > 1 ? words[1] : ""});
    if (times.size() > 1 && times.back().stamp < times[times.size() - 2].stamp)
      fail(place + ": time runs back");
  });
  if (times.empty()) fail(path + ": holds no times");
  return times;
}

double parseNumber(const std::string& text, const std::string& place) {
  char* end = nullptr;
  const double value = std::strtod(text.c_str(), &end);
  if (*end != '\0' || !std::isfinite(value)) fail(place + ": '" + text + "' is not a number");
  return value;
}

/// stamp,wx,wy,wz,ax,ay,az; a first line of names is passed over.
std::vector<TimedInertial> readInertial(const std::string& path) {
  std::vector<TimedInertial> samples;
  bool is_first = true;
  forEachLine(path, [&](const std::vector<std::string>& words, const std::string& place) {
    std::string line;
    for (const std::string& word : words) line += word;
    std::vector<std::string> cells;
    std::istringstream stream(line);
    for (std::string cell; std::getline(stream, cell, ',');) cells.push_back(cell);
    const bool is_header = is_first && !cells.empty() && !cells[0].empty() &&
                           std::isalpha(static_cast<unsigned char>(cells[0][0]));
    is_first = false;
    if (is_header) return;
    if (cells.size() != 7) fail(place + ": must hold 7 numbers, stamp,wx,wy,wz,ax,ay,az");
    TimedInertial sample;
    sample.stamp = parseStamp(cells[0], place);
    for (int i = 0; i < 3; ++i) {
      sample.angular_velocity[i] = parseNumber(cells[i + 1], place);
      sample.acceleration[i] = parseNumber(cells[i + 4], place);
    }
    samples.push_back(sample);
  });
  if (samples.empty()) fail(path + ": holds no measurements");
  std::stable_sort(
      samples.begin(), samples.end(),
      [](const TimedInertial& a, const TimedInertial& b) { return a.stamp < b.stamp; });
  return samples;
}

/// TUM format: t tx ty tz qx qy qz qw.
std::vector<TimedPose> readPoses(const std::string& path) {
  std::vector<TimedPose> poses;
  forEachLine(path, [&](const std::vector<std::string>& words, const std::string& place) {
    if (words.size() != 8) fail(place + ": must hold 8 numbers, t tx ty tz qx qy qz qw");
    double v[7];
    for (int i = 0; i < 7; ++i) v[i] = parseNumber(words[i + 1], place);
    const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    if (std::abs(q.norm() - 1.0) > 0.01) fail(place + ": the quaternion does not have unit length");
    TimedPose pose{parseStamp(words[0], place), Eigen::Isometry3d::Identity()};
    pose.T_world_child.linear() = q.normalized().toRotationMatrix();
    pose.T_world_child.translation() << v[0], v[1], v[2];
    poses.push_back(pose);
  });
  if (poses.empty()) fail(path + ": holds no poses");
  std::stable_sort(poses.begin(), poses.end(),
                   [](const TimedPose& a, const TimedPose& b) { return a.stamp < b.stamp; });
  return poses;
}

/// Frames in order, each empty Mat once at the end.
class FrameSource {
 public:
  virtual ~FrameSource() = default;
  virtual cv::Mat next() = 0;
  virtual std::string current() const = 0;  ///< names the frame that next() returned last
};

class VideoSource : public FrameSource {
 public:
  explicit VideoSource(const std::string& path) : path_(path), video_(path) {
    if (!video_.isOpened()) fail(path + ": is neither a folder nor a video that can be read");
  }
  cv::Mat next() override {
    cv::Mat image;
    video_.read(image);
    if (!image.empty()) ++index_;
    return image;
  }
  std::string current() const override { return path_ + " frame " + std::to_string(index_); }

 private:
  std::string path_;
  cv::VideoCapture video_;
  int index_ = -1;
};

class FolderSource : public FrameSource {
 public:
  explicit FolderSource(std::vector<fs::path> paths) : paths_(std::move(paths)) {}
  cv::Mat next() override {
    if (index_ + 1 >= static_cast<int>(paths_.size())) return {};
    const std::string path = paths_[++index_].string();
    const cv::Mat image = cv::imread(path, cv::IMREAD_ANYDEPTH | cv::IMREAD_ANYCOLOR);
    if (image.empty()) fail(path + ": is not an image that can be read");
    return image;
  }
  std::string current() const override { return paths_[index_].string(); }

 private:
  std::vector<fs::path> paths_;
  int index_ = -1;
};

/// Order in which people count: frame2 before frame10.
bool naturalOrder(const std::string& a, const std::string& b) {
  std::size_t i = 0, j = 0;
  const auto isDigit = [](char c) { return std::isdigit(static_cast<unsigned char>(c)) != 0; };
  const auto number = [&](const std::string& text, std::size_t* at) {
    while (*at < text.size() && text[*at] == '0') ++*at;
    const std::size_t start = *at;
    while (*at < text.size() && isDigit(text[*at])) ++*at;
    return text.substr(start, *at - start);
  };
  while (i < a.size() && j < b.size()) {
    if (isDigit(a[i]) && isDigit(b[j])) {
      const std::string x = number(a, &i), y = number(b, &j);
      if (x != y) return x.size() != y.size() ? x.size() < y.size() : x < y;
    } else {
      if (a[i] != b[j]) return a[i] < b[j];
      ++i, ++j;
    }
  }
  return a.size() - i != b.size() - j ? a.size() - i < b.size() - j : a < b;
}

std::vector<fs::path> imagesOfFolder(const fs::path& folder) {
  std::vector<fs::path> paths;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    if (fs::is_regular_file(entry.path()) && cv::haveImageReader(entry.path().string()))
      paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end(), [](const fs::path& a, const fs::path& b) {
    return naturalOrder(a.filename().string(), b.filename().string());
  });
  if (paths.empty()) fail(folder.string() + ": holds no images");
  return paths;
}

/// A name in a times file may be relative to the folder of images or to the times file.
fs::path findImage(const std::string& name, const fs::path& folder, const fs::path& times_folder) {
  const fs::path candidates[] = {folder / name, times_folder / name,
                                 folder / fs::path(name).filename()};
  for (const fs::path& candidate : candidates)
    if (fs::is_regular_file(candidate)) return candidate;
  fail(candidates[0].string() + ": no such image");
}

std::unique_ptr<FrameSource> openFolder(const Settings& settings,
                                        const std::vector<TimedName>& times) {
  const bool named = !times.empty() && !times[0].name.empty();
  if (!named) return std::make_unique<FolderSource>(imagesOfFolder(settings.images));
  std::vector<fs::path> paths;
  for (const TimedName& time : times)
    paths.push_back(findImage(time.name, settings.images, fs::path(settings.times).parent_path()));
  return std::make_unique<FolderSource>(std::move(paths));
}

/// To one of the encodings that the bag writer knows.
cv::Mat toWritable(const cv::Mat& image, bool grey) {
  cv::Mat result = image;
  if (result.depth() != CV_8U && !(result.type() == CV_16UC1 && !grey))
    result.convertTo(result, CV_8U, result.depth() == CV_16U ? 1.0 / 257.0 : 1.0);
  if (grey && result.channels() == 3) cv::cvtColor(result, result, cv::COLOR_BGR2GRAY);
  return result;
}

std::optional<Eigen::Isometry3d> extrinsicsOf(const Settings& settings) {
  if (settings.extrinsics.empty()) return std::nullopt;
  const std::vector<double>& v = settings.extrinsics;
  if (v.size() != 7)
    fail("--extrinsics has " + std::to_string(v.size()) + " numbers, must be X Y Z QX QY QZ QW");
  const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
  if (!(std::abs(q.norm() - 1.0) < 0.01)) fail("--extrinsics: the quaternion has no unit length");
  Eigen::Isometry3d T_base_camera = Eigen::Isometry3d::Identity();
  T_base_camera.linear() = q.normalized().toRotationMatrix();
  T_base_camera.translation() << v[0], v[1], v[2];
  return T_base_camera;
}

void convert(const Settings& settings) {
  const CameraCalibration calibration = readCalibrationYaml(settings.camera_info);
  for (const std::string& doubt : calibrationDoubts(calibration))
    std::cerr << "images_to_bag: " << settings.camera_info
              << ": this calibration can hardly be right: " << doubt << "\n";
  const std::vector<TimedName> times =
      settings.times.empty() ? std::vector<TimedName>() : readTimes(settings.times);
  const std::vector<TimedPose> truth =
      settings.ground_truth.empty() ? std::vector<TimedPose>() : readPoses(settings.ground_truth);
  const std::vector<TimedPose> odometry =
      settings.odometry.empty() ? std::vector<TimedPose>() : readPoses(settings.odometry);
  const std::vector<TimedInertial> imu =
      settings.imu.empty() ? std::vector<TimedInertial>() : readInertial(settings.imu);
  const std::optional<Eigen::Isometry3d> T_base_camera = extrinsicsOf(settings);
  if (!fs::exists(settings.images)) fail(settings.images + ": does not exist");
  const std::unique_ptr<FrameSource> source = fs::is_directory(settings.images)
                                                  ? openFolder(settings, times)
                                                  : std::make_unique<VideoSource>(settings.images);

  CameraBagWriter writer(settings.output, calibration, settings.frame_id, settings.compressed);
  std::size_t frames = 0, poses = 0, moved = 0, inertial = 0;
  ros::Time first, last;
  const auto writePosesUntil = [&](const ros::Time& stamp) {
    for (; poses < truth.size() && truth[poses].stamp <= stamp; ++poses)
      writer.writeTruth(truth[poses].stamp, truth[poses].T_world_child);
    for (; moved < odometry.size() && odometry[moved].stamp <= stamp; ++moved)
      writer.writeOdometry(odometry[moved].stamp, odometry[moved].T_world_child);
    for (; inertial < imu.size() && imu[inertial].stamp <= stamp; ++inertial)
      writer.writeImu(imu[inertial].stamp, imu[inertial].angular_velocity,
                      imu[inertial].acceleration);
  };
  for (cv::Mat image; !(image = source->next()).empty(); ++frames) {
    if (!times.empty() && frames == times.size())
      fail(settings.times + ": has " + std::to_string(frames) +
           " times, but there are more images");
    if (image.cols != calibration.width || image.rows != calibration.height)
      fail(source->current() + ": is " + std::to_string(image.cols) + "x" +
           std::to_string(image.rows) + ", but " + settings.camera_info + " says " +
           std::to_string(calibration.width) + "x" + std::to_string(calibration.height));
    last = times.empty() ? ros::Time(static_cast<double>(frames) / settings.rate_hz)
                         : times[frames].stamp;
    if (frames == 0) first = last;
    if (frames == 0 && T_base_camera) writer.writeExtrinsics(first, *T_base_camera);
    writePosesUntil(last);
    writer.writeImage(last, toWritable(image, settings.grey));
  }
  if (frames < times.size())
    fail(settings.times + ": has " + std::to_string(times.size()) + " times, but there are " +
         std::to_string(frames) + " images");
  if (frames == 0) fail(settings.images + ": holds no images");
  writePosesUntil(ros::TIME_MAX);
  writer.close();
  std::cout << settings.output << ": " << frames << " images " << calibration.width << "x"
            << calibration.height << ", " << (last - first).toSec() << " s, " << poses
            << " true poses";
  if (moved > 0) std::cout << ", " << moved << " of odometry";
  if (inertial > 0) std::cout << ", " << inertial << " of an IMU";
  std::cout << "\n";
}

/// False when the help was asked for and printed.
bool parse(int argc, char** argv, Settings* settings) {
  po::options_description options(
      "images_to_bag --images DIR_OR_VIDEO --times times.txt|--rate HZ --camera-info camera.yaml\n"
      "              [--ground-truth groundtruth.txt] [--odometry odometry.txt] [--imu imu.csv]\n"
      "              [--extrinsics X Y Z QX QY QZ QW] --output X.bag\n\nOptions");
  const auto text = [](std::string* value) { return po::value<std::string>(value); };
  options.add_options()("help,h", "this text")("images", text(&settings->images)->required(),
                                               "folder of images, or a video")(
      "times", text(&settings->times),
      "'seconds [file]' a line; without file names, in the order of the frames")(
      "rate", po::value<double>(&settings->rate_hz), "frames a second, counted from time 0")(
      "camera-info", text(&settings->camera_info)->required(),
      "calibration, as camera_calibration writes it")(
      "ground-truth", text(&settings->ground_truth),
      "true poses of the camera (optical frame) in the world, TUM format: 't x y z qx qy qz qw'; "
      "written to /tf (world -> camera_ground_truth) and /ground_truth/pose")(
      "odometry", text(&settings->odometry),
      "poses of the robot's base by its odometry, TUM format; written to /odom (base_link in "
      "odom)")(
      "imu", text(&settings->imu),
      "'stamp,wx,wy,wz,ax,ay,az' a line [rad/s, m/s^2], in the axes of the base; written to /imu")(
      "extrinsics", po::value(&settings->extrinsics)->multitoken(),
      "X Y Z QX QY QZ QW: the camera (optical frame) in the robot's base; written to /tf_static")(
      "output", text(&settings->output)->required(), "the bag to write")(
      "frame-id", text(&settings->frame_id)->default_value("camera_optical_frame"),
      "frame of the images")("grey", po::bool_switch(&settings->grey), "write mono8")(
      "compressed", po::bool_switch(&settings->compressed),
      "write JPEG to /camera/image_raw/compressed");
  po::variables_map values = readArguments(argc, argv, options);
  if (values.count("help")) {
    std::cout << options;
    return false;
  }
  po::notify(values);
  if (values.count("times") == values.count("rate")) fail("give either --times or --rate");
  if (values.count("rate") && !(settings->rate_hz > 0.0 && settings->rate_hz <= 1e6))
    fail("--rate is " + std::to_string(settings->rate_hz) + ", must be in (0, 1e6]");
  return true;
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  using namespace active_matching_slam;
  return runTool("images_to_bag", [&] {
    Settings settings;
    if (parse(argc, argv, &settings)) convert(settings);
    return 0;
  });
}
