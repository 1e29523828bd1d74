#include "active_matching_slam/camera/camera_calibration.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>

#include "active_matching_slam/camera/camera_model.h"
#include "camera/test_calibrations.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

std::string faultAfter(const std::function<void(CameraCalibration*)>& damage,
                       DistortionModel model = DistortionModel::kPlumbBob) {
  CameraCalibration calibration = makeCalibration(model, {});
  if (model == DistortionModel::kEquidistant) calibration.distortion.assign(4, 0.0);
  if (model == DistortionModel::kRationalPolynomial) calibration.distortion.assign(8, 0.0);
  damage(&calibration);
  EXPECT_THROW(checkCalibration(calibration), std::invalid_argument);
  return faultOf([&] { checkCalibration(calibration); });
}

bool contains(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}
#define EXPECT_NAMES(text, part) EXPECT_TRUE(contains(text, part)) << text

TEST(CheckCalibration, EveryLensPasses) {
  for (const CameraCalibration& calibration : lenses())
    EXPECT_NO_THROW(checkCalibration(calibration)) << calibration.name;
}

TEST(CheckCalibration, ZeroFocalLengthIsNamedUncalibrated) {
  const std::string fault = faultAfter([](CameraCalibration* c) { c->fx = 0.0; });
  EXPECT_NAMES(fault, "K[0]");
  EXPECT_NAMES(fault, "uncalibrated");
}

TEST(CheckCalibration, EveryFieldAtFaultIsNamed) {
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->width = 0; }), "image_width");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->height = -3; }), "image_height is -3");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->fx = NAN; }), "fx");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->fy = -400.0; }), "fy (K[4]) is -400");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->cx = NAN; }), "cx");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->cy = INFINITY; }), "cy");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) {
                 c->distortion = {0.1, NAN, 0.0, 0.0};
               }),
               "D[1]");
}

TEST(CheckCalibration, WrongNumberOfCoefficientsIsRefusedWithTheModelsName) {
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->distortion.assign(3, 0.1); }), "plumb_bob");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->distortion.assign(5, 0.1); },
                          DistortionModel::kRationalPolynomial),
               "8, 12, 14");
  EXPECT_NAMES(faultAfter([](CameraCalibration* c) { c->distortion.assign(5, 0.1); },
                          DistortionModel::kEquidistant),
               "equidistant");
}

TEST(CheckCalibration, ThinPrismAndTiltAreRefusedByName) {
  CameraCalibration calibration =
      makeCalibration(DistortionModel::kRationalPolynomial, std::vector<double>(14, 0.0));
  EXPECT_NO_THROW(checkCalibration(calibration));
  calibration.distortion[9] = 0.001;
  EXPECT_NAMES(faultOf([&] { checkCalibration(calibration); }), "s2");
  calibration.distortion[9] = 0.0;
  calibration.distortion[13] = 0.001;
  EXPECT_NAMES(faultOf([&] { checkCalibration(calibration); }), "tau_y");
}

TEST(CheckCalibration, DistortionWithoutAModelIsNotIgnored) {
  EXPECT_NAMES(
      faultAfter([](CameraCalibration* c) { c->distortion = {0.1}; }, DistortionModel::kNone),
      "D[0]");
  EXPECT_NO_THROW(checkCalibration(makeCalibration(DistortionModel::kNone, {0.0, 0.0})));
}

TEST(DistortionModelName, SurvivesTheRoundTrip) {
  for (const CameraCalibration& c : lenses())
    EXPECT_EQ(distortionModelFromName(distortionModelName(c.distortion_model)), c.distortion_model);
  EXPECT_EQ(distortionModelFromName(""), DistortionModel::kNone);
  EXPECT_NAMES(faultOf([] { distortionModelFromName("thirdOrder"); }), "thirdOrder");
}

class CalibrationYaml : public testing::Test {
 protected:
  void TearDown() override { std::remove(path_.c_str()); }
  CameraCalibration read(const std::string& text) {
    std::ofstream(path_) << text;
    return readCalibrationYaml(path_);
  }
  std::string faultOfText(const std::string& text) {
    return faultOf([&] { read(text); });
  }
  std::string path_ = testing::TempDir() + "calibration_yaml_test.yaml";
  const std::string size_ = "image_width: 320\nimage_height: 240\ncamera_name: desk\n";
  const std::string matrix_ =
      "camera_matrix: {rows: 3, cols: 3, data: [195, 0, 162, 0, 196, 125, 0, 0, 1]}\n";
  const std::string lens_ =
      "distortion_model: plumb_bob\n"
      "distortion_coefficients: {rows: 1, cols: 5, data: [0.1, -0.2, 0.3, 0.4, 0.5]}\n";
};

TEST_F(CalibrationYaml, EveryFieldArrives) {
  const CameraCalibration c = read(size_ + matrix_ + lens_);
  EXPECT_EQ(c.name, "desk");
  EXPECT_EQ(c.width, 320);
  EXPECT_EQ(c.height, 240);
  EXPECT_EQ(c.fx, 195.0);
  EXPECT_EQ(c.fy, 196.0);
  EXPECT_EQ(c.cx, 162.0);
  EXPECT_EQ(c.cy, 125.0);
  EXPECT_EQ(c.distortion_model, DistortionModel::kPlumbBob);
  EXPECT_EQ(c.distortion, (std::vector<double>{0.1, -0.2, 0.3, 0.4, 0.5}));
}

TEST_F(CalibrationYaml, FaultsNameFileAndField) {
  for (const std::string& fault :
       {faultOfText(matrix_ + lens_), faultOfText(size_ + lens_), faultOfText(size_ + matrix_)})
    EXPECT_NAMES(fault, path_);
  EXPECT_NAMES(faultOfText(matrix_ + lens_), "image_width");
  EXPECT_NAMES(faultOfText(size_ + lens_), "camera_matrix");
  EXPECT_NAMES(faultOfText(size_ + matrix_), "distortion_coefficients");
  EXPECT_NAMES(faultOfText(size_ + "camera_matrix: {data: [1, 2]}\n" + lens_), "has 2 numbers");
  EXPECT_NAMES(faultOfText(size_ + "camera_matrix: {data: [a, b]}\n" + lens_), "list of numbers");
  EXPECT_NAMES(faultOfText("image_width: wide\nimage_height: 3\n" + matrix_), "image_width");
  EXPECT_NAMES(faultOfText(size_ + matrix_ + "distortion_model: potato\n"), "potato");
  EXPECT_NAMES(faultOfText(size_ + "camera_matrix: {data: [0, 0, 0, 0, 0, 0, 0, 0, 1]}\n" + lens_),
               "uncalibrated");
}

TEST_F(CalibrationYaml, TextThatIsNoYamlIsRefusedWithTheFilesName) {
  EXPECT_NAMES(faultOfText("a: [1, 2"), path_);
  EXPECT_NAMES(faultOfText("just words"), path_);
  EXPECT_NAMES(faultOfText(""), path_);
  EXPECT_NAMES(faultOf([] { readCalibrationYaml("/nonexistent/camera.yaml"); }),
               "/nonexistent/camera.yaml");
}

TEST_F(CalibrationYaml, WithoutModelNameItIsPlumbBob) {
  const std::string coefficients = "distortion_coefficients: {data: [0.1, 0, 0, 0, 0]}\n";
  EXPECT_EQ(read(size_ + matrix_ + coefficients).distortion_model, DistortionModel::kPlumbBob);
}

TEST_F(CalibrationYaml, AFisheyeAsOlderCalibratorsWriteItIsEquidistant) {
  const std::string coefficients = "distortion_coefficients: {data: [0.1, 0.2, 0.3, 0.4]}\n";
  for (const std::string model : {"camera_model: fisheye\n", "distortion_model: fisheye\n"}) {
    const CameraCalibration c = read(size_ + matrix_ + model + coefficients);
    EXPECT_EQ(c.distortion_model, DistortionModel::kEquidistant) << model;
    EXPECT_EQ(c.distortion, (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
  }
  const CameraCalibration pinhole =
      read(size_ + matrix_ + "camera_model: pinhole\n" + coefficients);
  EXPECT_EQ(pinhole.distortion_model, DistortionModel::kPlumbBob);
}

TEST_F(CalibrationYaml, ZerosAtTheEndOfTheCoefficientsMayBeMissing) {
  const auto D = [&](const std::string& model, const std::string& numbers) {
    return read(size_ + matrix_ + "distortion_model: " + model +
                "\ndistortion_coefficients: {data: [" + numbers + "]}\n")
        .distortion;
  };
  EXPECT_EQ(D("plumb_bob", "0.1, 0.2"), (std::vector<double>{0.1, 0.2, 0.0, 0.0}));
  EXPECT_EQ(D("equidistant", "0.1"), (std::vector<double>{0.1, 0.0, 0.0, 0.0}));
  EXPECT_EQ(D("rational_polynomial", "0.1, 0, 0, 0, 0.2"),
            (std::vector<double>{0.1, 0.0, 0.0, 0.0, 0.2, 0.0, 0.0, 0.0}));
}

TEST_F(CalibrationYaml, OfKalibrIsRead) {
  const std::string chain =
      "cam0:\n  camera_model: pinhole\n  intrinsics: [458.6, 457.3, 367.2, 248.4]\n"
      "  resolution: [752, 480]\n  distortion_coeffs: [-0.28, 0.07, 1e-4, 2e-5]\n";
  const CameraCalibration c = read(chain + "  distortion_model: radtan\n");
  EXPECT_EQ(c.width, 752);
  EXPECT_EQ(c.height, 480);
  EXPECT_EQ(c.fx, 458.6);
  EXPECT_EQ(c.cy, 248.4);
  EXPECT_EQ(c.distortion_model, DistortionModel::kPlumbBob);
  EXPECT_EQ(c.distortion, (std::vector<double>{-0.28, 0.07, 1e-4, 2e-5}));
  EXPECT_EQ(read(chain + "  distortion_model: equidistant\n").distortion_model,
            DistortionModel::kEquidistant);
  EXPECT_NAMES(faultOfText("cam0: {camera_model: omni}\n"), "omni");
  EXPECT_NAMES(faultOfText(chain + "  distortion_model: fov\n"), "fov");
}

TEST_F(CalibrationYaml, OfOrbSlamIsRead) {
  for (const std::string camera : {"Camera", "Camera1"}) {
    const std::string settings = "%YAML:1.0\n---\n" + camera + ".fx: 517.3\n" + camera +
                                 ".fy: 516.5\n" + camera + ".cx: 318.6\n" + camera +
                                 ".cy: 255.3\n" + camera + ".k1: 0.26\n" + camera + ".k2: -0.95\n" +
                                 camera + ".p1: -0.005\n" + camera + ".p2: 0.002\n" + camera +
                                 ".k3: 1.16\nCamera.width: 640\n";
    const CameraCalibration c = read(settings + "Camera.height: 480\nCamera.type: \"PinHole\"\n");
    EXPECT_EQ(c.width, 640);
    EXPECT_EQ(c.fx, 517.3);
    EXPECT_EQ(c.distortion, (std::vector<double>{0.26, -0.95, -0.005, 0.002, 1.16}));
    EXPECT_NAMES(faultOfText(settings), "Camera.height");
    EXPECT_NAMES(faultOfText(settings + "Camera.height: 480\nCamera.type: Spherical\n"),
                 "Spherical");
  }
}

TEST_F(CalibrationYaml, OfOpenCvIsRead) {
  EXPECT_EQ(read("%YAML:1.0\n---\n" + size_ +
                 "camera_matrix: !!opencv-matrix\n  rows: 3\n  cols: 3\n  dt: d\n"
                 "  data: [195, 0, 162, 0, 196, 125, 0, 0, 1]\n" +
                 lens_)
                .fy,
            196.0);
}

TEST_F(CalibrationYaml, OfOpenCvIsThatOfAFisheyeWhereItsFlagSaysSo) {
  const std::string lens = "distortion_coefficients: {data: [0.1, -0.2, 0.3, 0.4]}\n";
  EXPECT_EQ(read(size_ + "fisheye_model: 1\n" + matrix_ + lens).distortion_model,
            DistortionModel::kEquidistant);
  EXPECT_EQ(read(size_ + "fisheye_model: 0\n" + matrix_ + lens).distortion_model,
            DistortionModel::kPlumbBob);
}

TEST_F(CalibrationYaml, OfKalibrIsThatOfTheFirstCameraThatThereIs) {
  const auto camera = [](const std::string& name, int width) {
    return name +
           ":\n  camera_model: pinhole\n  intrinsics: [400, 400, 320, 240]\n  resolution: [" +
           std::to_string(width) + ", 480]\n  distortion_model: none\n";
  };
  EXPECT_EQ(read(camera("cam1", 641) + camera("cam2", 642)).width, 641);
  EXPECT_EQ(read(camera("cam1", 641) + camera("cam0", 640)).width, 640);
}

TEST_F(CalibrationYaml, OfEurocIsRead) {
  const CameraCalibration c = read(
      "sensor_type: camera\nrate_hz: 20\nresolution: [752, 480]\ncamera_model: pinhole\n"
      "intrinsics: [458.6, 457.3, 367.2, 248.4]\ndistortion_model: radial-tangential\n"
      "distortion_coefficients: [-0.28, 0.07, 1e-4, 2e-5]\n");
  EXPECT_EQ(c.width, 752);
  EXPECT_EQ(c.fy, 457.3);
  EXPECT_EQ(c.distortion_model, DistortionModel::kPlumbBob);
  EXPECT_EQ(c.distortion, (std::vector<double>{-0.28, 0.07, 1e-4, 2e-5}));
}

TEST_F(CalibrationYaml, OfVinsIsRead) {
  const std::string head = "%YAML:1.0\n---\n" + size_;
  CameraCalibration c =
      read(head +
           "model_type: PINHOLE\ndistortion_parameters: {k1: -0.3, k2: 0.1, p1: 1e-4, p2: 2e-4}\n"
           "projection_parameters: {fx: 195, fy: 196, cx: 162, cy: 125}\n");
  EXPECT_EQ(c.cx, 162.0);
  EXPECT_EQ(c.distortion_model, DistortionModel::kPlumbBob);
  EXPECT_EQ(c.distortion, (std::vector<double>{-0.3, 0.1, 1e-4, 2e-4}));
  c = read(
      head +
      "model_type: KANNALA_BRANDT\nprojection_parameters: {k2: 0.1, k3: 0.2, k4: 0.3, k5: 0.4, "
      "mu: 195, mv: 196, u0: 162, v0: 125}\n");
  EXPECT_EQ(c.fy, 196.0);
  EXPECT_EQ(c.cy, 125.0);
  EXPECT_EQ(c.distortion_model, DistortionModel::kEquidistant);
  EXPECT_EQ(c.distortion, (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
  EXPECT_NAMES(faultOfText(head + "model_type: MEI\n"), "'MEI'");
  EXPECT_NAMES(faultOfText(head + "model_type: PINHOLE\n"), "'projection_parameters' is missing");
}

TEST_F(CalibrationYaml, OfAPrintedMessageIsRead) {
  const std::string message =
      "header: {seq: 0, frame_id: desk}\nheight: 240\nwidth: 320\ndistortion_model: plumb_bob\n"
      "D: [0.1, -0.2, 0.3, 0.4, 0.5]\nK: [195, 0, 162, 0, 196, 125, 0, 0, 1]\n"
      "P: [180, 0, 160, 0, 0, 181, 120, 0, 0, 0, 1, 0]\n";
  const std::string end = "---\nheader: {seq: 1}\n";
  CameraCalibration c = read(message + end);
  EXPECT_EQ(c.width, 320);
  EXPECT_EQ(c.fy, 196.0);
  EXPECT_EQ(c.distortion, (std::vector<double>{0.1, -0.2, 0.3, 0.4, 0.5}));
  EXPECT_EQ(readCalibrationYaml(path_, true).fy, 181.0);
  c = read(message +
           "binning_x: 2\nbinning_y: 2\nroi: {x_offset: 20, y_offset: 10, height: 200, "
           "width: 280}\n");
  EXPECT_EQ(c.width, 140);
  EXPECT_EQ(c.height, 100);
  EXPECT_EQ(c.cx, (162.0 - 20.0) / 2.0);
}

TEST_F(CalibrationYaml, WhatIsNoneOfACameraIsToldByItsFields) {
  const std::string fault = faultOfText("target_type: aprilgrid\ntagCols: 6\n");
  EXPECT_NAMES(fault, "target_type, tagCols");
  EXPECT_NAMES(fault, "ost.yaml");
  EXPECT_NAMES(faultOfText("# oST version 5.0 parameters\n[image]\n\nwidth\n320\n"), "ost.yaml");
  EXPECT_NAMES(faultOfText(""), "empty");
}

TEST_F(CalibrationYaml, OfARectifiedImageIsItsProjection) {
  const std::string projection =
      "projection_matrix: {data: [180, 0, 160, 0, 0, 181, 121, 0, 0, 0, 1, 0]}\n";
  std::ofstream(path_) << size_ + matrix_ + lens_ + projection;
  const CameraCalibration c = readCalibrationYaml(path_, true);
  EXPECT_EQ(c.fx, 180.0);
  EXPECT_EQ(c.fy, 181.0);
  EXPECT_EQ(c.cx, 160.0);
  EXPECT_EQ(c.cy, 121.0);
  EXPECT_FALSE(hasDistortion(c));
  std::ofstream(path_) << size_ + matrix_ + lens_;
  EXPECT_NAMES(faultOf([&] { readCalibrationYaml(path_, true); }), "projection_matrix");
}

TEST_F(CalibrationYaml, SkewIsRefused) {
  EXPECT_NAMES(
      faultOfText(size_ + "camera_matrix: {data: [195, 3, 162, 0, 196, 125, 0, 0, 1]}\n" + lens_),
      "[fx, 0, cx");
}

TEST(CalibrationDoubts, NoLensInUseIsDoubted) {
  for (const CameraCalibration& calibration : lenses())
    EXPECT_TRUE(calibrationDoubts(calibration).empty()) << calibration.name;
}

TEST(CalibrationDoubts, WhatCanHardlyBeRightIsNamed) {
  const auto doubtAbout = [](const std::function<void(CameraCalibration*)>& change) {
    CameraCalibration calibration = makeCalibration(DistortionModel::kPlumbBob, {});
    change(&calibration);
    std::string text;
    for (const std::string& doubt : calibrationDoubts(calibration)) text += doubt + "; ";
    return text;
  };
  EXPECT_NAMES(doubtAbout([](CameraCalibration* c) { c->fx = c->fy = 0.8; }), "fx = 0.8 px");
  EXPECT_NAMES(doubtAbout([](CameraCalibration* c) { c->fy = 30.0 * c->width; }), "fy = ");
  EXPECT_NAMES(doubtAbout([](CameraCalibration* c) { c->cx = 0.2 * c->width; }), "cx = ");
  EXPECT_NAMES(doubtAbout([](CameraCalibration* c) { c->cy = 0.8 * c->height; }), "cy = ");
}

TEST(CropAndBin, ShiftsThePrincipalPointThenDividesAllByTheBinning) {
  const CameraCalibration full = lenses()[2];
  const CameraCalibration part = cropAndBin(full, 100, 60, 401, 300, 2, 4);
  EXPECT_EQ(part.width, 200);
  EXPECT_EQ(part.height, 75);
  EXPECT_EQ(part.distortion, full.distortion);
  // A point seen at (u, v) in full resolution is seen at ((u - x) / bx, (v - y) / by).
  const Eigen::Vector3d point(0.1, -0.2, 1.3);
  const Eigen::Vector2d in_full = *CameraModel(full).project(point);
  const Eigen::Vector2d in_part = *CameraModel(part).project(point);
  EXPECT_NEAR(in_part.x(), (in_full.x() - 100.0) / 2.0, 1e-10);
  EXPECT_NEAR(in_part.y(), (in_full.y() - 60.0) / 4.0, 1e-10);
}

TEST(CropAndBin, ZerosMeanTheWholeImageWithoutBinning) {
  const CameraCalibration full = lenses()[0];
  const CameraCalibration same = cropAndBin(full, 0, 0, 0, 0, 0, 0);
  EXPECT_EQ(same.width, full.width);
  EXPECT_EQ(same.height, full.height);
  EXPECT_EQ(same.fx, full.fx);
  EXPECT_EQ(same.cy, full.cy);
}

TEST(CropAndBin, ARegionOutsideTheImageIsRefusedByName) {
  const CameraCalibration full = lenses()[0];
  EXPECT_NAMES(faultOf([&] { cropAndBin(full, 640, 0, 10, 10, 1, 1); }), "roi.x_offset");
  EXPECT_NAMES(faultOf([&] { cropAndBin(full, 0, -1, 10, 10, 1, 1); }), "roi.y_offset");
  EXPECT_NAMES(faultOf([&] { cropAndBin(full, 600, 0, 41, 10, 1, 1); }), "roi.width");
  EXPECT_NAMES(faultOf([&] { cropAndBin(full, 0, 0, 10, 481, 1, 1); }), "roi.height");
  EXPECT_NAMES(faultOf([&] { cropAndBin(full, 0, 0, 10, 10, 11, 1); }), "binning_x");
  EXPECT_NAMES(faultOf([&] { cropAndBin(full, 0, 0, 10, 10, 1, -2); }), "binning_y");
}

}  // namespace
}  // namespace active_matching_slam
