#pragma once

#include <string>
#include <vector>

namespace active_matching_slam {

/// Lens models of sensor_msgs/CameraInfo (REP 104, image_pipeline).
enum class DistortionModel { kNone, kPlumbBob, kRationalPolynomial, kEquidistant };

/// Intrinsic calibration of a camera, as camera_info states it, for the raw (unrectified) image.
struct CameraCalibration {
  std::string name;
  int width = 0;                                  ///< [px]
  int height = 0;                                 ///< [px]
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;  ///< [px]
  DistortionModel distortion_model = DistortionModel::kNone;
  /// In the order of camera_info.D: plumb_bob k1 k2 p1 p2 k3 (0, 4 or 5 of them);
  /// rational_polynomial k1 k2 p1 p2 k3 k4 k5 k6 (8; or 12 or 14, all zero after the eighth: thin
  /// prism and tilt are not supported); equidistant k1 k2 k3 k4; none: empty, or all zero.
  std::vector<double> distortion;
};

/// Throws std::invalid_argument naming the field, its value and the allowed range (NaN included).
/// A zero focal length is named as what it means in camera_info: an uncalibrated camera.
void checkCalibration(const CameraCalibration& calibration);

/// Coefficients as the model counts them: zeros at the end may have been left out.
std::vector<double> completeCoefficients(DistortionModel model, std::vector<double> coefficients);

/// Whether any coefficient of distortion is not zero. A real lens of which none is was not
/// calibrated, but taken for what it is sold as.
bool hasDistortion(const CameraCalibration& calibration);

/// True when both take the same pictures: all but their names agree.
bool sameImaging(const CameraCalibration& a, const CameraCalibration& b);

/// What makes one doubt that a calibration is that of its images; empty: nothing. A lens that sees
/// wider or narrower than any is likely to, or a centre far from the middle of the image.
std::vector<std::string> calibrationDoubts(const CameraCalibration& calibration);

/// Name used in camera_info ("plumb_bob", ...; "" and "none" mean no distortion; "fisheye", as
/// older calibrators and OpenCV call it, is equidistant). Throws std::invalid_argument for a model
/// that is not supported, naming it.
DistortionModel distortionModelFromName(const std::string& name);
std::string distortionModelName(DistortionModel model);

/// Reads the yaml file of a camera: of camera_calibration, OpenCV, Kalibr (cam0), EuRoC, VINS or
/// ORB-SLAM 2 or 3, or a camera_info message. `rectified`: of the rectified image, by its
/// projection_matrix or P. Throws std::runtime_error that names the file and the field at fault.
CameraCalibration readCalibrationYaml(const std::string& path, bool rectified = false);

/// Calibration of the image that a camera with a region of interest and binning delivers, from that
/// of its full sensor. As sensor_msgs/CameraInfo defines it: the region is in full-resolution
/// pixels and is cut out first (width and height 0: the whole image), then binned (0 means 1);
/// sizes round down. The principal point follows image_geometry: c' = (c - offset) / binning.
/// Throws std::invalid_argument when the region leaves the image or nothing remains of it.
CameraCalibration cropAndBin(const CameraCalibration& full, int roi_x, int roi_y, int roi_width,
                             int roi_height, int binning_x, int binning_y);

}  // namespace active_matching_slam
