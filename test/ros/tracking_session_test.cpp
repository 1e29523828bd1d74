#include "active_matching_slam/ros/tracking_session.h"

#include <gtest/gtest.h>
#include <sensor_msgs/point_cloud2_iterator.h>

#include <boost/make_shared.hpp>
#include <functional>
#include <limits>
#include <opencv2/imgcodecs.hpp>
#include <random>

#include "active_matching_slam/ros/frame_conversions.h"
#include "active_matching_slam/ros/markers.h"
#include "active_matching_slam/ros/pose_conversions.h"
#include "active_matching_slam/visualisation/debug_image.h"
#include "ros/finite_check.h"
#include "support/fuzz.h"
#include "tracker/simulated_frames.h"

namespace active_matching_slam {
namespace {

sensor_msgs::CameraInfo infoOf(const CameraCalibration& calibration) {
  sensor_msgs::CameraInfo info;
  info.width = static_cast<std::uint32_t>(calibration.width);
  info.height = static_cast<std::uint32_t>(calibration.height);
  info.K = {calibration.fx, 0, calibration.cx, 0, calibration.fy, calibration.cy, 0, 0, 1};
  info.D = calibration.distortion;
  info.distortion_model = distortionModelName(calibration.distortion_model);
  return info;
}

sensor_msgs::Image imageOf(const SimulatedFrame& frame) {
  sensor_msgs::Image image;
  image.header.stamp = ros::Time(frame.stamp_s);
  image.header.frame_id = "camera";
  image.encoding = "mono8";
  image.width = image.step = static_cast<std::uint32_t>(frame.image.cols);
  image.height = static_cast<std::uint32_t>(frame.image.rows);
  image.data.assign(frame.image.datastart, frame.image.dataend);
  return image;
}

CameraImage pair(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info) {
  CameraImage both;
  both.raw = boost::make_shared<sensor_msgs::Image>(image);
  both.info = boost::make_shared<sensor_msgs::CameraInfo>(info);
  return both;
}

/// Frames of the slow film through a session, each with the calibration that `info` makes of it.
struct Stream {
  TrackingSession session{TrackerOptions{}};
  sensor_msgs::CameraInfo info = infoOf(slowFilm().camera.calibration());
  int next = 0;

  std::shared_ptr<const TrackedFrame> feed(
      const std::function<void(sensor_msgs::Image*, sensor_msgs::CameraInfo*)>& change = {}) {
    sensor_msgs::Image image = imageOf(slowFilm().frames[next++]);
    sensor_msgs::CameraInfo its_info = info;
    if (change) change(&image, &its_info);
    return session.process(pair(image, its_info));
  }
};

TEST(TrackingSession, WaitsForTheCalibration) {
  TrackingSession session{TrackerOptions{}};
  CameraImage image;
  image.raw = boost::make_shared<sensor_msgs::Image>(imageOf(slowFilm().frames[0]));
  EXPECT_EQ(nullptr, session.process(image));
  EXPECT_EQ("waiting for camera_info", session.fault());
  EXPECT_THROW(session.requireTracker(), std::runtime_error);
  image.info = boost::make_shared<sensor_msgs::CameraInfo>(infoOf(slowFilm().camera.calibration()));
  EXPECT_NE(nullptr, session.process(image));
  EXPECT_EQ("", session.fault());
}

TEST(TrackingSession, AnUnusableCalibrationInMidStreamStopsTrackingAndKeepsTheMap) {
  Stream stream;
  for (int i = 0; i < 10; ++i) stream.feed();
  const int generation = stream.session.generation();
  for (const double bad : {0.0, -1.0, std::numeric_limits<double>::quiet_NaN()}) {
    EXPECT_EQ(nullptr, stream.feed([&](auto*, auto* info) { info->K[0] = bad; }));
    EXPECT_NE("", stream.session.fault());
  }
  const auto frame = stream.feed();
  ASSERT_NE(nullptr, frame);
  EXPECT_EQ(TrackingState::kTracking, frame->state);
  EXPECT_EQ(generation, stream.session.generation());
  EXPECT_GT(frame->nis_degrees, 20) << "most of the map matched again";
}

TEST(TrackingSession, AChangedCalibrationStartsAnew) {
  Stream stream;
  for (int i = 0; i < 5; ++i) stream.feed();
  const int generation = stream.session.generation();
  stream.info.K[0] *= 1.01;
  const auto frame = stream.feed();
  ASSERT_NE(nullptr, frame);
  EXPECT_EQ(generation + 1, stream.session.generation());
  EXPECT_EQ(0, frame->nis_degrees) << "nothing to match in an empty map";
  stream.feed([](auto*, auto* info) { info->header.stamp = ros::Time(99); });
  EXPECT_EQ(generation + 1, stream.session.generation()) << "a stamp is no change";
}

TEST(TrackingSession, AnEncodingThatChangesInMidStreamIsTrackedOn) {
  Stream stream;
  for (int i = 0; i < 10; ++i) stream.feed();
  const auto frame = stream.feed([](sensor_msgs::Image* image, auto*) {
    image->encoding = "bgr8";
    image->step = 3 * image->width;
    std::vector<std::uint8_t> colour;
    for (const std::uint8_t value : image->data) colour.insert(colour.end(), 3, value);
    image->data = colour;
  });
  ASSERT_NE(nullptr, frame);
  EXPECT_EQ(TrackingState::kTracking, frame->state);
  EXPECT_GT(frame->nis_degrees, 20);
  EXPECT_EQ(0, frame->resets);
}

TEST(TrackingSession, AnImageWithoutAStampIsLeftOutByName) {
  Stream stream;
  for (int i = 0; i < 3; ++i) stream.feed();
  EXPECT_EQ(nullptr, stream.feed([](sensor_msgs::Image* image, auto*) {
    image->header.stamp = ros::Time();
  }));
  EXPECT_NE(std::string::npos, stream.session.fault().find("stamp"));
  EXPECT_EQ(TrackingState::kTracking, stream.feed()->state);
}

/// A few seconds of the smallest pictures that can be tracked, in a fraction of a millisecond each.
const Film& tinyFilm() {
  static const Film film = makeFilm(filmOptions(4.0, {112, 84}));
  return film;
}

TrackerOptions tinyOptions() {
  TrackerOptions options;
  options.structure = true;
  options.map.minimum_distance_px = 8.0;
  options.map.features_per_frame = 8;
  options.map.maximum_features = 12;
  options.image.source_patch_size_px = 13;
  options.image.template_size_px = 7;
  options.image.border_px = 4;
  options.matching.max_gaussians = 10;
  options.lost_after_frames = 5;
  return options;
}

/// Everything that the node would publish of a frame.
void expectFiniteMessages(const TrackedFrame& frame, const CameraCalibration& calibration) {
  std_msgs::Header header;
  header.frame_id = "world";
  const RigidBodyState body =
      rigidBodyState(frame.camera, frame.camera_covariance, Eigen::Isometry3d::Identity());
  EXPECT_TRUE(isFiniteMessage(toPoseWithCovarianceMsg(body, header)));
  EXPECT_TRUE(isFiniteMessage(toOdometryMsg(body, header, "camera")));
  EXPECT_TRUE(isFiniteMessage(toTransformMsg(body.T_world_body, ros::Time(1), "world", "camera")));
  EXPECT_TRUE(isFiniteMessage(toTrackingStateMsg(frame, header)));
  EXPECT_TRUE(isFiniteMessage(toFeatureArrayMsg(frame, 1, header)));
  EXPECT_TRUE(isFiniteMessage(toStatisticsMsg(frame, 0, header)));
  EXPECT_TRUE(isFiniteMessage(toHypothesesMsg(frame, header)));
  EXPECT_TRUE(isFiniteMessage(toGraphMsg(frame, header)));
  EXPECT_TRUE(isFiniteMessage(toSubmapsMsg(frame, header)));
  EXPECT_TRUE(isFiniteMessage(featureMarkers(frame, header)));
  EXPECT_TRUE(isFiniteMessage(informationMarkers(frame, DrawOptions(), header)));
  EXPECT_TRUE(isFiniteMessage(submapMarkers(frame, 1, header)));
  const TrajectoryPoint here{frame.camera.position_world,
                             frame.camera_covariance.topLeftCorner<3, 3>()};
  EXPECT_TRUE(isFiniteMessage(cameraMarkers(frame, calibration, {here, here, here}, 0.1, header)));
  const sensor_msgs::PointCloud2 cloud = toPointCloudMsg(frame, 1, header);
  if (cloud.width == 0) return;  // nothing that an iterator could look at
  for (const char* field : {"x", "y", "z", "sigma"})
    for (sensor_msgs::PointCloud2ConstIterator<float> it(cloud, field); it != it.end(); ++it)
      EXPECT_TRUE(std::isfinite(*it)) << field;
}

/// Messages as no camera should send them, drawn at random from a fixed seed.
class Spoiler {
 public:
  bool isOneIn(int n) { return random_() % n == 0; }

  ros::Time stamp(const ros::Time& stamp) {
    switch (random_() % 8) {
      case 0:
        return ros::Time();
      case 1:
        return ros::Time(0xffffffffu, 999999999u);
      case 2:
        return ros::Time(static_cast<std::uint32_t>(random_()), 0);
      case 3:
        return ros::Time(stamp.sec, 0xffffffffu);
      case 4:
        return ros::Time(std::max(0.0, stamp.toSec() - 0.001 * static_cast<double>(random_() % 5)));
      default:
        return ros::Time(stamp.toSec() + 0.01 * static_cast<double>(random_() % 1000));
    }
  }

  void image(sensor_msgs::Image* image) {
    static const std::vector<std::string> kEncodings = {
        "mono8", "bgr8", "rgba8", "mono16", "bayer_rggb8", "16UC1", "32FC1", "yuv422", "8UC7", ""};
    for (int change = random_() % 3; change >= 0; --change) switch (random_() % 8) {
        case 0:
          image->encoding = kEncodings[random_() % kEncodings.size()];
          break;
        case 1:
          image->width = number();
          break;
        case 2:
          image->height = number();
          break;
        case 3:
          image->step = number();
          break;
        case 4:
          image->data.resize(random_() % 10000);
          break;
        case 5:
          for (std::uint8_t& value : image->data) value = static_cast<std::uint8_t>(random_());
          break;
        case 6:
          std::fill(image->data.begin(), image->data.end(), static_cast<std::uint8_t>(random_()));
          break;
        default:
          image->header.frame_id = std::string(random_() % 5, '/');
      }
  }

  void info(sensor_msgs::CameraInfo* info) {
    static const std::vector<std::string> kModels = {"plumb_bob", "equidistant",
                                                     "rational_polynomial", "none", "x"};
    for (int change = random_() % 3; change >= 0; --change) switch (random_() % 8) {
        case 0:
          info->K[random_() % 9] = real();
          break;
        case 1:
          info->D.resize(random_() % 15, real());
          break;
        case 2:
          if (!info->D.empty()) info->D[random_() % info->D.size()] = real();
          break;
        case 3:
          info->distortion_model = kModels[random_() % kModels.size()];
          break;
        case 4:
          info->width = number();
          break;
        case 5:
          info->height = number();
          break;
        case 6:
          info->roi.width = number(), info->roi.x_offset = number();
          break;
        default:
          info->binning_x = number(), info->binning_y = number();
      }
  }

  sensor_msgs::CompressedImage compressed(const sensor_msgs::Image& image) {
    sensor_msgs::CompressedImage packed;
    packed.header = image.header;
    const cv::Mat pixels(static_cast<int>(image.height), static_cast<int>(image.width), CV_8UC1,
                         const_cast<std::uint8_t*>(image.data.data()));
    cv::imencode(isOneIn(2) ? ".png" : ".jpg", pixels, packed.data);
    for (int change = random_() % 4; change > 0; --change)
      packed.data[random_() % packed.data.size()] = static_cast<std::uint8_t>(random_());
    if (isOneIn(4)) packed.data.resize(random_() % packed.data.size());
    return packed;
  }

 private:
  std::uint32_t number() {
    static const std::uint32_t kNumbers[] = {0,   1,   2,   119,        120, 121,
                                             159, 160, 161, 0x7fffffff, ~0u};
    return kNumbers[random_() % std::size(kNumbers)];
  }
  double real() {
    static const double kReals[] = {0.0,
                                    -1.0,
                                    1e300,
                                    -1e300,
                                    1e-300,
                                    40.0,
                                    160.0,
                                    std::numeric_limits<double>::quiet_NaN(),
                                    std::numeric_limits<double>::infinity()};
    return kReals[random_() % std::size(kReals)];
  }

  std::mt19937 random_{1};
};

// A stream of which a third is malformed: no crash, nothing published that is not a number, and the
// tracker goes on with what is sound.
TEST(TrackingSession, NoStreamOfMalformedMessagesDoesMoreThanBeRefused) {
  const int runs = fuzzInputs(3000);
  const Film& film = tinyFilm();
  const sensor_msgs::CameraInfo good_info = infoOf(film.camera.calibration());
  TrackingSession session(tinyOptions());
  session.setDemand(true, true);
  Spoiler spoiler;
  int tracked = 0, refused = 0;
  auto info = boost::make_shared<const sensor_msgs::CameraInfo>(good_info);
  DrawOptions everything;
  everything.templates = everything.information = everything.tree = everything.links =
      everything.submaps = true;
  const std::vector<std::string> matchers = {"auto", "active", "chow_liu", "jcbb"};
  for (int run = 0; run < runs; ++run) {
    if (run % 500 == 0) {
      TrackerOptions options = tinyOptions();
      options.matcher = matchers[run / 500 % matchers.size()];
      session.setOptions(options);
    }
    sensor_msgs::Image image = imageOf(film.frames[run % film.frames.size()]);
    image.header.stamp += ros::Duration(4.0 * (run / int(film.frames.size())));
    if (spoiler.isOneIn(30)) {
      sensor_msgs::CameraInfo spoilt = good_info;
      spoiler.info(&spoilt);
      info = boost::make_shared<const sensor_msgs::CameraInfo>(spoilt);
    } else if (info && spoiler.isOneIn(2)) {
      info = boost::make_shared<const sensor_msgs::CameraInfo>(good_info);
    }
    if (spoiler.isOneIn(30)) image.header.stamp = spoiler.stamp(image.header.stamp);
    CameraImage both;
    both.info = info;
    if (spoiler.isOneIn(12)) {
      both.compressed = boost::make_shared<sensor_msgs::CompressedImage>(spoiler.compressed(image));
    } else {
      if (spoiler.isOneIn(6)) spoiler.image(&image);
      both.raw = boost::make_shared<sensor_msgs::Image>(image);
    }
    std::shared_ptr<const TrackedFrame> frame;
    ASSERT_NO_THROW(frame = session.process(both)) << "run " << run;
    if (!frame) {
      ++refused;
      EXPECT_NE("", session.fault()) << "run " << run;
      continue;
    }
    if (frame->state == TrackingState::kTracking && frame->nis_degrees > 8) ++tracked;
    expectFiniteMessages(*frame, session.calibration());
    if (run % 4 == 0) {
      EXPECT_NO_THROW(drawDebugImage(*frame, everything, 1)) << "run " << run;
    }
    ASSERT_FALSE(testing::Test::HasFailure()) << "run " << run;
  }
  RecordProperty("tracked", tracked);
  RecordProperty("refused", refused);
  EXPECT_GT(tracked, runs / 10) << "the stream must leave something to track";
  EXPECT_GT(refused, runs / 20);
}

}  // namespace
}  // namespace active_matching_slam
