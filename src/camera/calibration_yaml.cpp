#include <yaml-cpp/yaml.h>

#include <stdexcept>

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

CameraCalibration parse(const std::string& path, const YAML::Node& root) {
  if (!root.IsMap()) fail(path, "not a camera_info yaml file (no fields)");
  CameraCalibration calibration;
  if (root["camera_name"]) calibration.name = readField<std::string>(path, root, "camera_name");
  calibration.width = readField<int>(path, root, "image_width");
  calibration.height = readField<int>(path, root, "image_height");
  readIntrinsics(path, root, &calibration);
  // Files older than the field mean plumb_bob (camera_calibration_parsers).
  const std::string model = root["distortion_model"]
                                ? readField<std::string>(path, root, "distortion_model")
                                : "plumb_bob";
  try {
    calibration.distortion_model = distortionModelFromName(model);
    if (calibration.distortion_model != DistortionModel::kNone || root["distortion_coefficients"])
      calibration.distortion = readMatrix(path, root, "distortion_coefficients");
    checkCalibration(calibration);
  } catch (const std::invalid_argument& error) {
    fail(path, error.what());
  }
  return calibration;
}

}  // namespace

CameraCalibration readCalibrationYaml(const std::string& path) {
  YAML::Node root;
  try {
    root = YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    fail(path, "cannot be read");
  } catch (const YAML::Exception& error) {
    fail(path, std::string("not valid yaml: ") + error.what());
  }
  return parse(path, root);
}

}  // namespace active_matching_slam
