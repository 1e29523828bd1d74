#include "active_matching_slam/information/mutual_information_accumulator.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <random>
#include <stdexcept>
#include <utility>

#include "active_matching_slam/information/gaussian_information.h"
#include "information/random_gaussian.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;
using test::randomMeasurementCovariance;

/// Random frames of a map: some features in random order, some covariance.
std::vector<std::int64_t> randomIds(int count, int map_size, unsigned seed) {
  std::vector<std::int64_t> ids(map_size);
  for (int i = 0; i < map_size; ++i) ids[i] = 7 * i + 3;
  std::mt19937 generator(seed);
  std::shuffle(ids.begin(), ids.end(), generator);
  ids.resize(count);
  return ids;
}

TEST(MutualInformationAccumulator, AveragesOverTheFramesThatSawBoth) {
  MutualInformationAccumulator accumulator;
  std::map<std::pair<std::int64_t, std::int64_t>, std::vector<double>> plain;
  std::vector<std::int64_t> visible;
  for (unsigned frame = 0; frame < 25; ++frame) {
    const std::vector<std::int64_t> ids = randomIds(1 + frame % 9, 20, frame);
    const MatrixXd S = randomMeasurementCovariance(static_cast<int>(ids.size()), 100 + frame);
    accumulator.addFrame(ids, S);
    visible.insert(visible.end(), ids.begin(), ids.end());
    for (std::size_t a = 0; a < ids.size(); ++a) {
      for (std::size_t b = 0; b < ids.size(); ++b) {
        if (ids[a] < ids[b]) plain[{ids[a], ids[b]}].push_back(pairInformationBits(S, a, b));
      }
    }
  }
  std::sort(visible.begin(), visible.end());
  visible.erase(std::unique(visible.begin(), visible.end()), visible.end());
  const MutualInformationGraph graph = accumulator.links();
  EXPECT_EQ(graph.ids, visible);
  ASSERT_EQ(graph.links.size(), plain.size());
  auto expected = plain.begin();  // sorted by (first, second), as the links must be
  for (const InformationLink& link : graph.links) {
    EXPECT_EQ(std::make_pair(link.first, link.second), expected->first);
    EXPECT_EQ(link.frames, static_cast<int>(expected->second.size()));
    double mean = 0.0;
    for (double bits : expected->second) mean += bits / expected->second.size();
    EXPECT_NEAR(link.information_bits, mean, 1e-9 * std::max(1.0, mean));
    ++expected;
  }
}

TEST(MutualInformationAccumulator, AFeatureSeenAloneHasNoLinks) {
  MutualInformationAccumulator accumulator;
  accumulator.addFrame({}, MatrixXd(0, 0));
  accumulator.addFrame({5}, MatrixXd::Identity(2, 2));
  EXPECT_EQ(accumulator.links().ids, (std::vector<std::int64_t>{5}));
  EXPECT_TRUE(accumulator.links().links.empty());
}

TEST(MutualInformationAccumulator, IndependentFeaturesSeenTogetherHaveALinkOfZeroBits) {
  MutualInformationAccumulator accumulator;
  accumulator.addFrame({1, 2}, MatrixXd::Identity(4, 4));
  ASSERT_EQ(accumulator.links().links.size(), 1u);
  EXPECT_DOUBLE_EQ(accumulator.links().links[0].information_bits, 0.0);
  EXPECT_EQ(accumulator.links().links[0].frames, 1);
}

TEST(MutualInformationAccumulator, RemovedFeaturesLeaveWithTheirLinks) {
  MutualInformationAccumulator accumulator;
  const MatrixXd S = randomMeasurementCovariance(5, 1);
  accumulator.addFrame({10, 11, 12, 13, 14}, S);
  accumulator.remove(12);
  accumulator.remove(99);
  MutualInformationGraph graph = accumulator.links();
  EXPECT_EQ(graph.ids, (std::vector<std::int64_t>{10, 11, 13, 14}));
  EXPECT_EQ(graph.links.size(), 6u);
  for (const InformationLink& link : graph.links) {
    EXPECT_NE(link.first, 12);
    EXPECT_NE(link.second, 12);
  }
  accumulator.forgetWeakest({14, 10, 500}, 0);
  graph = accumulator.links();
  EXPECT_EQ(graph.ids, (std::vector<std::int64_t>{10, 14}));
  ASSERT_EQ(graph.links.size(), 1u);
  EXPECT_NEAR(graph.links[0].information_bits, pairInformationBits(S, 0, 4), 1e-12);
  accumulator.clear();
  EXPECT_TRUE(accumulator.links().ids.empty());
}

TEST(MutualInformationAccumulator, OfWhatHasLeftTheMapTheWeakestIsForgottenFirst) {
  constexpr int kFeatures = 12, kKept = 4;
  MutualInformationAccumulator accumulator;
  std::vector<std::int64_t> ids(kFeatures);
  for (int i = 0; i < kFeatures; ++i) ids[i] = 100 + i;
  accumulator.addFrame(ids, randomMeasurementCovariance(kFeatures, 3));
  const MutualInformationGraph before = accumulator.links();
  std::map<std::int64_t, double> bits;
  for (const InformationLink& link : before.links) {
    bits[link.first] += link.information_bits;
    bits[link.second] += link.information_bits;
  }
  const std::vector<std::int64_t> in_map = {111, 100, 105};
  accumulator.forgetWeakest(in_map, kFeatures);
  EXPECT_EQ(accumulator.links().ids, before.ids);
  accumulator.forgetWeakest(in_map, kKept);
  const MutualInformationGraph after = accumulator.links();
  ASSERT_EQ(after.ids.size(), in_map.size() + kKept);
  const auto isKept = [&](std::int64_t id) {
    return std::binary_search(after.ids.begin(), after.ids.end(), id);
  };
  double weakest_kept = std::numeric_limits<double>::infinity(), strongest_gone = 0.0;
  for (const std::int64_t id : ids) {
    if (std::find(in_map.begin(), in_map.end(), id) != in_map.end()) {
      EXPECT_TRUE(isKept(id));
    } else if (isKept(id)) {
      weakest_kept = std::min(weakest_kept, bits[id]);
    } else {
      strongest_gone = std::max(strongest_gone, bits[id]);
    }
  }
  EXPECT_GT(weakest_kept, strongest_gone);
}

TEST(MutualInformationAccumulator, AnUnusableFeatureDoesNotCountAsSeen) {
  MutualInformationAccumulator accumulator;
  MatrixXd S = randomMeasurementCovariance(3, 1);
  accumulator.addFrame({1, 2, 3}, S);
  const double before = accumulator.links().links[0].information_bits;
  S(0, 0) = std::numeric_limits<double>::quiet_NaN();
  accumulator.addFrame({1, 2, 3}, S);
  accumulator.addFrame({1, 2, 3}, MatrixXd::Zero(6, 6));
  const MutualInformationGraph graph = accumulator.links();
  EXPECT_EQ(graph.links[0].frames, 1);
  EXPECT_DOUBLE_EQ(graph.links[0].information_bits, before);
  EXPECT_EQ(graph.links[2].frames, 2);  // (2, 3)
  S = randomMeasurementCovariance(3, 1);
  S(0, 2) = S(2, 0) = std::numeric_limits<double>::infinity();
  accumulator.addFrame({1, 2, 3}, S);
  for (const InformationLink& link : accumulator.links().links) {
    EXPECT_TRUE(std::isfinite(link.information_bits));
  }
}

TEST(MutualInformationAccumulator, GoesOnFromAStoredGraph) {
  MutualInformationAccumulator whole, first;
  const MatrixXd S = randomMeasurementCovariance(4, 1), T = randomMeasurementCovariance(4, 2);
  whole.addFrame({1, 2, 3, 4}, S);
  first.addFrame({1, 2, 3, 4}, S);
  MutualInformationAccumulator second(first.links());
  whole.addFrame({2, 3, 4, 5}, T);
  second.addFrame({2, 3, 4, 5}, T);
  const MutualInformationGraph a = whole.links(), b = second.links();
  EXPECT_EQ(a.ids, b.ids);
  ASSERT_EQ(a.links.size(), b.links.size());
  for (std::size_t e = 0; e < a.links.size(); ++e) {
    EXPECT_DOUBLE_EQ(a.links[e].information_bits, b.links[e].information_bits);
    EXPECT_EQ(a.links[e].frames, b.links[e].frames);
  }
}

TEST(MutualInformationAccumulator, SaysWhatIsWrong) {
  MutualInformationAccumulator accumulator;
  EXPECT_THROW(accumulator.addFrame({1, 2}, MatrixXd::Identity(2, 2)), std::invalid_argument);
  EXPECT_THROW(accumulator.addFrame({4, 4}, MatrixXd::Identity(4, 4)), std::invalid_argument);
  EXPECT_TRUE(accumulator.links().ids.empty());
  const auto from = [](const MutualInformationGraph& g) { MutualInformationAccumulator stored(g); };
  EXPECT_THROW(from({{2, 1}, {}}), std::invalid_argument);
  EXPECT_THROW(from({{1, 2}, {{1, 3, 1.0, 1, false}}}), std::invalid_argument);
  EXPECT_THROW(from({{1, 2}, {{1, 2, -1.0, 1, false}}}), std::invalid_argument);
  EXPECT_THROW(from({{1, 2}, {{1, 2, 1.0, 0, false}}}), std::invalid_argument);
}

}  // namespace
}  // namespace active_matching_slam
