#include "active_matching_slam/information/requested_submaps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <stdexcept>
#include <string>
#include <vector>

#include "active_matching_slam/information/map_structure.h"
#include "active_matching_slam/information/submap_cut.h"
#include "information/random_gaussian.h"

namespace active_matching_slam {
namespace {

constexpr int kRequestFeatures = 30;

struct RequestStructure {
  MutualInformationGraph graph;
  SubmapHierarchy hierarchy;
};

RequestStructure requestStructureOf(unsigned seed) {
  std::vector<std::int64_t> ids(kRequestFeatures);
  std::iota(ids.begin(), ids.end(), 0);
  RequestStructure s;
  s.graph = informationGraph(ids, test::randomMeasurementCovariance(kRequestFeatures, seed));
  s.hierarchy = buildSubmapHierarchy(s.graph);
  return s;
}

TEST(RequestedSubmaps, AreAsManyAsAskedFor) {
  const RequestStructure s = requestStructureOf(1);
  SubmapOptions options;
  for (const int count : {1, 2, 5, 9}) {
    options.count = count;
    EXPECT_EQ(requestedSubmaps(s.graph, s.hierarchy, options).submaps, count);
  }
}

TEST(RequestedSubmaps, PreserveAsMuchAsAskedForAndOneMoreWouldNot) {
  SubmapOptions options;
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const RequestStructure s = requestStructureOf(seed);
    const double of_three = cutIntoSubmaps(s.graph, s.hierarchy, 3).preserved;
    for (const double fraction : {0.3, 0.6, of_three, 0.95}) {
      options.preserve = fraction;
      const SubmapPartition partition = requestedSubmaps(s.graph, s.hierarchy, options);
      EXPECT_GE(partition.preserved, fraction);
      if (partition.submaps + 1 < kRequestFeatures)
        EXPECT_LT(cutIntoSubmaps(s.graph, s.hierarchy, partition.submaps + 1).preserved, fraction);
    }
  }
}

TEST(RequestedSubmaps, AreNoLargerThanAskedFor) {
  const RequestStructure s = requestStructureOf(2);
  SubmapOptions options;
  options.max_features = 7;
  const SubmapPartition partition = requestedSubmaps(s.graph, s.hierarchy, options);
  std::vector<int> size(partition.submaps, 0);
  for (const int label : partition.submap_of_feature) ++size[label];
  EXPECT_LE(*std::max_element(size.begin(), size.end()), 7);
  EXPECT_LT(partition.submaps, kRequestFeatures);
}

TEST(RequestedSubmaps, TwoRequestsAtOnceAreRefusedByName) {
  SubmapOptions options;
  options.count = 3;
  EXPECT_NO_THROW(checkSubmapOptions(options));
  options.preserve = 0.5;
  try {
    checkSubmapOptions(options);
    FAIL() << "both were taken";
  } catch (const std::invalid_argument& error) {
    EXPECT_NE(std::string(error.what()).find("submaps/count = 3 and submaps/preserve = 0.5"),
              std::string::npos)
        << error.what();
  }
}

TEST(RequestedSubmaps, AreInTheSnapshotWithLabelsThatPersist) {
  std::vector<std::int64_t> ids(kRequestFeatures);
  std::iota(ids.begin(), ids.end(), 10);
  const Eigen::MatrixXd S = test::randomMeasurementCovariance(kRequestFeatures, 4);
  MapStructure structure;
  structure.addFrame(ids, S);
  EXPECT_EQ(structure.snapshot().submaps->requested.submaps, 0);
  SubmapOptions options;
  options.count = 4;
  const auto first = structure.snapshot(options).submaps;
  ASSERT_EQ(first->requested.submaps, 4);
  ASSERT_EQ(first->requested.submap_of_feature.size(), ids.size());
  EXPECT_GT(first->requested.preserved_chow_liu, first->requested.preserved_naive);
  // A feature of a lower id would be the first of all, and of the first submap.
  Eigen::MatrixXd with_one_more = Eigen::MatrixXd::Identity(S.rows() + 2, S.cols() + 2);
  with_one_more.topLeftCorner(S.rows(), S.cols()) = S;
  std::vector<std::int64_t> more = ids;
  more.push_back(1);
  structure.addFrame(more, with_one_more);
  const auto second = structure.snapshot(options).submaps;
  int same = 0;
  for (std::size_t i = 0; i < ids.size(); ++i)
    same += second->requested.submap_of_feature[i + 1] == first->requested.submap_of_feature[i];
  EXPECT_GT(same, kRequestFeatures / 2);
}

}  // namespace
}  // namespace active_matching_slam
