#include "active_matching_slam/ros/image_conversions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <random>
#include <stdexcept>

#include "support/fault.h"
#include "support/fuzz.h"

namespace active_matching_slam {
namespace {

sensor_msgs::Image makeImage(const std::string& encoding, const cv::Mat& pixels) {
  sensor_msgs::Image message;
  message.encoding = encoding;
  message.width = pixels.cols;
  message.height = pixels.rows;
  message.step = static_cast<std::uint32_t>(pixels.cols * pixels.elemSize());
  message.data.assign(pixels.data, pixels.data + message.step * message.height);
  return message;
}

sensor_msgs::CameraInfo makeInfo() {
  sensor_msgs::CameraInfo info;
  info.width = 640;
  info.height = 480;
  info.distortion_model = "plumb_bob";
  info.D = {0.1, -0.2, 0.001, 0.002, 0.05};
  info.K = {500, 0, 321, 0, 510, 243, 0, 0, 1};
  return info;
}

/// A smooth picture: demosaicking may blur it, but must leave its brightness where it is.
cv::Mat shadedImage() {
  cv::Mat gray(48, 64, CV_8UC1);
  for (int v = 0; v < gray.rows; ++v)
    for (int u = 0; u < gray.cols; ++u) gray.at<std::uint8_t>(v, u) = std::uint8_t(40 + u + 2 * v);
  return gray;
}

TEST(ImageConversions, GreyStaysAsItIs) {
  const cv::Mat gray = shadedImage();
  for (const char* encoding : {"mono8", "8UC1"})
    EXPECT_EQ(0.0, cv::norm(gray, toGrayImage(makeImage(encoding, gray)), cv::NORM_INF))
        << encoding;
}

TEST(ImageConversions, ColourChannelsAreTakenInTheirOrder) {
  const cv::Mat red_in_rgb(4, 4, CV_8UC3, cv::Scalar(200, 0, 0));
  const cv::Mat red_in_bgr(4, 4, CV_8UC3, cv::Scalar(0, 0, 200));
  const int luma = cvRound(0.299 * 200);
  EXPECT_NEAR(luma, toGrayImage(makeImage("rgb8", red_in_rgb)).at<std::uint8_t>(1, 1), 1);
  EXPECT_NEAR(luma, toGrayImage(makeImage("bgr8", red_in_bgr)).at<std::uint8_t>(1, 1), 1);
  EXPECT_NEAR(luma, toGrayImage(makeImage("8UC3", red_in_bgr)).at<std::uint8_t>(1, 1), 1);
  const cv::Mat red_in_rgba(4, 4, CV_8UC4, cv::Scalar(200, 0, 0, 255));
  EXPECT_NEAR(luma, toGrayImage(makeImage("rgba8", red_in_rgba)).at<std::uint8_t>(1, 1), 1);
}

TEST(ImageConversions, SixteenBitsAreScaledToEight) {
  cv::Mat deep;
  shadedImage().convertTo(deep, CV_16UC1, 257.0);
  for (const char* encoding : {"mono16", "16UC1"})
    EXPECT_LE(cv::norm(shadedImage(), toGrayImage(makeImage(encoding, deep)), cv::NORM_INF), 1.0)
        << encoding;
}

TEST(ImageConversions, SixteenBitsMayComeInEitherOrderOfBytes) {
  cv::Mat deep;
  shadedImage().convertTo(deep, CV_16UC1, 257.0);
  deep += cv::Scalar(100.0);  // so that the two bytes differ
  for (const char* encoding : {"mono16", "16UC1"}) {
    const cv::Mat expected = toGrayImage(makeImage(encoding, deep));
    sensor_msgs::Image swapped = makeImage(encoding, deep);
    for (std::size_t i = 0; i < swapped.data.size(); i += 2)
      std::swap(swapped.data[i], swapped.data[i + 1]);
    swapped.is_bigendian = !swapped.is_bigendian;
    EXPECT_EQ(0.0, cv::norm(expected, toGrayImage(swapped), cv::NORM_INF)) << encoding;
  }
}

TEST(ImageConversions, SixteenBitsOfWhichMostAreUnusedAreNamed) {
  cv::Mat ten;
  shadedImage().convertTo(ten, CV_16UC1, 4.0);
  for (const char* encoding : {"mono16", "16UC1", "bayer_rggb16"}) {
    const std::string fault = faultOf([&] { toGrayImage(makeImage(encoding, ten)); });
    EXPECT_NE(std::string::npos, fault.find("of 65535")) << encoding << ": " << fault;
  }
}

TEST(ImageConversions, SixteenBitsInTheDarkAreAPicture) {
  cv::Mat dark;
  shadedImage().convertTo(dark, CV_16UC1, 16.0);
  EXPECT_EQ("", faultOf([&] { toGrayImage(makeImage("mono16", dark)); }));
  EXPECT_EQ("", faultOf([&] { toGrayImage(makeImage("mono16", dark * 0)); }));
}

TEST(ImageConversions, OfPackedChromaTheBrightnessIsTaken) {
  cv::Mat pairs;
  const cv::Mat chroma(shadedImage().size(), CV_8UC1, cv::Scalar(90));
  cv::merge(std::vector<cv::Mat>{shadedImage(), chroma}, pairs);
  EXPECT_EQ(0.0, cv::norm(shadedImage(), toGrayImage(makeImage("yuv422_yuy2", pairs))));
  cv::merge(std::vector<cv::Mat>{chroma, shadedImage()}, pairs);
  EXPECT_LE(cv::norm(shadedImage(), toGrayImage(makeImage("yuv422", pairs)), cv::NORM_INF), 20.0);
}

TEST(ImageConversions, WhatIsNoPictureIsNamedWithWhatIsRead) {
  const cv::Mat depth(4, 4, CV_32FC1, cv::Scalar(1.5)), pairs(4, 4, CV_8UC2, cv::Scalar(1, 2));
  for (const auto& message : {makeImage("32FC1", depth), makeImage("8UC2", pairs)}) {
    const std::string fault = faultOf([&] { toGrayImage(message); });
    EXPECT_NE(std::string::npos, fault.find("'" + message.encoding + "' is no picture")) << fault;
    EXPECT_NE(std::string::npos, fault.find("mono8")) << fault;
  }
  sensor_msgs::CompressedImage compressed;
  compressed.format = "16UC1; compressedDepth png";
  compressed.data.resize(100);
  EXPECT_NE(std::string::npos, faultOf([&] { toGrayImage(compressed); }).find("no picture"));
}

TEST(ImageConversions, AMaskIsGreyOrRefusedByName) {
  EXPECT_EQ(0.0, cv::norm(shadedImage(), toMask(makeImage("mono8", shadedImage()))));
  const cv::Mat colour(4, 4, CV_8UC3, cv::Scalar(200, 0, 0));
  EXPECT_NE(std::string::npos, faultOf([&] { toMask(makeImage("bgr8", colour)); }).find("'bgr8'"));
}

TEST(ImageConversions, BayerMosaicsOfAGreySceneBecomeThatScene) {
  const cv::Mat gray = shadedImage();
  const cv::Rect inner(2, 2, gray.cols - 4, gray.rows - 4);
  for (const char* encoding : {"bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"})
    EXPECT_LE(cv::norm(gray(inner), toGrayImage(makeImage(encoding, gray))(inner), cv::NORM_INF),
              2.0)
        << encoding;
}

TEST(ImageConversions, TheCopyOutlivesTheMessage) {
  cv::Mat gray;
  {
    const sensor_msgs::Image message = makeImage("mono8", shadedImage());
    gray = toGrayImage(message);
    EXPECT_NE(message.data.data(), gray.data);
  }
  EXPECT_EQ(0.0, cv::norm(gray, shadedImage(), cv::NORM_INF));
}

TEST(ImageConversions, BrokenImagesAreNamedAndNeverRead) {
  const sensor_msgs::Image good = makeImage("mono8", shadedImage());
  sensor_msgs::Image bad = good;
  bad.data.resize(100);
  EXPECT_NE(std::string::npos, faultOf([&] { toGrayImage(bad); }).find("100 bytes"));
  bad = good;
  bad.step = 10;
  EXPECT_NE(std::string::npos, faultOf([&] { toGrayImage(bad); }).find("step is 10"));
  bad = good;
  bad.width = 0;
  EXPECT_NE(std::string::npos, faultOf([&] { toGrayImage(bad); }).find("empty"));
  bad = good;
  bad.encoding = "sepia";
  EXPECT_NE(std::string::npos, faultOf([&] { toGrayImage(bad); }).find("'sepia'"));
  bad = good;
  bad.height = 0xffffffffu;
  bad.step = 0xffffffffu;
  EXPECT_NE("", faultOf([&] { toGrayImage(bad); }));
}

TEST(ImageConversions, CompressedImagesAreDecodedOrNamed) {
  sensor_msgs::CompressedImage message;
  message.format = "png";
  cv::imencode(".png", shadedImage(), message.data);
  EXPECT_EQ(0.0, cv::norm(shadedImage(), toGrayImage(message), cv::NORM_INF));
  message.data.resize(20);
  EXPECT_NE(std::string::npos, faultOf([&] { toGrayImage(message); }).find("can't be decoded"));
  message.data.clear();
  EXPECT_NE("", faultOf([&] { toGrayImage(message); }));
}

TEST(CameraInfo, BecomesTheCalibrationOfTheRawImage) {
  const CameraCalibration calibration = toCalibration(makeInfo());
  EXPECT_EQ(640, calibration.width);
  EXPECT_EQ(510.0, calibration.fy);
  EXPECT_EQ(321.0, calibration.cx);
  EXPECT_EQ(DistortionModel::kPlumbBob, calibration.distortion_model);
  EXPECT_EQ(makeInfo().D, calibration.distortion);
}

TEST(CameraInfo, ShortDistortionIsReadOnlyAsFarAsItGoes) {
  sensor_msgs::CameraInfo info = makeInfo();
  info.D = {0.1, -0.2, 0.001, 0.002};
  EXPECT_EQ(4u, toCalibration(info).distortion.size());
  info.D = {0.1, -0.2};
  EXPECT_EQ((std::vector<double>{0.1, -0.2, 0.0, 0.0}), toCalibration(info).distortion);
  info.D.clear();
  EXPECT_NO_THROW(toCalibration(info));
  info.distortion_model = "";
  EXPECT_EQ(DistortionModel::kNone, toCalibration(info).distortion_model);
}

TEST(CameraInfo, DistortionThatTheModelCannotHoldIsRefusedRatherThanIgnored) {
  sensor_msgs::CameraInfo info = makeInfo();
  info.D = {0.1, -0.2, 0.001, 0.002, 0.05, 0.3, 0.1, 0.2};
  EXPECT_NE(std::string::npos, faultOf([&] { toCalibration(info); }).find("8 coefficients"));
  info.distortion_model = "rational_polynomial";
  EXPECT_EQ(8u, toCalibration(info).distortion.size());
  info.distortion_model = "fancy";
  EXPECT_NE(std::string::npos, faultOf([&] { toCalibration(info); }).find("fancy"));
}

TEST(CameraInfo, BinningAndRegionOfInterestMoveTheCalibration) {
  sensor_msgs::CameraInfo info = makeInfo();
  info.roi.x_offset = 100;
  info.roi.y_offset = 40;
  info.roi.width = 320;
  info.roi.height = 240;
  info.binning_x = info.binning_y = 2;
  const CameraCalibration calibration = toCalibration(info);
  EXPECT_EQ(160, calibration.width);
  EXPECT_EQ(120, calibration.height);
  EXPECT_DOUBLE_EQ(250.0, calibration.fx);
  EXPECT_DOUBLE_EQ((321.0 - 100.0) / 2, calibration.cx);
  EXPECT_DOUBLE_EQ((243.0 - 40.0) / 2, calibration.cy);
  info.roi.x_offset = 400;
  EXPECT_NE(std::string::npos, faultOf([&] { toCalibration(info); }).find("roi"));
}

TEST(CameraInfo, OfBinnedImagesWhoseMatrixIsBinnedAlreadyIsDoubted) {
  sensor_msgs::CameraInfo info = makeInfo();
  info.binning_x = info.binning_y = 2;
  EXPECT_TRUE(calibrationDoubts(info, toCalibration(info)).empty());
  for (double& number : info.K) number *= 0.5;
  const auto doubts = calibrationDoubts(info, toCalibration(info));
  ASSERT_FALSE(doubts.empty());
  EXPECT_NE(std::string::npos, doubts.back().find("binning")) << doubts.back();
}

TEST(CameraInfo, OfRectifiedImagesIsTheProjection) {
  EXPECT_TRUE(isRectifiedTopic("/camera/image_rect"));
  EXPECT_TRUE(isRectifiedTopic("/camera/image_rect_color/compressed"));
  EXPECT_FALSE(isRectifiedTopic("/camera/image_raw"));
  EXPECT_FALSE(isRectifiedTopic("/rectangle/image"));
  sensor_msgs::CameraInfo info = makeInfo();
  EXPECT_NE(std::string::npos, faultOf([&] { toCalibration(info, true); }).find("P[0]"));
  info.P = {450, 0, 310, 0, 0, 451, 240, 0, 0, 0, 1, 0};
  const CameraCalibration calibration = toCalibration(info, true);
  EXPECT_EQ(450.0, calibration.fx);
  EXPECT_EQ(451.0, calibration.fy);
  EXPECT_EQ(310.0, calibration.cx);
  EXPECT_EQ(240.0, calibration.cy);
  EXPECT_FALSE(hasDistortion(calibration));
}

TEST(CameraInfo, SkewIsRefusedByName) {
  sensor_msgs::CameraInfo info = makeInfo();
  info.K[1] = 3.0;
  EXPECT_NE(std::string::npos, faultOf([&] { toCalibration(info); }).find("skew"));
}

TEST(CameraInfo, AnUncalibratedCameraIsNamed) {
  sensor_msgs::CameraInfo info = makeInfo();
  info.K.fill(0.0);
  EXPECT_NE(std::string::npos, faultOf([&] { toCalibration(info); }).find("uncalibrated"));
  info = makeInfo();
  info.K[0] = std::nan("");
  EXPECT_NE("", faultOf([&] { toCalibration(info); }));
  info = makeInfo();
  info.width = 0;
  EXPECT_NE("", faultOf([&] { toCalibration(info); }));
}

TEST(CameraInfo, NoNumbersWhateverDoMoreThanBeRefused) {
  std::mt19937 generator(7);
  const double odd[] = {0.0, -1.0, 1e300, -1e300, 1e-300, NAN, INFINITY, 500.0, 320.0};
  const auto pick = [&](auto list) { return *(std::begin(list) + generator() % std::size(list)); };
  const std::vector<std::uint32_t> sizes = {0u, 1u, 2u, 479u, 480u, 640u, 0x7fffffffu, 0xffffffffu};
  const std::vector<std::string> models = {"plumb_bob", "equidistant", "rational_polynomial", "x"};
  int accepted = 0;
  for (int i = 0; i < fuzzInputs(20000); ++i) {
    sensor_msgs::CameraInfo info = makeInfo();
    for (int change = generator() % 4; change >= 0; --change) switch (generator() % 7) {
        case 0:
          info.K[generator() % 9] = odd[generator() % std::size(odd)];
          break;
        case 1:
          info.D.resize(generator() % 15, odd[generator() % std::size(odd)]);
          break;
        case 2:
          info.distortion_model = pick(models);
          break;
        case 3:
          info.width = pick(sizes);
          break;
        case 4:
          info.height = pick(sizes);
          break;
        case 5:
          info.roi.width = pick(sizes), info.roi.x_offset = pick(sizes);
          break;
        default:
          info.binning_x = pick(sizes);
      }
    try {
      const CameraCalibration calibration = toCalibration(info);
      ++accepted;
      EXPECT_TRUE(calibration.width > 0 && calibration.fx > 0.0 && std::isfinite(calibration.cx));
    } catch (const std::invalid_argument&) {
    }
  }
  EXPECT_GT(accepted, 100) << "the changes must leave some valid";
}

TEST(ImageConversions, NoMutilationOfAnImageDoesMoreThanBeRefused) {
  std::mt19937 generator(3);
  const std::vector<std::string> names = {"mono8",       "bgr8",  "rgba8", "mono16",
                                          "bayer_rggb8", "16UC1", "32FC1", "bayer_gbrg16",
                                          "yuv422",      "8UC7",  "",      "64FC4"};
  int accepted = 0;
  for (int i = 0; i < fuzzInputs(20000); ++i) {
    sensor_msgs::Image image = makeImage("mono8", shadedImage());
    image.encoding = names[generator() % names.size()];
    if (generator() % 2) image.width = generator() % 70;
    if (generator() % 2) image.height = generator() % 50;
    if (generator() % 2) image.step = generator() % 200;
    image.is_bigendian = generator() % 2;
    image.data.resize(generator() % 4 ? std::size_t{image.step} * image.height
                                      : generator() % 5000);
    try {
      const cv::Mat gray = toGrayImage(image);
      ++accepted;
      EXPECT_EQ(CV_8UC1, gray.type());
      EXPECT_EQ(cv::Size(image.width, image.height), gray.size());
    } catch (const std::runtime_error&) {
    }
  }
  EXPECT_GT(accepted, 100) << "the changes must leave some valid";
}

TEST(CameraInfo, IsTheSameWhateverItsStamp) {
  sensor_msgs::CameraInfo a = makeInfo(), b = makeInfo();
  b.header.stamp = ros::Time(7);
  EXPECT_TRUE(sameCalibration(a, b));
  b.D[1] += 1e-6;
  EXPECT_FALSE(sameCalibration(a, b));
}

}  // namespace
}  // namespace active_matching_slam
