#include "../../src/matching/gaussian_mass.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

Eigen::Matrix2d randomCovariance(std::mt19937& random, double least, double most) {
  std::uniform_real_distribution<double> log_sigma(std::log(least), std::log(most)), angle(0, M_PI);
  const double a = std::exp(log_sigma(random)), b = std::exp(log_sigma(random)), t = angle(random);
  Eigen::Matrix2d R;
  R << std::cos(t), -std::sin(t), std::sin(t), std::cos(t);
  return R * Eigen::Vector2d(a * a, b * b).asDiagonal() * R.transpose();
}

double normalCdf(double x) { return 0.5 * std::erfc(-x / std::sqrt(2.0)); }

/// Plain: per strip of v the exact mass of u, trapezoidal rule over the ellipse's height after
/// v = center + reach sin(t), which makes the ends smooth.
double plainMass(const SearchEllipse& e, const PixelBox& box, const Eigen::Vector2d& mean,
                 const Eigen::Matrix2d& c) {
  const double exx = e.covariance(0, 0), exy = e.covariance(0, 1), eyy = e.covariance(1, 1);
  const double reach = 3.0 * std::sqrt(eyy), edet = exx * eyy - exy * exy;
  const double variance = c(0, 0) - c(0, 1) * c(0, 1) / c(1, 1);
  const int n = 20000;
  const double t0 = std::asin(std::clamp((box.min_v - 0.5 - e.center.y()) / reach, -1.0, 1.0));
  const double t1 = std::asin(std::clamp((box.max_v + 0.5 - e.center.y()) / reach, -1.0, 1.0));
  double sum = 0.0;
  for (int i = 0; i < n; ++i) {
    const double t = t0 + (t1 - t0) * (i + 0.5) / n, v = e.center.y() + reach * std::sin(t);
    const double dv = v - e.center.y(),
                 half = std::sqrt(edet * std::max(9 * eyy - dv * dv, 0.0)) / eyy;
    const double low = std::max(e.center.x() + exy / eyy * dv - half, box.min_u - 0.5);
    const double high = std::min(e.center.x() + exy / eyy * dv + half, box.max_u + 0.5);
    if (low >= high) continue;
    const double k = v - mean.y(), m = mean.x() + c(0, 1) / c(1, 1) * k, s = std::sqrt(variance);
    sum += std::exp(-0.5 * k * k / c(1, 1)) / std::sqrt(2 * M_PI * c(1, 1)) *
           (normalCdf((high - m) / s) - normalCdf((low - m) / s)) * reach * std::cos(t);
  }
  return sum * (t1 - t0) / n;
}

TEST(MassInEllipse, AgreesWithStripsForAllKindsOfGaussians) {
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 400; ++n) {
    const SearchEllipse ellipse{{normal(random), normal(random)}, randomCovariance(random, 1, 20)};
    const Eigen::Matrix2d covariance = randomCovariance(random, 1, 25);
    const double spread = 3.0 * std::sqrt(ellipse.covariance.trace());
    const Eigen::Vector2d mean =
        ellipse.center + 0.7 * spread * Eigen::Vector2d(normal(random), normal(random));
    EXPECT_NEAR(plainMass(ellipse, {}, mean, covariance), massInEllipse(ellipse, mean, covariance),
                1e-7)
        << ellipse.covariance << "\n"
        << covariance << "\n"
        << (mean - ellipse.center).transpose();
  }
}

TEST(MassInEllipse, IsExactForItsOwnEllipse) {
  std::mt19937 random(6);
  for (int n = 0; n < 20; ++n) {
    const Eigen::Matrix2d covariance = randomCovariance(random, 0.5, 50);
    EXPECT_NEAR(kEllipseMass, massInEllipse({{3, 4}, covariance}, {3, 4}, covariance), 1e-12);
  }
}

TEST(ClippedEllipse, AgreesWithStripsAndCountsOnlyWhatIsLeft) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  PixelBox box;
  box.min_u = 0, box.max_u = 40, box.min_v = 0, box.max_v = 30;
  for (int n = 0; n < 300; ++n) {
    const SearchEllipse ellipse{{20 + 20 * normal(random), 15 + 15 * normal(random)},
                                randomCovariance(random, 1, 12)};
    const Eigen::Matrix2d covariance = randomCovariance(random, 1, 15);
    const Eigen::Vector2d mean =
        ellipse.center + 8 * Eigen::Vector2d(normal(random), normal(random));
    const ClippedEllipse clipped(ellipse, box);
    EXPECT_NEAR(plainMass(ellipse, box, mean, covariance), clipped.mass(mean, covariance), 1e-6);
    // A flat, very wide Gaussian measures the area.
    const double wide = 1e6;
    const double flat = plainMass(ellipse, box, ellipse.center, Eigen::Matrix2d::Identity() * wide);
    EXPECT_NEAR(flat * 2 * M_PI * wide, clipped.area(), 1e-3 * (1 + clipped.area()));
  }
}

TEST(ClippedEllipse, OfAGaussianMuchNarrowerThanTheEllipseAgreesWithStrips) {
  std::mt19937 random(17);
  std::uniform_real_distribution<double> u(0.0, 200.0), v(0.0, 150.0);
  PixelBox box;
  box.min_u = 0, box.max_u = 200, box.min_v = 0, box.max_v = 150;
  int partly = 0;
  for (int n = 0; n < 200; ++n) {
    const SearchEllipse ellipse{{u(random), v(random)}, randomCovariance(random, 20, 60)};
    const Eigen::Matrix2d covariance = randomCovariance(random, 0.6, 12);
    const Eigen::Vector2d mean(u(random), v(random));
    const double mass = ClippedEllipse(ellipse, box).mass(mean, covariance);
    EXPECT_NEAR(plainMass(ellipse, box, mean, covariance), mass, 2e-6) << n;
    partly += mass > 0.01 && mass < 0.99;
  }
  EXPECT_GT(partly, 20);
}

TEST(ClippedEllipse, EqualsTheWholeEllipseInABigBoxAndNothingOutside) {
  PixelBox box;
  box.min_u = box.min_v = 0, box.max_u = box.max_v = 1000;
  std::mt19937 random(8);
  const SearchEllipse ellipse{{500, 500}, randomCovariance(random, 2, 20)};
  const Eigen::Matrix2d covariance = randomCovariance(random, 2, 20);
  EXPECT_NEAR(ellipseArea(ellipse.covariance), ClippedEllipse(ellipse, box).area(), 1e-9);
  EXPECT_NEAR(massInEllipse(ellipse, {510, 495}, covariance),
              ClippedEllipse(ellipse, box).mass({510, 495}, covariance), 1e-7);
  const ClippedEllipse outside({{-500, 500}, ellipse.covariance}, box);
  EXPECT_EQ(0.0, outside.area());
  EXPECT_EQ(0.0, outside.mass({-500, 500}, covariance));
}

TEST(MassOnPixels, IsTheSumOverPixelCentres) {
  std::mt19937 random(9);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 100; ++n) {
    PixelMask mask;
    for (int k = 0; k < 2; ++k)
      forEachEllipseRun(
          {{20 * normal(random), 20 * normal(random)}, randomCovariance(random, 1, 15)}, {},
          [&](const PixelRun& run) { mask.insert(run); });
    const Eigen::Matrix2d covariance = randomCovariance(random, 0.5, 15);
    const Eigen::Vector2d mean(20 * normal(random), 20 * normal(random));
    double plain = 0.0;
    mask.forEachRun([&](const PixelRun& run) {
      for (int u = run.begin_u; u < run.end_u; ++u)
        plain += massOfPixel({u, run.v}, mean, covariance);
    });
    EXPECT_NEAR(plain, massOnPixels(mask, mean, covariance), 1e-8);
  }
}

TEST(MassOnPixels, OfAGaussianNarrowerThanAPixelIsOne) {
  PixelMask mask;
  for (int v = -9; v <= 9; ++v) mask.insert({v, -9, 10});
  std::mt19937 random(12);
  for (int n = 0; n < 50; ++n)
    EXPECT_NEAR(
        1.0, massOnPixels(mask, {0.02 * n, -0.03 * n}, randomCovariance(random, 0.05, 0.39)), 1e-5);
}

TEST(MassOfPixel, IsTheMassOfAUnitSquareForANarrowGaussian) {
  std::mt19937 random(13);
  for (int n = 0; n < 20; ++n) {
    const Eigen::Matrix2d covariance = randomCovariance(random, 0.1, 0.39);
    const Eigen::Vector2d mean(0.1, -0.2);
    PixelBox pixel;
    pixel.min_u = pixel.max_u = pixel.min_v = pixel.max_v = 0;
    const double plain = plainMass({{0, 0}, Eigen::Matrix2d::Identity()}, pixel, mean, covariance);
    EXPECT_NEAR(plain, massOfPixel({0, 0}, mean, covariance), 1e-6);
  }
}

TEST(LiesInside, AgreesWithPointsOnTheBorder) {
  std::mt19937 random(10);
  std::normal_distribution<double> normal;
  int inside = 0, outside = 0;
  for (int n = 0; n < 3000; ++n) {
    const SearchEllipse outer{{0, 0}, randomCovariance(random, 2, 10)};
    const SearchEllipse inner{{3 * normal(random), 3 * normal(random)},
                              randomCovariance(random, 1, 5)};
    const Eigen::Matrix2d L = inner.covariance.llt().matrixL();
    double farthest = 0.0;
    for (int i = 0; i < 4000; ++i) {
      const double t = 2 * M_PI * i / 4000;
      const Eigen::Vector2d p =
          inner.center + std::sqrt(kEllipseRadius2) * L * Eigen::Vector2d(std::cos(t), std::sin(t));
      farthest = std::max(farthest, mahalanobisSquared(outer, p));
    }
    if (std::abs(farthest - kEllipseRadius2) < 1e-3) continue;
    EXPECT_EQ(farthest <= kEllipseRadius2, liesInside(inner, outer));
    ++(farthest <= kEllipseRadius2 ? inside : outside);
  }
  EXPECT_GT(inside, 200);
  EXPECT_GT(outside, 200);
}

TEST(LiesInside, CountsAnEqualEllipseAsInside) {
  std::mt19937 random(11);
  for (int n = 0; n < 100; ++n) {
    const SearchEllipse e{{123.456, 78.9}, randomCovariance(random, 0.5, 100)};
    EXPECT_TRUE(liesInside(e, e));
    const SearchEllipse bigger{e.center, 1.0001 * e.covariance};
    EXPECT_FALSE(liesInside(bigger, e));
  }
}

}  // namespace
}  // namespace active_matching_slam
