#include "active_matching_slam/evaluation/recorded_sequence.h"

#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <sstream>
#include <stdexcept>

namespace active_matching_slam {

RecordedSequence::RecordedSequence(const std::string& folder, int every)
    : folder_(folder), every_(every), camera_(readCalibrationYaml(folder + "/camera.yaml")) {
  if (every < 1)
    throw std::invalid_argument("every is " + std::to_string(every) + ", must be at least 1");
  const std::string times_file = folder + "/times.txt";
  std::ifstream times(times_file);
  if (!times) throw std::runtime_error("can't read " + times_file);
  for (std::string line; std::getline(times, line);) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    double stamp_s = 0.0;
    std::string file;
    if (!(words >> stamp_s >> file))
      throw std::runtime_error(times_file + ": '" + line + "' is not 'seconds file'");
    stamps_.push_back(stamp_s);
    files_.push_back(file);
  }
}

void RecordedSequence::forEachFrame(const std::function<bool(const cv::Mat&, double)>& f) const {
  cv::VideoCapture video;
  const std::string video_file = folder_ + "/video.mp4";
  const bool is_video = std::ifstream(video_file).good();
  if (is_video && !video.open(video_file)) throw std::runtime_error("can't read " + video_file);
  for (std::size_t i = 0; i < stamps_.size(); ++i) {
    cv::Mat image;
    if (is_video) {
      if (!video.read(image)) throw std::runtime_error(video_file + " ends early");
      cv::cvtColor(image, image, cv::COLOR_BGR2GRAY);
    }
    if (i % static_cast<std::size_t>(every_) != 0) continue;
    if (!is_video) {
      const std::string file = folder_ + "/" + files_[i];
      image = cv::imread(file, cv::IMREAD_GRAYSCALE);
      if (image.empty()) throw std::runtime_error("can't read " + file);
    }
    if (!f(image, stamps_[i])) return;
  }
}

}  // namespace active_matching_slam
