#include "active_matching_slam/information/greedy_information.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>

namespace active_matching_slam {
namespace {

std::vector<InformativeMeasurement> draw(int count, unsigned seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  std::uniform_real_distribution<double> uniform(0.3, 1.0);
  std::vector<InformativeMeasurement> measurements(count);
  for (InformativeMeasurement& m : measurements) {
    const double size = std::exp(normal(random));
    for (int i = 0; i < m.W.size(); ++i) m.W.data()[i] = size * normal(random);
    m.probability = uniform(random);
  }
  return measurements;
}

double logDeterminant2(const std::vector<InformativeMeasurement>& all,
                       const std::vector<int>& chosen) {
  Eigen::Matrix<double, 12, 12> A = Eigen::Matrix<double, 12, 12>::Identity();
  for (const int i : chosen) A += all[i].W.transpose() * all[i].W;
  return std::log2(A.determinant());
}

TEST(GreedyInformation, IsTheOrderOfTheDefinition) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const auto all = draw(40, seed);
    const GreedyChoice choice = chooseByInformation(all, {15, 0.0, 0.0});
    ASSERT_EQ(choice.order.size(), 15u);
    std::vector<int> chosen;
    for (std::size_t k = 0; k < choice.order.size(); ++k) {
      double most = -1.0;
      int best = -1;
      for (int i = 0; i < 40; ++i) {
        if (std::find(chosen.begin(), chosen.end(), i) != chosen.end()) continue;
        std::vector<int> with = chosen;
        with.push_back(i);
        const double bits =
            all[i].probability * 0.5 * (logDeterminant2(all, with) - logDeterminant2(all, chosen));
        if (bits > most) {
          most = bits;
          best = i;
        }
      }
      EXPECT_EQ(choice.order[k], best) << "seed " << seed << ", step " << k;
      EXPECT_NEAR(choice.bits[k], most, 1e-9);
      chosen.push_back(best);
    }
  }
}

TEST(GreedyInformation, StopsWhereTheNextTellsTooLittle) {
  const auto all = draw(60, 9);
  const GreedyChoice whole = chooseByInformation(all, {60, 0.0, 0.0});
  ASSERT_EQ(whole.order.size(), 60u);
  const double stop = whole.bits[20];
  const GreedyChoice part = chooseByInformation(all, {60, 0.0, stop});
  EXPECT_LE(part.order.size(), 21u);
  for (const double bits : part.bits) EXPECT_GE(bits, stop);
  for (std::size_t k = 0; k < part.order.size(); ++k) EXPECT_EQ(part.order[k], whole.order[k]);
  EXPECT_LT(part.bits_left, stop);
  EXPECT_GT(part.bits_left, 0.0);
  EXPECT_EQ(whole.bits_left, 0.0);
}

TEST(GreedyInformation, DoesNotStopBeforeEnoughAreExpectedToSucceed) {
  const auto all = draw(60, 9);
  const GreedyChoice choice = chooseByInformation(all, {60, 10.0, 1e3});
  double expected = 0.0;
  for (const int i : choice.order) expected += all[i].probability;
  EXPECT_GE(expected, 10.0);
  EXPECT_LT(expected, 11.0);
}

TEST(GreedyInformation, PaysTheLessForWhatCostsTheMore) {
  auto all = draw(40, 4);
  const int first = chooseByInformation(all, {1, 0.0, 0.0}).order.front();
  all[first].cost = 1e3;
  EXPECT_NE(first, chooseByInformation(all, {1, 0.0, 0.0}).order.front());
}

TEST(GreedyInformation, OfOneIsHalfTheLogarithmOfTheDeterminant) {
  const auto all = draw(10, 3);
  for (int i = 0; i < 10; ++i)
    EXPECT_NEAR(informationBits(all[i]), 0.5 * logDeterminant2(all, {i}), 1e-9);
}

TEST(GreedyInformation, CountsWhatAMeasurementTellsBesides) {
  auto all = draw(40, 4);
  const int last = chooseByInformation(all, {40, 0.0, 0.0}).order.back();
  all[last].own_bits = 100.0;
  EXPECT_EQ(last, chooseByInformation(all, {1, 0.0, 0.0}).order.front());
}

TEST(GreedyInformation, OfNothingIsNothing) {
  EXPECT_TRUE(chooseByInformation({}, {10, 0.0, 0.0}).order.empty());
  EXPECT_TRUE(chooseByInformation(draw(3, 1), {0, 0.0, 0.0}).order.empty());
}

}  // namespace
}  // namespace active_matching_slam
