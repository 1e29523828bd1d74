#include "active_matching_slam/ros/image_conversions.h"

#include <cv_bridge/cv_bridge.h>
#include <sensor_msgs/image_encodings.h>

#include <algorithm>
#include <boost/make_shared.hpp>
#include <cmath>
#include <cstring>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <utility>

namespace active_matching_slam {
namespace {

namespace encodings = sensor_msgs::image_encodings;

constexpr std::uint32_t kLargestSide_px = 32767;

/// Drivers that leave the colour space open mean grey or OpenCV's order.
std::string colorEncoding(const std::string& encoding) {
  if (encoding == encodings::TYPE_8UC1) return encodings::MONO8;
  if (encoding == encodings::TYPE_8UC3) return encodings::BGR8;
  if (encoding == encodings::TYPE_8UC4) return encodings::BGRA8;
  if (encoding == encodings::TYPE_16UC1) return encodings::MONO16;
  return encoding;
}

const char* const kReadable =
    " (mono8, mono16, rgb, bgr, rgba, bgra, bayer and yuv422 of 8 or 16 bits are read)";

/// Packed 4:2:2 with brightness first, as webcams send it: newer than versions of sensor_msgs, and
/// without a conversion in cv_bridge.
const char* const kYuyv = "yuv422_yuy2";

/// What 12 bits hold. Standard: sensors have 10, 12 or 14 bits; read as 16, what has 12 or fewer
/// is all but black.
constexpr double kTwelveBits = 4096.0;

std::string sizeName(std::uint64_t width, std::uint64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

/// Checks what cv_bridge takes on trust in some of its versions.
void checkLayout(const sensor_msgs::Image& message) {
  if (message.width == 0 || message.height == 0)
    throw std::runtime_error("image is empty: " + sizeName(message.width, message.height));
  int bytes_per_pixel = 2;
  try {
    if (message.encoding != kYuyv)
      bytes_per_pixel =
          encodings::numChannels(message.encoding) * encodings::bitDepth(message.encoding) / 8;
  } catch (const std::exception&) {
    throw std::runtime_error("image encoding '" + message.encoding + "' is unknown" + kReadable);
  }
  const std::uint64_t row_bytes = std::uint64_t{message.width} * bytes_per_pixel;
  if (message.step < row_bytes)
    throw std::runtime_error("image step is " + std::to_string(message.step) + ", a row of " +
                             std::to_string(message.width) + " pixels '" + message.encoding +
                             "' has " + std::to_string(row_bytes) + " bytes");
  const std::uint64_t total = std::uint64_t{message.step} * message.height;
  if (message.data.size() != total)
    throw std::runtime_error("image data has " + std::to_string(message.data.size()) +
                             " bytes, step x height is " + std::to_string(total));
}

bool hostIsBigEndian() {
  const std::uint16_t one = 1;
  std::uint8_t first = 0;
  std::memcpy(&first, &one, 1);
  return first == 0;
}

/// Of each 16-bit value, as versions of cv_bridge don't.
void swapBytes(sensor_msgs::Image* message) {
  for (std::size_t row = 0; row < message->height; ++row) {
    std::uint8_t* const begin = &message->data[row * message->step];
    for (std::size_t i = 0; i + 1 < message->step; i += 2) std::swap(begin[i], begin[i + 1]);
  }
  message->is_bigendian = hostIsBigEndian();
}

cv::Mat brightnessOfYuyv(const sensor_msgs::Image& message) {
  const cv::Mat pairs(static_cast<int>(message.height), static_cast<int>(message.width), CV_8UC2,
                      const_cast<std::uint8_t*>(message.data.data()), message.step);
  cv::Mat brightness;
  cv::extractChannel(pairs, brightness, 0);
  return brightness;
}

/// Refuses 16-bit values that a sensor of fewer bits gave as they were.
void checkDepthIsUsed(const sensor_msgs::ImageConstPtr& image) {
  const std::string& encoding = image->encoding;
  if (encodings::bitDepth(encoding) != 16 ||
      !(encodings::isMono(encoding) || encodings::isColor(encoding) ||
        encodings::isBayer(encoding)))
    return;
  const cv::Mat values = cv_bridge::toCvShare(image)->image.reshape(1);
  double most = 0.0;
  cv::minMaxLoc(values, nullptr, &most);
  if (most >= kTwelveBits) return;
  // Of a picture in the dark that was scaled up the lowest four bits are none.
  cv::Mat lowest;
  cv::bitwise_and(values, cv::Scalar(15), lowest);
  if (cv::countNonZero(lowest) > 0)
    throw std::runtime_error("its largest value is " + std::to_string(static_cast<int>(most)) +
                             " of 65535: if the sensor has 12 bits or fewer, let its driver scale "
                             "them to 16, or send mono8");
}

std::vector<double> knownCoefficients(const sensor_msgs::CameraInfo& message,
                                      DistortionModel model) {
  std::size_t known = 0;
  switch (model) {
    case DistortionModel::kNone:
      known = 0;
      break;
    case DistortionModel::kPlumbBob:
      known = 5;
      break;
    case DistortionModel::kRationalPolynomial:
      known = 8;
      break;
    case DistortionModel::kEquidistant:
      known = 4;
      break;
  }
  const auto isZero = [](double d) { return d == 0.0; };
  if (message.D.size() > known && !std::all_of(message.D.begin() + known, message.D.end(), isZero))
    throw std::invalid_argument("camera_info.D has " + std::to_string(message.D.size()) +
                                " coefficients, distortion model '" + message.distortion_model +
                                "' has " + std::to_string(known));
  return completeCoefficients(
      model, {message.D.begin(), message.D.begin() + std::min(known, message.D.size())});
}

}  // namespace

cv::Mat toGrayImage(const sensor_msgs::Image& message) {
  checkLayout(message);
  if (message.encoding == kYuyv) return brightnessOfYuyv(message);
  if (encodings::bitDepth(message.encoding) > 16 ||
      (encodings::numChannels(message.encoding) == 2 && message.encoding != encodings::YUV422))
    throw std::runtime_error("image with encoding '" + message.encoding + "' is no picture" +
                             kReadable);
  try {
    sensor_msgs::ImageConstPtr source(&message, [](const sensor_msgs::Image*) {});
    const bool swapped =
        message.is_bigendian != hostIsBigEndian() && encodings::bitDepth(message.encoding) == 16;
    if (const std::string encoding = colorEncoding(message.encoding);
        encoding != message.encoding || swapped) {
      auto changed = boost::make_shared<sensor_msgs::Image>(message);
      changed->encoding = encoding;
      if (swapped) swapBytes(changed.get());
      source = changed;
    }
    checkDepthIsUsed(source);
    const cv::Mat gray = cv_bridge::toCvCopy(source, encodings::MONO8)->image;
    if (gray.type() != CV_8UC1) throw std::runtime_error("it has no conversion to grey");
    return gray;
  } catch (const std::exception& error) {
    throw std::runtime_error("image with encoding '" + message.encoding +
                             "' can't be made grey: " + error.what());
  }
}

cv::Mat toGrayImage(const sensor_msgs::CompressedImage& message) {
  if (message.format.find("compressedDepth") != std::string::npos)
    throw std::runtime_error("compressed image with format '" + message.format +
                             "' is of depths, no picture");
  cv::Mat gray;
  try {
    if (!message.data.empty()) gray = cv::imdecode(message.data, cv::IMREAD_GRAYSCALE);
  } catch (const cv::Exception&) {
    gray.release();
  }
  if (gray.empty())
    throw std::runtime_error("compressed image with format '" + message.format + "' and " +
                             std::to_string(message.data.size()) +
                             " bytes can't be decoded (jpeg and png are read, no video)");
  return gray;
}

CameraCalibration toCalibration(const sensor_msgs::CameraInfo& message, bool rectified) {
  if (rectified && message.P[0] == 0.0)
    throw std::invalid_argument(
        "the images are rectified, by their topic's name, but camera_info.P[0] is 0");
  if (message.K[0] == 0.0 && !rectified)
    throw std::invalid_argument(
        "the camera is uncalibrated: camera_info.K[0] is 0 (calibrate it, or set camera_info_url)");
  const double skew = rectified ? message.P[1] : message.K[1];
  if (skew != 0.0)
    throw std::invalid_argument("camera_info has a skew of " + std::to_string(skew) + " (" +
                                (rectified ? "P" : "K") +
                                "[1]): pixels that are no rectangles are not supported");
  const auto& roi = message.roi;
  if (std::max(message.width, message.height) > kLargestSide_px)
    throw std::invalid_argument("camera_info speaks of an image of " +
                                sizeName(message.width, message.height) + " pixels");
  if (roi.width > 0 && (std::uint64_t{roi.x_offset} + roi.width > message.width ||
                        std::uint64_t{roi.y_offset} + roi.height > message.height))
    throw std::invalid_argument("camera_info.roi " + sizeName(roi.width, roi.height) + "+" +
                                std::to_string(roi.x_offset) + "+" + std::to_string(roi.y_offset) +
                                " leaves the image " + sizeName(message.width, message.height));
  const double binning_x = std::max(1u, message.binning_x);
  const double binning_y = std::max(1u, message.binning_y);

  CameraCalibration calibration;
  calibration.name = message.header.frame_id;
  calibration.width = static_cast<int>((roi.width ? roi.width : message.width) / binning_x);
  calibration.height = static_cast<int>((roi.height ? roi.height : message.height) / binning_y);
  calibration.fx = (rectified ? message.P[0] : message.K[0]) / binning_x;
  calibration.fy = (rectified ? message.P[5] : message.K[4]) / binning_y;
  calibration.cx = ((rectified ? message.P[2] : message.K[2]) - roi.x_offset) / binning_x;
  calibration.cy = ((rectified ? message.P[6] : message.K[5]) - roi.y_offset) / binning_y;
  if (!rectified) {
    calibration.distortion_model = distortionModelFromName(message.distortion_model);
    calibration.distortion = knownCoefficients(message, calibration.distortion_model);
  }
  checkCalibration(calibration);
  return calibration;
}

bool isRectifiedTopic(const std::string& topic) {
  return topic.find("/image_rect") != std::string::npos || topic.rfind("image_rect", 0) == 0;
}

std::vector<std::string> calibrationDoubts(const sensor_msgs::CameraInfo& message,
                                           const CameraCalibration& calibration) {
  std::vector<std::string> doubts = calibrationDoubts(calibration);
  const auto offCentre = [](double centre, int size) { return std::abs(2.0 * centre - size); };
  if (message.binning_x > 1 && offCentre(calibration.cx * message.binning_x, calibration.width) <
                                   offCentre(calibration.cx, calibration.width))
    doubts.push_back("binning_x is " + std::to_string(message.binning_x) +
                     ", but K seems to be that of the binned image already (its centre, " +
                     std::to_string(calibration.cx * message.binning_x) +
                     ", is the middle of that): then binning must be 0");
  return doubts;
}

sensor_msgs::CameraInfo toCameraInfoMsg(const CameraCalibration& calibration) {
  sensor_msgs::CameraInfo info;
  info.width = static_cast<std::uint32_t>(calibration.width);
  info.height = static_cast<std::uint32_t>(calibration.height);
  info.distortion_model = distortionModelName(calibration.distortion_model);
  info.D = calibration.distortion;
  info.K = {
      calibration.fx, 0.0, calibration.cx, 0.0, calibration.fy, calibration.cy, 0.0, 0.0, 1.0};
  info.R = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};
  info.P = {calibration.fx,
            0.0,
            calibration.cx,
            0.0,
            0.0,
            calibration.fy,
            calibration.cy,
            0.0,
            0.0,
            0.0,
            1.0,
            0.0};
  return info;
}

cv::Mat toMask(const sensor_msgs::Image& message) {
  if (message.encoding != encodings::MONO8 && message.encoding != encodings::TYPE_8UC1)
    throw std::runtime_error("the mask's encoding is '" + message.encoding + "', must be mono8");
  return toGrayImage(message);
}

bool sameCalibration(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b) {
  return a.width == b.width && a.height == b.height && a.K == b.K && a.D == b.D && a.P == b.P &&
         a.distortion_model == b.distortion_model && a.binning_x == b.binning_x &&
         a.binning_y == b.binning_y && a.roi.x_offset == b.roi.x_offset &&
         a.roi.y_offset == b.roi.y_offset && a.roi.width == b.roi.width &&
         a.roi.height == b.roi.height;
}

}  // namespace active_matching_slam
