#include "active_matching_slam/image/subpixel.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "active_matching_slam/image/correlation.h"
#include "textures.h"

namespace active_matching_slam {
namespace {

TEST(Paraboloid, IsFoundExactly) {
  const Eigen::Vector2d peak(0.21, -0.34);
  float scores[9];
  for (int v = -1; v <= 1; ++v)
    for (int u = -1; u <= 1; ++u) {
      const double du = u - peak.x(), dv = v - peak.y();
      scores[3 * (v + 1) + u + 1] =
          static_cast<float>(0.95 - 0.10 * du * du - 0.05 * dv * dv + 0.03 * du * dv);
    }
  EXPECT_LT((paraboloidPeak(scores) - peak).norm(), 1e-5);
}

TEST(Paraboloid, StaysWithinHalfAPixel) {
  const float slope[9] = {0.1f, 0.5f, 0.89f, 0.1f, 0.5f, 0.9f, 0.1f, 0.5f, 0.89f};
  const Eigen::Vector2d offset = paraboloidPeak(slope);
  EXPECT_LE(offset.cwiseAbs().maxCoeff(), 0.5);
}

TEST(Paraboloid, WithoutAPeakGivesNoOffset) {
  const float flat[9] = {1, 1, 1, 1, 1, 1, 1, 1, 1};
  EXPECT_EQ(paraboloidPeak(flat), Eigen::Vector2d::Zero());
  const float saddle[9] = {0.9f, 0.8f, 0.9f, 1.0f, 0.9f, 1.0f, 0.9f, 0.8f, 0.9f};
  EXPECT_EQ(paraboloidPeak(saddle), Eigen::Vector2d::Zero());
}

/// How precisely each method finds a template again in shifted images of a texture.
struct Errors {
  double paraboloid = 0.0;  ///< root mean square of the distance per axis [px]
  double gradient = 0.0;
  double sigma_px = 0.0;  ///< that the gradient method states
  int lost = 0;           ///< the gradient method gave up
  int count = 0;
};

/// Ratio of the eigenvalues of the structure tensor around (15, 15).
double cornerness(const WaveTexture& texture) {
  Eigen::Matrix2d tensor = Eigen::Matrix2d::Zero();
  for (int v = 10; v <= 20; ++v)
    for (int u = 10; u <= 20; ++u) {
      const Eigen::Vector2d slope(texture.value(u + 0.5, v) - texture.value(u - 0.5, v),
                                  texture.value(u, v + 0.5) - texture.value(u, v - 0.5));
      tensor += slope * slope.transpose();
    }
  const double mean = 0.5 * tensor.trace();
  const double swing = std::sqrt(std::max(mean * mean - tensor.determinant(), 0.0));
  return (mean - swing) / (mean + swing);
}

Errors measureErrors(double shortest_wave, double noise, double gain, double blur) {
  Errors errors;
  double paraboloid = 0.0, gradient = 0.0, variance = 0.0;
  for (unsigned seed = 0; errors.count < 80; ++seed) {
    const WaveTexture texture(100 + seed, shortest_wave, 35.0);
    if (cornerness(texture) < 0.3) continue;  // nobody starts a feature there
    const Eigen::Vector2d shift(std::fmod(0.137 * seed, 1.0) - 0.5,
                                std::fmod(0.531 * seed, 1.0) - 0.5);
    cv::Mat first = texture.render(31, 31);
    cv::Mat second = texture.render(31, 31, -shift.x(), -shift.y());
    if (blur > 0.0) cv::GaussianBlur(second, second, cv::Size(7, 7), blur);
    second.convertTo(second, CV_8U, gain, 20.0);
    addNoise(&first, noise, 2 * seed);
    addNoise(&second, noise, 2 * seed + 1);
    const Template patch = *makeTemplate(first(cv::Rect(10, 10, 11, 11)));
    // The true place is (15, 15) + shift; its nearest pixel is (15, 15).
    std::vector<float> scores;
    Correlator().correlate(second, patch, {{14, 14, 17}, {15, 14, 17}, {16, 14, 17}}, &scores);
    const Eigen::Vector2d peak = Eigen::Vector2d(15, 15) + paraboloidPeak(scores.data());
    const Eigen::Vector2d truth = Eigen::Vector2d(15, 15) + shift;
    paraboloid += (peak - truth).squaredNorm();
    ++errors.count;
    if (const auto fit = refineSubpixel(second, patch, peak)) {
      gradient += (fit->pixel - truth).squaredNorm();
      variance += fit->sigma_px * fit->sigma_px;
    } else {
      ++errors.lost;
    }
  }
  errors.paraboloid = std::sqrt(paraboloid / (2 * errors.count));
  errors.gradient = std::sqrt(gradient / (2 * (errors.count - errors.lost)));
  errors.sigma_px = std::sqrt(variance / (errors.count - errors.lost));
  return errors;
}

TEST(Subpixel, GradientsAreMorePreciseThanTheParaboloid) {
  struct Case {
    const char* name;
    double shortest_wave, noise, gain, blur;
  };
  for (const Case& c : {Case{"clean", 6.0, 0.0, 1.0, 0.0}, Case{"coarse", 12.0, 2.0, 1.0, 0.0},
                        Case{"noisy", 6.0, 5.0, 1.0, 0.0}, Case{"dimmed", 6.0, 2.0, 0.6, 0.0},
                        Case{"blurred", 6.0, 2.0, 1.0, 1.0}}) {
    const Errors errors = measureErrors(c.shortest_wave, c.noise, c.gain, c.blur);
    RecordProperty(std::string("paraboloid_") + c.name, std::to_string(errors.paraboloid));
    RecordProperty(std::string("gradient_") + c.name, std::to_string(errors.gradient));
    std::printf("%-8s paraboloid %.4f px, gradient %.4f px, lost %d of %d\n", c.name,
                errors.paraboloid, errors.gradient, errors.lost, errors.count);
    EXPECT_LT(errors.paraboloid, 0.15) << c.name;
    EXPECT_LT(errors.gradient, 0.08) << c.name;
    EXPECT_LT(errors.gradient, errors.paraboloid) << c.name;
    EXPECT_LE(errors.lost, errors.count / 20) << c.name;
  }
}

TEST(Subpixel, WhatMovesAlikeIsNotMovedToOneSide) {
  // Interpolation that bends the phase of short waves finds all of them off by the same fraction.
  for (const double shift : {0.15, 0.25, -0.35}) {
    double sum = 0.0;
    int count = 0;
    for (unsigned seed = 0; seed < 60; ++seed) {
      const WaveTexture texture(300 + seed, 3.5, 35.0);
      const Template patch = *makeTemplate(texture.render(31, 31)(cv::Rect(10, 10, 11, 11)));
      const auto fit =
          refineSubpixel(texture.render(31, 31, -shift, 0.0), patch, Eigen::Vector2d(15, 15));
      if (!fit) continue;
      sum += fit->pixel.x() - 15.0 - shift;
      ++count;
    }
    ASSERT_GT(count, 50);
    std::printf("shift %.2f px: off by %.4f px on average\n", shift, sum / count);
    EXPECT_LT(std::abs(sum / count), 0.002) << shift;
  }
}

TEST(Subpixel, TellsItsErrorFromWhatIsLeft) {
  for (const double noise : {2.0, 5.0}) {
    const Errors errors = measureErrors(6.0, noise, 1.0, 0.0);
    EXPECT_NEAR(errors.sigma_px / errors.gradient, 1.0, 0.35) << noise;
  }
  const WaveTexture texture(7, 6.0);
  cv::Mat image = texture.render(60, 60);
  addNoise(&image, 2.0, 1);
  const Template patch = *makeTemplate(image(cv::Rect(25, 25, 11, 11)));
  addNoise(&image, 2.0, 2);
  const auto visible = refineSubpixel(image, patch, {30.0, 30.0});
  ASSERT_TRUE(visible);
  image(cv::Rect(25, 25, 3, 11)) = 128;  // something hides a part of it
  const auto hidden = refineSubpixel(image, patch, {30.0, 30.0});
  ASSERT_TRUE(hidden);
  EXPECT_GT(hidden->sigma_px, 2.0 * visible->sigma_px);
}

TEST(Subpixel, TellsAlongWhichAxisItErrsMore) {
  Eigen::Vector2d squares = Eigen::Vector2d::Zero();  // along the long axis and the short one
  double longer = 0.0;
  int count = 0;
  for (unsigned seed = 0; count < 1000; ++seed) {
    const WaveTexture texture(500 + seed, 6.0, 35.0);
    if (cornerness(texture) < 0.1 || cornerness(texture) > 0.3) continue;
    cv::Mat first = texture.render(31, 31), second = first.clone();
    addNoise(&first, 3.0, 2 * seed);
    addNoise(&second, 3.0, 2 * seed + 1);
    const Template patch = *makeTemplate(first(cv::Rect(10, 10, 11, 11)));
    const auto fit = refineSubpixel(second, patch, Eigen::Vector2d(15, 15));
    if (!fit) continue;
    EXPECT_NEAR(fit->noise_shape.trace(), 2.0, 1e-9);
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(fit->noise_shape);
    const Eigen::Vector2d sizes = fit->sigma_px * axes.eigenvalues().cwiseSqrt();
    const Eigen::Vector2d error =
        axes.eigenvectors().transpose() * (fit->pixel - Eigen::Vector2d(15, 15));
    squares += error.cwiseQuotient(sizes).cwiseAbs2().reverse();
    longer += sizes[1] / sizes[0];
    ++count;
  }
  squares /= count;
  std::printf("errors over stated sigma: %.2f along, %.2f across, %.1f times as long as wide\n",
              std::sqrt(squares[0]), std::sqrt(squares[1]), longer / count);
  EXPECT_GT(longer / count, 1.4);
  EXPECT_NEAR(squares[0], 1.0, 0.35);
  EXPECT_NEAR(squares[1], 1.0, 0.4);
}

TEST(Subpixel, GivesUpRatherThanInvent) {
  const WaveTexture texture(7, 6.0);
  const cv::Mat image = texture.render(60, 60);
  const Template patch = *makeTemplate(image(cv::Rect(25, 25, 11, 11)));
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(refineSubpixel(image, patch, {nan, 30.0}));
  EXPECT_FALSE(refineSubpixel(image, patch, {1e300, 30.0}));
  EXPECT_FALSE(refineSubpixel(image, patch, {2.0, 30.0}));  // leaves the image
  EXPECT_FALSE(refineSubpixel(image, patch, {30.0, 59.0}));
  EXPECT_FALSE(refineSubpixel(image, Template(), {30.0, 30.0}));
  const cv::Mat flat(60, 60, CV_8UC1, cv::Scalar(90));
  EXPECT_FALSE(refineSubpixel(flat, patch, {30.0, 30.0}));
  EXPECT_FALSE(refineSubpixel(image, *makeTemplate(flat(cv::Rect(0, 0, 11, 11))), {30.0, 30.0}));
  EXPECT_FALSE(refineSubpixel(cv::Mat(), patch, {30.0, 30.0}));
  const cv::Mat negative = 255 - image;
  EXPECT_FALSE(refineSubpixel(negative, patch, {30.0, 30.0}));
  // An edge says nothing along itself.
  cv::Mat edge(60, 60, CV_8UC1, cv::Scalar(50));
  edge.colRange(30, 60).setTo(200);
  EXPECT_FALSE(refineSubpixel(edge, *makeTemplate(edge(cv::Rect(25, 25, 11, 11))), {30.0, 30.0}));
}

}  // namespace
}  // namespace active_matching_slam
