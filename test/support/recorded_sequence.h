#pragma once

#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/evaluation/trajectory.h"
#include "active_matching_slam/evaluation/trajectory_error.h"
#include "active_matching_slam/tracker/tracker.h"

namespace active_matching_slam {

/// Folder of the recorded sequences, from the environment variable AMS_DATA; empty when unset.
inline std::string recordedDataFolder() {
  const char* folder = std::getenv("AMS_DATA");
  return folder ? folder : "";
}

/// A recorded sequence: frames/ or video.mp4, times.txt, camera.yaml.
class RecordedSequence {
 public:
  RecordedSequence(const std::string& folder, int every = 1)
      : folder_(folder),
        every_(every),
        camera_(readCalibrationYaml(folder + "/camera.yaml")) {
    std::ifstream times(folder + "/times.txt");
    if (!times) throw std::runtime_error("can't read " + folder + "/times.txt");
    for (std::string line; std::getline(times, line);) {
      if (line.empty() || line[0] == '#') continue;
      std::istringstream words(line);
      double stamp;
      std::string file;
      words >> stamp >> file;
      stamps_.push_back(stamp);
      files_.push_back(file);
    }
    if (std::ifstream(folder + "/video.mp4")) video_.open(folder + "/video.mp4");
  }

  const CameraModel& camera() const { return camera_; }

  /// Calls f(image, stamp) for every `every`-th frame.
  template <class F>
  void forEachFrame(F f) {
    for (std::size_t i = 0; i < stamps_.size(); ++i) {
      cv::Mat image;
      if (video_.isOpened()) {
        if (!video_.read(image)) throw std::runtime_error(folder_ + ": the video ends early");
        cv::cvtColor(image, image, cv::COLOR_BGR2GRAY);
      }
      if (i % every_ != 0) continue;
      if (!video_.isOpened()) image = cv::imread(folder_ + "/" + files_[i], cv::IMREAD_GRAYSCALE);
      f(image, stamps_[i]);
    }
  }

 private:
  std::string folder_;
  int every_;
  CameraModel camera_;
  std::vector<double> stamps_;
  std::vector<std::string> files_;
  cv::VideoCapture video_;
};

}  // namespace active_matching_slam
