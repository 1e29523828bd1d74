#pragma once

#include <string>
#include <vector>

#include "active_matching_slam/camera/camera_calibration.h"

namespace active_matching_slam {

inline CameraCalibration makeCalibration(DistortionModel model, std::vector<double> distortion) {
  CameraCalibration calibration;
  calibration.name = distortionModelName(model);
  calibration.width = 640;
  calibration.height = 480;
  calibration.fx = 410.5;
  calibration.fy = 402.25;
  calibration.cx = 322.75;
  calibration.cy = 236.125;
  calibration.distortion_model = model;
  calibration.distortion = std::move(distortion);
  return calibration;
}

/// One camera of every kind, with lenses as strong as real ones.
inline std::vector<CameraCalibration> lenses() {
  return {
      makeCalibration(DistortionModel::kNone, {}),
      makeCalibration(DistortionModel::kPlumbBob, {-0.2966, 0.0808, 0.0, 0.0}),
      makeCalibration(DistortionModel::kPlumbBob, {-0.28, 0.07, 0.0012, -0.0008, 0.004}),
      makeCalibration(DistortionModel::kPlumbBob, {0.11, -0.206, 0.0, 0.0, 0.035}),
      makeCalibration(DistortionModel::kRationalPolynomial,
                      {0.6513, 0.0873, 0.0, 0.0, 0.00126, 0.9935, 0.2517, 0.0129}),
      makeCalibration(DistortionModel::kRationalPolynomial,
                      {0.4, -0.05, 0.001, -0.0015, 0.01, 0.55, 0.02, 0.0, 0.0, 0.0, 0.0, 0.0}),
      makeCalibration(DistortionModel::kEquidistant, {-0.0045, 0.032, -0.029, 0.0067}),
  };
}

}  // namespace active_matching_slam
