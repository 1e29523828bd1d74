#include "active_matching_slam/camera/camera_calibration.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <sstream>
#include <stdexcept>
#include <tuple>
#include <utility>

namespace active_matching_slam {
namespace {

/// Focal lengths by the image's width. Derivation: a third is a view of 113 degrees without
/// distortion, twenty one of 3 degrees; 1 / 2 pi one of 360 degrees by an equidistant lens.
constexpr double kLeastFocal = 1.0 / 3.0, kMostFocal = 20.0, kLeastFocalOfFisheye = 0.159;
/// The image's middle half begins there. Cost: of an image that was cropped more to one side the
/// calibration is doubted.
constexpr double kMiddle = 0.25;

[[noreturn]] void refuse(const std::string& field, double value, const std::string& allowed) {
  std::ostringstream message;
  message << "camera calibration: " << field << " is " << value << ", must be " << allowed;
  throw std::invalid_argument(message.str());
}

void checkSize(const std::string& field, int value) {
  constexpr int kMaximumSize = 1 << 16;
  if (value < 1 || value > kMaximumSize) refuse(field, value, "from 1 to 65536 px");
}

void checkFocalLength(const std::string& field, double value) {
  if (value == 0.0) refuse(field, value, "greater than 0 px: the camera is uncalibrated");
  if (!std::isfinite(value) || value < 0.0) refuse(field, value, "finite and greater than 0 px");
}

void checkCoefficientCount(const CameraCalibration& calibration,
                           std::initializer_list<std::size_t> allowed) {
  std::ostringstream list;
  for (std::size_t count : allowed) {
    if (calibration.distortion.size() == count) return;
    list << (count == *allowed.begin() ? "" : ", ") << count;
  }
  refuse(
      "the number of coefficients in D (" + distortionModelName(calibration.distortion_model) + ")",
      static_cast<double>(calibration.distortion.size()), "one of " + list.str());
}

void checkDistortion(const CameraCalibration& calibration) {
  const std::vector<double>& D = calibration.distortion;
  for (std::size_t i = 0; i < D.size(); ++i)
    if (!std::isfinite(D[i])) refuse("D[" + std::to_string(i) + "]", D[i], "finite");
  switch (calibration.distortion_model) {
    case DistortionModel::kNone:
      for (std::size_t i = 0; i < D.size(); ++i)
        if (D[i] != 0.0)
          refuse("D[" + std::to_string(i) + "]", D[i], "0 for a camera without distortion model");
      return;
    case DistortionModel::kPlumbBob:
      return checkCoefficientCount(calibration, {0, 4, 5});
    case DistortionModel::kEquidistant:
      return checkCoefficientCount(calibration, {4});
    case DistortionModel::kRationalPolynomial: {
      checkCoefficientCount(calibration, {8, 12, 14});
      static const char* const kTail[] = {"s1", "s2", "s3", "s4", "tau_x", "tau_y"};
      for (std::size_t i = 8; i < D.size(); ++i)
        if (D[i] != 0.0)
          refuse("D[" + std::to_string(i) + "] (" + kTail[i - 8] + ")", D[i],
                 "0: thin prism and tilted sensor models are not supported");
      return;
    }
  }
}

}  // namespace

void checkCalibration(const CameraCalibration& calibration) {
  checkSize("image_width", calibration.width);
  checkSize("image_height", calibration.height);
  checkFocalLength("fx (K[0])", calibration.fx);
  checkFocalLength("fy (K[4])", calibration.fy);
  if (!std::isfinite(calibration.cx)) refuse("cx (K[2])", calibration.cx, "finite");
  if (!std::isfinite(calibration.cy)) refuse("cy (K[5])", calibration.cy, "finite");
  checkDistortion(calibration);
}

DistortionModel distortionModelFromName(const std::string& name) {
  if (name.empty() || name == "none") return DistortionModel::kNone;
  if (name == "plumb_bob") return DistortionModel::kPlumbBob;
  if (name == "rational_polynomial") return DistortionModel::kRationalPolynomial;
  if (name == "equidistant" || name == "fisheye") return DistortionModel::kEquidistant;
  throw std::invalid_argument(
      "distortion_model is '" + name +
      "', must be one of plumb_bob, rational_polynomial, equidistant, none");
}

std::string distortionModelName(DistortionModel model) {
  switch (model) {
    case DistortionModel::kNone:
      return "none";
    case DistortionModel::kPlumbBob:
      return "plumb_bob";
    case DistortionModel::kRationalPolynomial:
      return "rational_polynomial";
    case DistortionModel::kEquidistant:
      return "equidistant";
  }
  return "none";
}

CameraCalibration cropAndBin(const CameraCalibration& full, int roi_x, int roi_y, int roi_width,
                             int roi_height, int binning_x, int binning_y) {
  if (roi_x < 0 || roi_x >= full.width) refuse("roi.x_offset", roi_x, "inside the image");
  if (roi_y < 0 || roi_y >= full.height) refuse("roi.y_offset", roi_y, "inside the image");
  if (roi_width == 0) roi_width = full.width - roi_x;
  if (roi_height == 0) roi_height = full.height - roi_y;
  if (roi_width < 0 || roi_width > full.width - roi_x)
    refuse("roi.width", roi_width, "0, or such that the region lies inside the image");
  if (roi_height < 0 || roi_height > full.height - roi_y)
    refuse("roi.height", roi_height, "0, or such that the region lies inside the image");
  if (binning_x == 0) binning_x = 1;
  if (binning_y == 0) binning_y = 1;
  if (binning_x < 0 || binning_x > roi_width)
    refuse("binning_x", binning_x, "from 0 to the width of the region of interest");
  if (binning_y < 0 || binning_y > roi_height)
    refuse("binning_y", binning_y, "from 0 to the height of the region of interest");

  CameraCalibration delivered = full;
  delivered.width = roi_width / binning_x;
  delivered.height = roi_height / binning_y;
  delivered.fx = full.fx / binning_x;
  delivered.fy = full.fy / binning_y;
  delivered.cx = (full.cx - roi_x) / binning_x;
  delivered.cy = (full.cy - roi_y) / binning_y;
  return delivered;
}

std::vector<double> completeCoefficients(DistortionModel model, std::vector<double> coefficients) {
  std::size_t least = 0;
  if (model == DistortionModel::kPlumbBob) least = coefficients.empty() ? 0 : 4;
  if (model == DistortionModel::kEquidistant) least = 4;
  if (model == DistortionModel::kRationalPolynomial) least = 8;
  if (coefficients.size() < least) coefficients.resize(least, 0.0);
  return coefficients;
}

std::vector<std::string> calibrationDoubts(const CameraCalibration& calibration) {
  std::vector<std::string> doubts;
  std::ostringstream text;
  const auto say = [&] {
    doubts.push_back(text.str());
    text.str("");
  };
  const double width = calibration.width, height = calibration.height;
  const bool fisheye = calibration.distortion_model == DistortionModel::kEquidistant;
  const double least = width * (fisheye ? kLeastFocalOfFisheye : kLeastFocal);
  for (const auto& [name, focal] :
       {std::make_pair("fx", calibration.fx), std::make_pair("fy", calibration.fy)}) {
    if (focal >= least && focal <= kMostFocal * width) continue;
    text << name << " = " << focal << " px is not from " << least << " to " << kMostFocal * width
         << " px, as lenses for an image " << width << " px wide have";
    say();
  }
  for (const auto& [name, centre, size] : {std::make_tuple("cx", calibration.cx, width),
                                           std::make_tuple("cy", calibration.cy, height)}) {
    if (centre > kMiddle * size && centre < (1.0 - kMiddle) * size) continue;
    text << name << " = " << centre << " px is not in the middle half of " << size << " px";
    say();
  }
  return doubts;
}

bool hasDistortion(const CameraCalibration& calibration) {
  return std::any_of(calibration.distortion.begin(), calibration.distortion.end(),
                     [](double coefficient) { return coefficient != 0.0; });
}

bool sameImaging(const CameraCalibration& a, const CameraCalibration& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy && a.distortion_model == b.distortion_model &&
         a.distortion == b.distortion;
}

}  // namespace active_matching_slam
