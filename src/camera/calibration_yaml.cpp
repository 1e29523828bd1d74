#include <yaml-cpp/yaml.h>

#include <fstream>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "active_matching_slam/camera/camera_calibration.h"

namespace active_matching_slam {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw std::runtime_error(path + ": " + what);
}

template <typename T>
T readField(const std::string& path, const YAML::Node& parent, const std::string& field) {
  const YAML::Node node = parent[field];
  if (!node) fail(path, "field '" + field + "' is missing");
  try {
    return node.as<T>();
  } catch (const YAML::Exception&) {
    fail(path, "field '" + field + "' has the wrong type");
  }
}

std::vector<double> readMatrix(const std::string& path, const YAML::Node& root,
                               const std::string& field) {
  const YAML::Node matrix = root[field];
  if (!matrix) fail(path, "field '" + field + "' is missing");
  if (!matrix.IsMap() || !matrix["data"]) fail(path, "field '" + field + ".data' is missing");
  try {
    return matrix["data"].as<std::vector<double>>();
  } catch (const YAML::Exception&) {
    fail(path, "field '" + field + ".data' is not a list of numbers");
  }
}

void checkAndName(const std::string& path, CameraCalibration* calibration,
                  const std::string& distortion_model, std::vector<double> coefficients) {
  try {
    calibration->distortion_model = distortionModelFromName(distortion_model);
    calibration->distortion =
        completeCoefficients(calibration->distortion_model, std::move(coefficients));
    checkCalibration(*calibration);
  } catch (const std::invalid_argument& error) {
    fail(path, error.what());
  }
}

/// One camera of Kalibr's camchain, or the whole of EuRoC's sensor.yaml.
CameraCalibration parseKalibr(const std::string& path, const YAML::Node& camera,
                              const std::string& name) {
  CameraCalibration calibration;
  calibration.name = name;
  const auto kind = readField<std::string>(path, camera, "camera_model");
  if (kind != "pinhole")
    fail(path, "Kalibr's camera_model is '" + kind + "', must be pinhole: calibrate for that");
  const auto size = readField<std::vector<int>>(path, camera, "resolution");
  const auto K = readField<std::vector<double>>(path, camera, "intrinsics");
  if (size.size() != 2) fail(path, "field 'resolution' must be [width, height]");
  if (K.size() != 4) fail(path, "field 'intrinsics' must be [fu, fv, pu, pv]");
  calibration.width = size[0];
  calibration.height = size[1];
  calibration.fx = K[0];
  calibration.fy = K[1];
  calibration.cx = K[2];
  calibration.cy = K[3];
  const auto model = readField<std::string>(path, camera, "distortion_model");
  std::vector<double> D;
  const std::string coefficients =
      camera["distortion_coefficients"] ? "distortion_coefficients" : "distortion_coeffs";
  if (model != "none") D = readField<std::vector<double>>(path, camera, coefficients);
  const bool is_radial_tangential = model == "radtan" || model == "radial-tangential";
  checkAndName(path, &calibration, is_radial_tangential ? "plumb_bob" : model, std::move(D));
  return calibration;
}

/// Kalibr's cam0; where there is none, the first that there is. Empty: the file is not Kalibr's.
std::string cameraOfKalibr(const YAML::Node& root) {
  std::string first;
  for (const auto& entry : root) {
    if (!entry.first.IsScalar() || !entry.second.IsMap()) continue;
    const auto name = entry.first.as<std::string>();
    if (name == "cam0" ||
        (first.empty() && name.rfind("cam", 0) == 0 && entry.second["intrinsics"]))
      first = name;
  }
  return first;
}

/// VINS and others, by camodocal.
CameraCalibration parseCamodocal(const std::string& path, const YAML::Node& root) {
  const auto kind = readField<std::string>(path, root, "model_type");
  const bool fisheye = kind == "KANNALA_BRANDT";
  if (kind != "PINHOLE" && !fisheye)
    fail(path, "camodocal's model_type is '" + kind + "', must be PINHOLE or KANNALA_BRANDT");
  CameraCalibration calibration;
  calibration.name = "camera";
  calibration.width = readField<int>(path, root, "image_width");
  calibration.height = readField<int>(path, root, "image_height");
  const auto read = [&](const char* const group, const char* const name) {
    if (!root[group]) fail(path, "field '" + std::string(group) + "' is missing");
    return readField<double>(path, root[group], name);
  };
  const char* const projection = "projection_parameters";
  calibration.fx = read(projection, fisheye ? "mu" : "fx");
  calibration.fy = read(projection, fisheye ? "mv" : "fy");
  calibration.cx = read(projection, fisheye ? "u0" : "cx");
  calibration.cy = read(projection, fisheye ? "v0" : "cy");
  std::vector<double> D;
  if (fisheye)
    for (const char* const name : {"k2", "k3", "k4", "k5"}) D.push_back(read(projection, name));
  else
    for (const char* const name : {"k1", "k2", "p1", "p2"})
      D.push_back(read("distortion_parameters", name));
  checkAndName(path, &calibration, fisheye ? "equidistant" : "plumb_bob", std::move(D));
  return calibration;
}

/// Settings of ORB-SLAM 2 ("Camera.") or 3 ("Camera1.").
CameraCalibration parseOrbSlam(const std::string& path, const YAML::Node& root,
                               const std::string& camera) {
  const std::string kind =
      root["Camera.type"] ? readField<std::string>(path, root, "Camera.type") : "PinHole";
  const bool fisheye = kind == "KannalaBrandt8";
  if (kind != "PinHole" && !fisheye)
    fail(path, "ORB-SLAM's Camera.type is '" + kind + "', must be PinHole or KannalaBrandt8");
  CameraCalibration calibration;
  calibration.name = "camera";
  calibration.width = readField<int>(path, root, "Camera.width");
  calibration.height = readField<int>(path, root, "Camera.height");
  calibration.fx = readField<double>(path, root, camera + "fx");
  calibration.fy = readField<double>(path, root, camera + "fy");
  calibration.cx = readField<double>(path, root, camera + "cx");
  calibration.cy = readField<double>(path, root, camera + "cy");
  std::vector<double> D;
  for (const char* const name : {"k1", "k2", fisheye ? "k3" : "p1", fisheye ? "k4" : "p2"})
    D.push_back(root[camera + name] ? readField<double>(path, root, camera + name) : 0.0);
  if (!fisheye && root[camera + "k3"]) D.push_back(readField<double>(path, root, camera + "k3"));
  checkAndName(path, &calibration, fisheye ? "equidistant" : "plumb_bob", std::move(D));
  return calibration;
}

void setProjection(const std::string& path, const std::string& field, const std::vector<double>& P,
                   CameraCalibration* calibration) {
  if (P.size() != 12)
    fail(path, "field '" + field + "' has " + std::to_string(P.size()) + " numbers, must be 12");
  calibration->fx = P[0];
  calibration->fy = P[5];
  calibration->cx = P[2];
  calibration->cy = P[6];
}

void setIntrinsics(const std::string& path, const std::string& field, const std::vector<double>& K,
                   CameraCalibration* calibration) {
  if (K.size() != 9)
    fail(path, "field '" + field + "' has " + std::to_string(K.size()) + " numbers, must be 9");
  if (K[1] != 0.0 || K[3] != 0.0 || K[6] != 0.0 || K[7] != 0.0 || K[8] != 1.0)
    fail(path, "field '" + field + "' must be [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  calibration->fx = K[0];
  calibration->fy = K[4];
  calibration->cx = K[2];
  calibration->cy = K[5];
}

/// A camera_info message, as 'rostopic echo' prints it.
CameraCalibration parseMessage(const std::string& path, const YAML::Node& root, bool rectified) {
  CameraCalibration calibration;
  calibration.width = readField<int>(path, root, "width");
  calibration.height = readField<int>(path, root, "height");
  if (rectified) {
    setProjection(path, "P", readField<std::vector<double>>(path, root, "P"), &calibration);
    checkAndName(path, &calibration, "none", {});
  } else {
    setIntrinsics(path, "K", readField<std::vector<double>>(path, root, "K"), &calibration);
    checkAndName(path, &calibration, readField<std::string>(path, root, "distortion_model"),
                 readField<std::vector<double>>(path, root, "D"));
  }
  const auto part = [&](const YAML::Node& parent, const char* const field) {
    return parent && parent[field] ? readField<int>(path, parent, field) : 0;
  };
  const YAML::Node roi = root["roi"];
  try {
    return cropAndBin(calibration, part(roi, "x_offset"), part(roi, "y_offset"), part(roi, "width"),
                      part(roi, "height"), part(root, "binning_x"), part(root, "binning_y"));
  } catch (const std::invalid_argument& error) {
    fail(path, error.what());
  }
}

/// Older files than the field mean plumb_bob (camera_calibration_parsers), or say 'fisheye' in
/// another; OpenCV's own calibrator says it by a flag.
std::string distortionModelOf(const std::string& path, const YAML::Node& root) {
  std::string model = "plumb_bob";
  if (root["fisheye_model"] && readField<int>(path, root, "fisheye_model") != 0) model = "fisheye";
  for (const char* const field : {"camera_model", "distortion_model"}) {
    if (!root[field]) continue;
    const auto name = readField<std::string>(path, root, field);
    if (name != "pinhole") model = name;
  }
  return model;
}

/// A file of camera_calibration, or of OpenCV.
CameraCalibration parseCameraInfo(const std::string& path, const YAML::Node& root, bool rectified) {
  CameraCalibration calibration;
  if (root["camera_name"]) calibration.name = readField<std::string>(path, root, "camera_name");
  calibration.width = readField<int>(path, root, "image_width");
  calibration.height = readField<int>(path, root, "image_height");
  if (rectified) {
    setProjection(path, "projection_matrix.data", readMatrix(path, root, "projection_matrix"),
                  &calibration);
    checkAndName(path, &calibration, "none", {});
    return calibration;
  }
  setIntrinsics(path, "camera_matrix.data", readMatrix(path, root, "camera_matrix"), &calibration);
  const std::string model = distortionModelOf(path, root);
  std::vector<double> D;
  try {
    if (distortionModelFromName(model) != DistortionModel::kNone || root["distortion_coefficients"])
      D = readMatrix(path, root, "distortion_coefficients");
  } catch (const std::invalid_argument& error) {
    fail(path, error.what());
  }
  checkAndName(path, &calibration, model, std::move(D));
  return calibration;
}

[[noreturn]] void failForeign(const std::string& path, const YAML::Node& root) {
  std::string fields;
  if (root.IsMap())
    for (const auto& entry : root)
      if (entry.first.IsScalar()) fields += (fields.empty() ? "" : ", ") + entry.first.Scalar();
  fail(path,
       "not the calibration of a camera in a form that is read, which are yaml files of "
       "camera_calibration (its ost.yaml), OpenCV, Kalibr, EuRoC, VINS and ORB-SLAM, and a "
       "camera_info message; " +
           (fields.empty() ? "it has no fields" : "its fields are " + fields));
}

CameraCalibration parse(const std::string& path, const YAML::Node& root, bool rectified) {
  if (!root.IsMap()) failForeign(path, root);
  const std::string kalibr = cameraOfKalibr(root);
  const bool is_euroc = root["intrinsics"] && root["resolution"];
  const bool is_camodocal = static_cast<bool>(root["model_type"]);
  const std::string orb_slam =
      root["Camera.fx"] ? "Camera." : (root["Camera1.fx"] ? "Camera1." : "");
  if (rectified && (!kalibr.empty() || is_euroc || is_camodocal || !orb_slam.empty()))
    fail(path, "is of raw images, but these are rectified: give the raw ones");
  if (!kalibr.empty()) return parseKalibr(path, root[kalibr], kalibr);
  if (is_euroc) return parseKalibr(path, root, "camera");
  if (is_camodocal) return parseCamodocal(path, root);
  if (!orb_slam.empty()) return parseOrbSlam(path, root, orb_slam);
  if (root["K"] && root["width"]) return parseMessage(path, root, rectified);
  if (!root["image_width"] && !root["camera_matrix"]) failForeign(path, root);
  return parseCameraInfo(path, root, rectified);
}

}  // namespace

CameraCalibration readCalibrationYaml(const std::string& path, bool rectified) {
  std::ifstream file(path);
  std::stringstream text;
  if (!file) fail(path, "cannot be read");
  if (file.peek() == std::ifstream::traits_type::eof()) fail(path, "is empty, or cannot be read");
  text << file.rdbuf();
  std::string content = text.str();
  // OpenCV's own first line is no yaml.
  if (content.rfind("%YAML:", 0) == 0) content.erase(0, content.find('\n'));
  YAML::Node root;
  try {
    root = YAML::Load(content);
  } catch (const YAML::Exception& error) {
    fail(path, std::string("not valid yaml: ") + error.what());
  }
  return parse(path, root, rectified);
}

}  // namespace active_matching_slam
