// The tracker on a recorded bag: no master, as fast as it goes, the same result bit for bit.

#include <console_bridge/console.h>

#include <algorithm>
#include <boost/filesystem.hpp>
#include <boost/program_options.hpp>
#include <cstdio>
#include <iostream>
#include <memory>
#include <opencv2/videoio.hpp>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

#include "active_matching_slam/evaluation/run_report.h"
#include "active_matching_slam/evaluation/run_sequence.h"
#include "active_matching_slam/image/image_mask.h"
#include "active_matching_slam/ros/image_conversions.h"
#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/tracker/tracker.h"
#include "active_matching_slam/visualisation/debug_image.h"
#include "camera_bag_writer.h"
#include "common/bag_image_source.h"
#include "common/bag_motion.h"
#include "common/progress_bar.h"
#include "common/tool_main.h"
#include "tracked_bag_writer.h"

namespace active_matching_slam {
namespace {

namespace fs = boost::filesystem;
namespace po = boost::program_options;

struct Settings {
  std::string image_topic, camera_info_topic, camera_info, config, known_target, matcher;
  std::string ground_truth, ground_truth_topic, output, mask, map;
  std::string motion_prior, odometry_topic, imu_topic;
  std::vector<std::string> bags, set, draw;
  int features = 0;
  RunOptions run;
  bool ground_truth_topic_given = false, simulated = false, annotate = false;
  bool output_bag = false, accept_calibration = false, localise = false;
};

po::options_description describeOptions(Settings* s) {
  po::options_description options("track_bag --bag X.bag [Y.bag ...] --output DIR [options]", 100);
  auto add = options.add_options();
  const auto text = [](std::string* target) { return po::value(target); };
  add("help,h", "this text");
  add("bag", po::value(&s->bags)->multitoken()->composing()->required(),
      "bag to track; several are one recording, in the order of its time");
  add("output", text(&s->output)->required(),
      "directory for trajectory.txt, statistics.csv, summary.json, trajectory.png, final.map (for "
      "~load_map) and the map's structure (mutual_information.csv, submaps.csv, "
      "submap_quality.csv, pictures)");
  add("image-topic", text(&s->image_topic)->default_value("/camera/image_raw"),
      "raw or compressed images");
  add("camera-info-topic", text(&s->camera_info_topic),
      "default: camera_info beside the image topic");
  add("camera-info", text(&s->camera_info),
      "calibration yaml instead of a topic: of camera_calibration, OpenCV, Kalibr, EuRoC, VINS, "
      "ORB-SLAM, or a camera_info message");
  add("accept-calibration", po::bool_switch(&s->accept_calibration),
      "go on with a calibration that can hardly be right");
  add("mask", text(&s->mask),
      "picture of the images' size: only where it is white images are used");
  add("map", text(&s->map), "begin with a map that was saved before");
  add("localise", po::bool_switch(&s->localise),
      "follow the camera in that map, which stays as it is (mapping: false)");
  add("motion-prior", text(&s->motion_prior),
      "odometry (makes the map metric) or gyro, of the bag; where the camera is on the robot is "
      "read "
      "from its /tf_static");
  add("odometry-topic", text(&s->odometry_topic)->default_value("/odom"), "nav_msgs/Odometry");
  add("imu-topic", text(&s->imu_topic)->default_value("/imu"), "sensor_msgs/Imu");
  add("config", text(&s->config), "yaml with settings, as config/tracker.yaml");
  add("set", po::value(&s->set)->composing(), "one setting, as in map/maximum_features=80");
  add("known-target", text(&s->known_target), "yaml with known points: the map becomes metric");
  add("matcher", text(&s->matcher), "active_search, jcbb, one_point_ransac, active, ...");
  add("features", po::value(&s->features), "features measured in a frame");
  add("every", po::value(&s->run.every)->default_value(1), "track only every K-th image");
  add("max-frames", po::value(&s->run.maximum_frames)->default_value(0),
      "stop after so many (0: all)");
  add("ground-truth", text(&s->ground_truth), "true trajectory, TUM text");
  add("ground-truth-topic", text(&s->ground_truth_topic)->default_value("/ground_truth/pose"),
      "true poses in the bag (geometry_msgs/PoseStamped)");
  add("simulated", po::bool_switch(&s->simulated),
      "the truth is exact: hold errors against the covariance (NEES); implied by a bag of "
      "simulate_bag");
  add("output-bag", po::bool_switch(&s->output_bag),
      "also write tracked.bag: tf, and what a node called tracker publishes of pose, odometry, "
      "state, statistics and map");
  add("annotate", po::bool_switch(&s->annotate),
      "also write annotated.avi: what was predicted, searched and matched");
  add("draw", po::value(&s->draw)->composing(),
      "draw that into annotated.avi too: submaps, links, tree, ... (the node's draw/ parameters)");
  return options;
}

bool isAnnotated(const Settings& settings) { return settings.annotate || !settings.draw.empty(); }

TrackerOptions trackerOptionsOf(const Settings& settings) {
  TrackerOptions options;
  if (!settings.config.empty()) options = readTrackerOptionsYaml(settings.config);
  options.structure = true;  // the report shows it, whatever a live node needs
  options.matching.keep_trace = isAnnotated(settings);
  if (!settings.known_target.empty()) readKnownTargetYaml(settings.known_target, &options);
  if (!settings.matcher.empty()) options.matcher = settings.matcher;
  if (settings.features > 0) {
    options.map.features_per_frame = settings.features;
    // Room for those out of sight, too.
    options.map.maximum_features = std::max(options.map.maximum_features, 2 * settings.features);
  }
  if (settings.localise) options.mapping = false;
  if (!settings.motion_prior.empty()) options.motion.motion_prior = settings.motion_prior;
  for (const std::string& assignment : settings.set) setTrackerOption(assignment, &options);
  checkTrackerOptions(options);
  return options;
}

RunTruth truthOf(const Settings& settings, const Bags& bags) {
  RunTruth truth;
  truth.simulated = settings.simulated || bagHasTopic(bags, CameraBagWriter::kSimulationTopic);
  if (!settings.ground_truth.empty()) {
    truth.trajectory = readTrajectoryTum(settings.ground_truth);
    if (truth.trajectory.empty())
      throw std::runtime_error(settings.ground_truth + ": there is no pose in it");
    return truth;
  }
  truth.trajectory = readBagTrajectory(bags, settings.ground_truth_topic);
  if (truth.trajectory.empty() && settings.ground_truth_topic_given)
    throw std::runtime_error(settings.bags.front() + ": no geometry_msgs/PoseStamped on " +
                             settings.ground_truth_topic);
  return truth;
}

/// The defaults of the node, and `names` drawn besides.
NodeOptions drawingOf(const std::vector<std::string>& names) {
  NodeOptions options;
  for (const std::string& name : names) {
    bool known = false;
    visitOptions(options, [&](const OptionField& field, auto& value, auto...) {
      if constexpr (std::is_same_v<std::decay_t<decltype(value)>, bool>) {
        if (field.name != "draw/" + name) return;
        value = known = true;
      }
    });
    if (!known) throw std::runtime_error("--draw " + name + ": the node has no draw/" + name);
  }
  return options;
}

/// Motion JPEG, opened at the first picture.
class AnnotatedVideo {
 public:
  AnnotatedVideo(const std::string& path, const NodeOptions& drawing)
      : path_(path), drawing_(drawing) {}
  void add(const TrackedFrame& frame) {
    const cv::Mat picture = drawDebugImage(frame, drawing_.draw, drawing_.submap_level);
    if (picture.empty()) return;
    if (!writer_.isOpened() &&
        !writer_.open(path_, cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), 30.0, picture.size()))
      throw std::runtime_error(path_ + ": cannot be written");
    writer_.write(picture);
  }

 private:
  std::string path_;
  NodeOptions drawing_;
  cv::VideoWriter writer_;
};

/// What a summary line leaves unexplained.
void printOmissions(const RunSummary& s, const RunTruth& truth, int images_without_stamp) {
  const int untracked = s.frames - s.frames_tracked;
  if (s.frames_tracked > 0 && !s.untracked_reason.empty())
    std::printf("\n%d frames not tracked, most often: %s", untracked, s.untracked_reason.c_str());
  if (images_without_stamp > 0)
    std::printf("\n%d images have no stamp: the time of their recording was taken",
                images_without_stamp);
  if (s.frames_tracked > 0 && !truth.trajectory.empty() && s.truth_pairs == 0)
    std::printf(
        "\nno true pose is within %g s of a tracked image, the first of them at %.3f s: by "
        "another clock?",
        truth.association_s, truth.trajectory.front().stamp_s);
}

void printSummary(const RunSummary& s, const std::string& scale_fault) {
  const auto print = [](const std::string& name, const std::optional<double>& value, double factor,
                        const char* unit) {
    if (value) std::printf(", %s %.1f %s", name.c_str(), factor * *value, unit);
  };
  std::printf("%d of %d frames tracked, lost %d times", s.frames_tracked, s.frames, s.times_lost);
  if (s.resets > 0) std::printf(", started anew %d times", s.resets);
  if (s.maps > 1)
    std::printf(", in %d maps, of which number %d has %d frames and the errors stated", s.maps,
                s.main_map, s.frames_in_main_map);
  if (s.late_images > 0) std::printf(", %d late images left out", s.late_images);
  print("ATE Sim(3)", s.ate_sim3_m, 1000.0, "mm");
  // The unit of a free scale has nothing to do with the truth's.
  if (s.scale_source != ScaleSource::kFree) print("ATE SE(3)", s.ate_se3_m, 1000.0, "mm");
  print("NEES", s.nees_mean, 1.0, "of 6");
  std::printf(", %.1f of %.1f matched", s.matched_mean, s.candidates_mean);
  if (!s.durations.empty())
    std::printf(", %.1f ms a frame (99 %%: %.1f)", s.durations.back().median_ms,
                s.durations.back().p99_ms);
  if (s.frames_tracked > 0) std::printf("\nquality %.2f", s.quality);
  if (!s.quality_reason.empty()) std::printf(": %s", s.quality_reason.c_str());
  if (s.image_fixed > 0.0) std::printf("\n%s", imageFixedMessage(s.image_fixed).c_str());
  if (s.frames_with_motion + s.frames_without_motion > 0) {
    std::printf("\nmotion told in %d frames, taken for slip in %d", s.frames_with_motion,
                s.frames_slipped);
    if (s.frames_without_motion > 0)
      std::printf(", missing in %d: %s", s.frames_without_motion, s.motion_fault.c_str());
  }
  if (s.scale_sigma > 0.0)
    std::printf("\nscale by %s, known to %.2f %%", scaleSourceName(s.scale_source).c_str(),
                100.0 * s.scale_sigma);
  if (!scale_fault.empty()) std::printf("\n%s", scale_fault.c_str());
}

void setMask(const std::string& path, Tracker* tracker) {
  try {
    tracker->setMask(readMask(path));
  } catch (const std::invalid_argument& error) {
    throw std::runtime_error(path + ": " + error.what());
  }
}

CameraModel cameraOf(const Settings& settings, const Bags& bags, const std::string& image_topic) {
  const bool rectified = isRectifiedTopic(image_topic);
  const std::string info_topic = settings.camera_info_topic.empty() ? cameraInfoTopicOf(image_topic)
                                                                    : settings.camera_info_topic;
  std::vector<std::string> doubts;
  CameraCalibration calibration;
  if (settings.camera_info.empty()) {
    calibration = readBagCalibration(bags, info_topic, rectified, &doubts);
  } else {
    calibration = readCalibrationYaml(settings.camera_info, rectified);
    doubts = calibrationDoubts(calibration);
  }
  for (const std::string& doubt : doubts) {
    const std::string text = (settings.camera_info.empty() ? info_topic : settings.camera_info) +
                             ": this calibration can hardly be right: " + doubt;
    if (!settings.accept_calibration)
      throw std::runtime_error(text + " (--accept-calibration goes on with it)");
    std::cerr << "track_bag: " << text << "\n";
  }
  return CameraModel(calibration);
}

void run(const Settings& settings) {
  const TrackerOptions options = trackerOptionsOf(settings);
  const Bags bags = openBags(settings.bags);
  BagImageSource images(bags, settings.image_topic);
  const CameraModel camera = cameraOf(settings, bags, images.topic());
  RunReport report;
  report.setTruth(truthOf(settings, bags));
  boost::system::error_code error;
  fs::create_directories(settings.output, error);
  if (error) throw std::runtime_error(settings.output + ": " + error.message());

  Tracker tracker(camera, options);
  tracker.setMotionHistory(
      readBagMotion(bags, options.motion.hasGyro() ? settings.imu_topic : settings.odometry_topic,
                    readBagImageFrame(bags, images.topic()), options.motion));
  if (!settings.mask.empty()) setMask(settings.mask, &tracker);
  if (!settings.map.empty()) tracker.loadMap(settings.map);
  std::unique_ptr<AnnotatedVideo> video;
  if (isAnnotated(settings))
    video = std::make_unique<AnnotatedVideo>(settings.output + "/annotated.avi",
                                             drawingOf(settings.draw));
  bool has_map = false;
  std::string scale_fault;
  std::unique_ptr<TrackedBagWriter> tracked;
  if (settings.output_bag)
    tracked = std::make_unique<TrackedBagWriter>(settings.output + "/tracked.bag");
  int total = (images.size() + settings.run.every - 1) / std::max(1, settings.run.every);
  if (settings.run.maximum_frames > 0) total = std::min(total, settings.run.maximum_frames);
  {
    ProgressBar progress("track_bag", total);
    int done = 0;
    runSequence(&images, &tracker, settings.run, [&](const TrackedFrame& frame) {
      report.add(frame);
      has_map = !frame.features.empty();
      scale_fault = frame.scale_fault;
      if (video) video->add(frame);
      if (tracked) tracked->add(frame);
      const MatchStatistics& matching = frame.matching.statistics;
      progress.advance(++done, trackingStateName(frame.state) + ", " +
                                   std::to_string(matching.matched) + " of " +
                                   std::to_string(matching.candidates) + " matched");
    });
  }
  report.write(settings.output);
  if (has_map && options.mapping) tracker.saveMap(settings.output + "/final.map");
  const RunSummary summary = report.summary();
  printSummary(summary, scale_fault);
  printOmissions(summary, report.truth(), images.imagesWithoutStamp());
  std::printf("\nwritten to %s\n", settings.output.c_str());
  if (summary.frames_tracked == 0)
    throw std::runtime_error("no frame was tracked" + (summary.last_reason.empty()
                                                           ? std::string()
                                                           : ": " + summary.last_reason));
}

int trackBag(int argc, char** argv) {
  console_bridge::noOutputHandler();  // a fault is one line, and ours
  Settings settings;
  const po::options_description options = describeOptions(&settings);
  return runTool("track_bag", [&] {
    po::variables_map values = readArguments(argc, argv, options);
    if (values.count("help")) {
      std::cout << options << "\n";
      return 0;
    }
    po::notify(values);
    settings.ground_truth_topic_given = !values["ground-truth-topic"].defaulted();
    if (settings.localise && settings.map.empty())
      throw std::runtime_error("--localise needs a --map");
    if (settings.run.every < 1) throw std::runtime_error("--every must be at least 1");
    if (values.count("features") && settings.features < 1)
      throw std::runtime_error("--features must be at least 1");
    run(settings);
    return 0;
  });
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) { return active_matching_slam::trackBag(argc, argv); }
