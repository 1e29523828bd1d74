#include "active_matching_slam/simulation/sensor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <opencv2/core.hpp>
#include <stdexcept>
#include <string>

namespace active_matching_slam {
namespace {

cv::Mat light(double level) { return cv::Mat(240, 320, CV_32FC1, cv::Scalar(level)); }

TEST(Sensor, NoiseHasTheStatedStrengthAtEveryGrey) {
  const Sensor sensor(320, 240, 3.0, 0.0);
  EXPECT_NEAR(sensor.noiseAt(128.0), 3.0, 1e-12);
  for (double grey : {30.0, 80.0, 128.0, 200.0}) {
    cv::Mat image;
    sensor.expose(light(grey / 255.0), 1.0, 7, image);
    cv::Scalar mean, deviation;
    cv::meanStdDev(image, mean, deviation);
    EXPECT_NEAR(mean[0], grey, 0.05);
    const double rounding = 1.0 / 12.0;
    EXPECT_NEAR(deviation[0], std::sqrt(std::pow(sensor.noiseAt(grey), 2) + rounding), 0.04);
  }
}

TEST(Sensor, NoiseOfNeighboursAndOfFramesIsIndependent) {
  const Sensor sensor(320, 240, 4.0, 0.0);
  cv::Mat one, two, again;
  sensor.expose(light(0.5), 1.0, 1, one);
  sensor.expose(light(0.5), 1.0, 2, two);
  sensor.expose(light(0.5), 1.0, 1, again);
  EXPECT_EQ(cv::norm(one, again, cv::NORM_INF), 0.0);
  cv::Mat a, b;
  one.convertTo(a, CV_32F);
  two.convertTo(b, CV_32F);
  a -= cv::mean(a);
  b -= cv::mean(b);
  const double variance = a.dot(a);
  EXPECT_LT(std::abs(a.dot(b)) / variance, 0.02);
  const cv::Mat left = a.colRange(0, 319).clone(), right = a.colRange(1, 320).clone();
  EXPECT_LT(std::abs(left.dot(right)) / variance, 0.02);
}

TEST(Sensor, GainScalesAndWhiteClips) {
  const Sensor sensor(320, 240, 0.0, 0.0);
  cv::Mat image;
  sensor.expose(light(0.2), 2.0, 1, image);
  EXPECT_EQ(image.at<uchar>(5, 5), 102);
  sensor.expose(light(0.9), 2.0, 1, image);
  EXPECT_EQ(image.at<uchar>(5, 5), 255);
}

TEST(Sensor, CornersLoseTheStatedFractionOfLight) {
  const Sensor sensor(320, 240, 0.0, 0.4);
  cv::Mat image;
  sensor.expose(light(200.0 / 255.0), 1.0, 1, image);
  EXPECT_EQ(image.at<uchar>(120, 160), 200);
  EXPECT_NEAR(image.at<uchar>(0, 0), 120, 1);
}

TEST(Sensor, RefusesValuesOutOfRangeByName) {
  const auto message = [](double noise, double vignetting) {
    try {
      Sensor(64, 64, noise, vignetting);
    } catch (const std::invalid_argument& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  EXPECT_EQ(message(-1.0, 0.0), "noise = -1 is out of range [0, 50]");
  EXPECT_EQ(message(1.0, 2.0), "vignetting = 2 is out of range [0, 0.9]");
  EXPECT_NE(message(std::nan(""), 0.0), "");
}

}  // namespace
}  // namespace active_matching_slam
