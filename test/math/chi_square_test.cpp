#include "active_matching_slam/math/chi_square.h"

#include <gtest/gtest.h>

#include <cmath>

namespace active_matching_slam {
namespace {

TEST(ChiSquareQuantile, IsThatOfTheTables) {
  EXPECT_NEAR(chiSquareQuantile(1, 0.95), 3.8415, 1e-4);
  EXPECT_NEAR(chiSquareQuantile(6, 0.95), 12.5916, 1e-4);
  EXPECT_NEAR(chiSquareQuantile(100, 0.99), 135.8067, 1e-4);
}

TEST(ChiSquareQuantile, OfTwoDegreesIsExponential) {
  for (const double p : {0.0, 0.1, 0.5, 0.95, 0.9999})
    EXPECT_NEAR(chiSquareQuantile(2, p), -2.0 * std::log(1.0 - p), 1e-9) << p;
}

TEST(ChiSquareQuantile, OfManyDegreesIsNormal) {
  // Wilson and Hilferty: (x / n)^(1/3) is normal with mean 1 - 2 / 9n and variance 2 / 9n.
  const double n = 400.0, spread = 2.0 / (9.0 * n), sigmas = 1.959964;
  EXPECT_NEAR(chiSquareQuantile(n, 0.975),
              n * std::pow(1.0 - spread + sigmas * std::sqrt(spread), 3), 1e-2);
}

}  // namespace
}  // namespace active_matching_slam
