#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_calibration.h"

namespace active_matching_slam {

/// Grey 8-bit copy of an image: mono8, bgr8, rgb8, bgra8, rgba8, mono16, bayer, YUV 4:2:2, and the
/// unnamed 8UC1, 8UC3, 8UC4, 16UC1 (taken as mono or BGR). 16 bits are scaled to 8. Throws
/// std::runtime_error that names what is wrong (encoding, size, length of the data).
cv::Mat toGrayImage(const sensor_msgs::Image& message);

/// Same for a jpeg or png.
cv::Mat toGrayImage(const sensor_msgs::CompressedImage& message);

/// Calibration of the raw image as it arrives: binning and region of interest applied as
/// image_geometry does (K and D speak of the full image). D may be shorter than the model knows;
/// missing coefficients are zero. Throws std::invalid_argument naming the field at fault;
/// an uncalibrated camera (K[0] == 0) is one. `rectified`: of the rectified image instead, whose
/// camera P describes, without distortion.
CameraCalibration toCalibration(const sensor_msgs::CameraInfo& message, bool rectified = false);

/// Whether a topic has rectified images (image_rect, image_rect_color), as image_proc names them.
bool isRectifiedTopic(const std::string& topic);

/// What makes one doubt a calibration that toCalibration() made of `message`; empty: nothing.
std::vector<std::string> calibrationDoubts(const sensor_msgs::CameraInfo& message,
                                           const CameraCalibration& calibration);

/// The raw camera as camera_info states it: not rectified, so R is the identity and P repeats K.
sensor_msgs::CameraInfo toCameraInfoMsg(const CameraCalibration& calibration);

/// Of a mask: mono8, or the unnamed 8UC1. Throws std::runtime_error that names what is wrong.
cv::Mat toMask(const sensor_msgs::Image& message);

/// True when both lead to the same calibration (stamps and names do not matter).
bool sameCalibration(const sensor_msgs::CameraInfo& a, const sensor_msgs::CameraInfo& b);

}  // namespace active_matching_slam
