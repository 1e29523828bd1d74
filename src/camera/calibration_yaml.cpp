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

/// The camchain of Kalibr.
CameraCalibration parseKalibr(const std::string& path, const YAML::Node& camera) {
  CameraCalibration calibration;
  calibration.name = "cam0";
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
  if (model != "none") D = readField<std::vector<double>>(path, camera, "distortion_coeffs");
  checkAndName(path, &calibration, model == "radtan" ? "plumb_bob" : model, std::move(D));
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

void readProjection(const std::string& path, const YAML::Node& root,
                    CameraCalibration* calibration) {
  const std::vector<double> P = readMatrix(path, root, "projection_matrix");
  if (P.size() != 12)
    fail(path,
         "field 'projection_matrix.data' has " + std::to_string(P.size()) + " numbers, must be 12");
  calibration->fx = P[0];
  calibration->fy = P[5];
  calibration->cx = P[2];
  calibration->cy = P[6];
}

void readIntrinsics(const std::string& path, const YAML::Node& root,
                    CameraCalibration* calibration) {
  const std::vector<double> K = readMatrix(path, root, "camera_matrix");
  if (K.size() != 9)
    fail(path,
         "field 'camera_matrix.data' has " + std::to_string(K.size()) + " numbers, must be 9");
  if (K[1] != 0.0 || K[3] != 0.0 || K[6] != 0.0 || K[7] != 0.0 || K[8] != 1.0)
    fail(path, "field 'camera_matrix.data' must be [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  calibration->fx = K[0];
  calibration->fy = K[4];
  calibration->cx = K[2];
  calibration->cy = K[5];
}

CameraCalibration parse(const std::string& path, const YAML::Node& root, bool rectified) {
  if (!root.IsMap()) fail(path, "not a camera_info yaml file (no fields)");
  const bool kalibr = root["cam0"] && root["cam0"].IsMap();
  const std::string orb_slam =
      root["Camera.fx"] ? "Camera." : (root["Camera1.fx"] ? "Camera1." : "");
  if (rectified && (kalibr || !orb_slam.empty()))
    fail(path, "is of raw images, but these are rectified: give the raw ones");
  if (kalibr) return parseKalibr(path, root["cam0"]);
  if (!orb_slam.empty()) return parseOrbSlam(path, root, orb_slam);
  CameraCalibration calibration;
  if (root["camera_name"]) calibration.name = readField<std::string>(path, root, "camera_name");
  calibration.width = readField<int>(path, root, "image_width");
  calibration.height = readField<int>(path, root, "image_height");
  if (rectified) {
    readProjection(path, root, &calibration);
    checkAndName(path, &calibration, "none", {});
    return calibration;
  }
  readIntrinsics(path, root, &calibration);
  // Files older than the field mean plumb_bob (camera_calibration_parsers), or say 'fisheye' in
  // another.
  std::string model = "plumb_bob";
  for (const char* const field : {"camera_model", "distortion_model"}) {
    if (!root[field]) continue;
    const auto name = readField<std::string>(path, root, field);
    if (name != "pinhole") model = name;
  }
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

}  // namespace

CameraCalibration readCalibrationYaml(const std::string& path, bool rectified) {
  std::ifstream file(path);
  std::stringstream text;
  if (!file || !(text << file.rdbuf())) fail(path, "cannot be read");
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
