#include "active_matching_slam/submaps/submap_tree.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "active_matching_slam/information/separator.h"
#include "submaps/plain_active_map.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;
using test::idsFrom;
using test::PlainActiveMap;
using Ids = std::vector<FeatureId>;

/// Rows of the camera's motion and the calibration, then of these points.
std::vector<int> stateRows(const PlainActiveMap& map, const Ids& ids) {
  std::vector<int> rows;
  for (int row = 0; row < test::kMotion + test::kCalibration; ++row) rows.push_back(row);
  for (FeatureId id : ids) {
    for (int axis = 0; axis < 3; ++axis) rows.push_back(map.row(id) + axis);
  }
  return rows;
}

MatrixXd covarianceOf(const PlainActiveMap& map, const Ids& ids) {
  const std::vector<int> rows = stateRows(map, ids);
  return selectBlock(map.covariance(), rows, rows);
}

/// Everything active again.
PlainActiveMap unfolded(PlainActiveMap map, SubmapTree tree) {
  while (!tree.leaves().empty()) tree.activate(map, tree.leaves().front().id);
  tree.activateTrunk(map, tree.trunk().ids());
  return map;
}

/// Points 0 to 9, of which the camera knows 0 to 3, and 20 to 24, which hang on 6 and 7 alone.
PlainActiveMap mapWithBlanket(unsigned seed) {
  PlainActiveMap map = test::randomMap(10, idsFrom(0, 4), seed);
  test::RandomNumbers random(seed + 10);
  Conditional hanging;
  hanging.ids = idsFrom(20, 25);
  hanging.given_ids = {6, 7};
  hanging.mean = random.matrix(15, 1);
  hanging.given_mean = random.matrix(test::kCalibration + 6, 1);
  hanging.K = random.matrix(15, test::kCalibration + 6);
  const MatrixXd root = random.matrix(15, 20);
  hanging.Q = root * root.transpose() / 20.0;
  map.insert(hanging);
  return map;
}

TEST(SubmapTree, ALeafWithAMarkovBlanketEqualsThePlainFilter) {
  for (bool conservative : {false, true}) {
    PlainActiveMap plain = mapWithBlanket(1);
    PlainActiveMap map = plain;
    SubmapTree tree;
    tree.rest(map, {9});
    FreezeOptions options;
    options.conservative = conservative;
    const int leaf = tree.freeze(map, idsFrom(20, 25), {6, 7}, {7}, options);
    EXPECT_NEAR(tree.find(leaf)->lost_bits, 0.0, 1e-9);
    EXPECT_EQ(tree.trunk().ids(), (Ids{9, 7}));
    EXPECT_TRUE(tree.isSeparator(6));
    EXPECT_TRUE(tree.isSeparator(7));
    EXPECT_EQ(tree.frozenCount(), 7);
    test::RandomNumbers random(3);
    for (int i = 0; i < 5; ++i) {
      const test::RandomFrame frame = test::randomFrame({0, 2, 6}, random);
      run(frame, plain);
      run(frame, map);
    }
    PointGaussian seen = map.points();
    tree.givenActive(seen, *tree.find(leaf)).apply(seen);
    EXPECT_LT(test::difference(seen, plain.points()), 1e-9);

    EXPECT_EQ(tree.activate(map, leaf), idsFrom(20, 25));
    EXPECT_FALSE(tree.isSeparator(6));
    for (int i = 0; i < 5; ++i) {
      const test::RandomFrame frame = test::randomFrame({1, 7, 22}, random);
      run(frame, plain);
      run(frame, map);
    }
    const PlainActiveMap all = unfolded(map, tree);
    EXPECT_LT((covarianceOf(all, plain.ids()) - plain.covariance()).norm(),
              1e-9 * plain.covariance().norm());
    EXPECT_LT(test::difference(all.points(), plain.points()), 1e-9);
  }
}

TEST(SubmapTree, WhatIsPutBackLeavesAllAsIfItHadNeverCome) {
  PlainActiveMap aside = test::randomMap(14, idsFrom(0, 4), 8);
  SubmapTree tree;
  tree.rest(aside, {4});
  const int id = tree.freeze(aside, {8, 9, 10}, {5, 6, 7}, {5}, {});
  tree.freeze(aside, {11, 12}, {6, 7}, {}, {});
  PlainActiveMap map = aside;
  SubmapTree visited = tree;
  const Leaf leaf = *visited.find(id);
  visited.activate(map, id);
  test::RandomNumbers random(9);
  for (int i = 0; i < 5; ++i) {
    const test::RandomFrame frame = test::randomFrame({0, 2, 7, 13}, random);
    run(frame, aside);
    run(frame, map);
  }
  visited.putBack(map, leaf, {5});
  ASSERT_EQ(visited.leaves().size(), tree.leaves().size());
  EXPECT_EQ(visited.leaves()[0].id, id);
  EXPECT_EQ(visited.leaves()[0].points.Q, leaf.points.Q);
  EXPECT_EQ(visited.trunk().ids(), tree.trunk().ids());
  for (FeatureId separator : {5, 6, 7}) EXPECT_TRUE(visited.isSeparator(separator));
  EXPECT_LT(
      (covarianceOf(map, {0, 1, 2, 3, 6, 7, 13}) - covarianceOf(aside, {0, 1, 2, 3, 6, 7, 13}))
          .norm(),
      1e-9 * aside.covariance().norm());
  const PlainActiveMap one = unfolded(map, visited), other = unfolded(aside, tree);
  EXPECT_LT((covarianceOf(one, idsFrom(0, 14)) - covarianceOf(other, idsFrom(0, 14))).norm(),
            1e-9 * other.covariance().norm());
}

TEST(SubmapTree, LostBitsAreThoseOfTheWholeMap) {
  const PlainActiveMap before = test::randomMap(14, idsFrom(0, 4), 4);
  PlainActiveMap map = before;
  SubmapTree tree;
  tree.rest(map, {4, 5});
  const int leaf = tree.freeze(map, {8, 9, 10, 6}, {5, 6, 11}, {}, {});
  EXPECT_EQ(tree.find(leaf)->points.ids, (Ids{8, 9, 10}));
  const auto rows = [&](const Ids& ids) {
    const std::vector<int> all = stateRows(before, ids);
    return std::vector<int>(all.begin() + test::kMotion + test::kCalibration, all.end());
  };
  std::vector<int> rest = rows({0, 1, 2, 3, 4, 7, 12, 13});
  for (int row = 0; row < test::kMotion; ++row) rest.push_back(row);
  std::vector<int> separator = rows({5, 6, 11});
  for (int row = 0; row < test::kCalibration; ++row) separator.push_back(test::kMotion + row);
  EXPECT_NEAR(tree.find(leaf)->lost_bits,
              separatedInformation(before.covariance(), rows({8, 9, 10}), rest, separator), 1e-8);
}

TEST(SubmapTree, TheConservativeCutIsNotSurerInAnyDirectionAndADroppedLinkIs) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const PlainActiveMap before = test::randomMap(14, idsFrom(0, 4), seed);
    const auto least = [&](bool conservative) {
      PlainActiveMap map = before;
      SubmapTree tree;
      FreezeOptions options;
      options.conservative = conservative;
      tree.rest(map, {4, 5});
      tree.freeze(map, {8, 9, 10}, {5, 6}, {6}, options);
      const MatrixXd more = covarianceOf(unfolded(map, tree), before.ids()) - before.covariance();
      return Eigen::SelfAdjointEigenSolver<MatrixXd>(more).eigenvalues().minCoeff();
    };
    EXPECT_GT(least(true), -1e-9 * before.covariance().norm());
    EXPECT_LT(least(false), -1e-3);
  }
}

TEST(SubmapTree, TheConservativeCutWidensTheRestGivenTheSeparatorAndNothingElse) {
  const PlainActiveMap before = test::randomMap(10, idsFrom(0, 4), 6);
  PlainActiveMap map = before;
  SubmapTree tree;
  tree.freeze(map, {7, 8, 9}, {4, 5}, {}, {});
  const Ids left = {0, 1, 2, 3, 6, 4, 5};
  const MatrixXd more = covarianceOf(map, left) - covarianceOf(before, left);
  const int m = test::kMotion, c = test::kCalibration, n = static_cast<int>(more.rows());
  MatrixXd expected = MatrixXd::Zero(n, n);
  std::vector<int> rest, own, separator;
  for (int row = 0; row < m; ++row) rest.push_back(row);
  for (FeatureId id : {0, 1, 2, 3, 6}) {
    for (int axis = 0; axis < 3; ++axis) rest.push_back(before.row(id) + axis);
  }
  for (FeatureId id : {7, 8, 9}) {
    for (int axis = 0; axis < 3; ++axis) own.push_back(before.row(id) + axis);
  }
  for (int row = 0; row < c; ++row) separator.push_back(m + row);
  for (FeatureId id : {4, 5}) {
    for (int axis = 0; axis < 3; ++axis) separator.push_back(before.row(id) + axis);
  }
  const GivenSeparator sides = givenSeparator(before.covariance(), own, rest, separator);
  const MatrixXd added = conservativeCut(sides.inside, sides.outside, sides.across).outside;
  const int points = static_cast<int>(rest.size()) - m;
  expected.topLeftCorner(m, m) = added.topLeftCorner(m, m);
  expected.block(0, m + c, m, points) = added.topRightCorner(m, points);
  expected.block(m + c, 0, points, m) = added.bottomLeftCorner(points, m);
  expected.block(m + c, m + c, points, points) = added.bottomRightCorner(points, points);
  EXPECT_LT((more - expected).norm(), 1e-9);
  EXPECT_GT(expected.norm(), 1e-3);
}

TEST(SubmapTree, ChoosesASeparatorAmongActivePointsAndTheTrunk) {
  PlainActiveMap map = mapWithBlanket(2);
  SubmapTree tree;
  tree.rest(map, {6});
  FreezeOptions options;
  options.enough_bits = 1e-6;
  double bits = -1.0;
  Ids separator = tree.chooseSeparator(map, idsFrom(20, 25), options, &bits);
  std::sort(separator.begin(), separator.end());
  EXPECT_EQ(separator, (Ids{6, 7}));
  EXPECT_NEAR(bits, 0.0, 1e-6);
  const int leaf = tree.freeze(map, idsFrom(20, 25), separator, {}, options);
  EXPECT_NEAR(tree.find(leaf)->lost_bits, bits, 1e-6);
  EXPECT_TRUE(tree.trunk().empty());  // the separator has become active
}

TEST(SubmapTree, IsRestoredBitForBit) {
  PlainActiveMap map = test::randomMap(14, idsFrom(0, 4), 8);
  SubmapTree tree;
  tree.rest(map, {4, 5});
  tree.freeze(map, {8, 9, 10}, {5, 6}, {6}, {});
  tree.freeze(map, {11, 12}, {5, 7}, {}, {});
  SubmapTree other;
  other.restore(tree.trunk().conditional(), tree.leaves(), tree.nextLeaf());
  EXPECT_TRUE(other.isSeparator(7));
  const PlainActiveMap a = unfolded(map, tree), b = unfolded(map, other);
  EXPECT_EQ(a.ids(), b.ids());
  EXPECT_EQ(a.mean(), b.mean());
  EXPECT_EQ(a.covariance(), b.covariance());

  Leaf wrong = tree.leaves().front();
  wrong.points.ids.front() = tree.trunk().ids().front();
  EXPECT_NE(faultOf([&]() {
              other.restore(tree.trunk().conditional(), {wrong}, 2);
            }).find("is in the trunk too"),
            std::string::npos);
  EXPECT_NE(faultOf([&]() {
              other.restore(tree.trunk().conditional(), tree.leaves(), 1);
            }).find("leaf 1, allowed"),
            std::string::npos);
}

TEST(SubmapTree, RescalingCommutesWithFreezing) {
  const double factor = 3.0;
  const PlainActiveMap metres = test::randomMap(12, idsFrom(0, 4), 9);
  const auto scaled = [&](const PlainActiveMap& map) {
    Eigen::VectorXd scale = Eigen::VectorXd::Constant(map.mean().size(), factor);
    scale.segment(test::kMotion, test::kCalibration).setOnes();
    return PlainActiveMap(test::kMotion, test::kCalibration, map.ids(),
                          map.mean().cwiseProduct(scale),
                          scale.asDiagonal() * map.covariance() * scale.asDiagonal());
  };
  const auto freeze = [](PlainActiveMap& map, SubmapTree& tree) {
    tree.rest(map, {4});
    tree.freeze(map, {8, 9, 10}, {4, 6}, {6}, {});
  };
  PlainActiveMap first = metres;
  SubmapTree first_tree;
  freeze(first, first_tree);
  first_tree.rescale(factor);
  PlainActiveMap second = scaled(metres);
  SubmapTree second_tree;
  freeze(second, second_tree);
  EXPECT_LT(test::difference(unfolded(scaled(first), first_tree).points(),
                             unfolded(second, second_tree).points()),
            1e-9);
}

TEST(SubmapTree, PinsASeparatorForAsLongAsALeafNeedsIt) {
  PlainActiveMap map = test::randomMap(12, {0}, 10);
  SubmapTree tree;
  const int first = tree.freeze(map, {8, 9}, {4, 5}, {4, 5}, {});
  const int second = tree.freeze(map, {10, 11}, {5, 6}, {5}, {});
  EXPECT_NE(first, second);
  EXPECT_EQ(tree.leafOf(10), tree.find(second));
  EXPECT_EQ(tree.leafOf(5), nullptr);
  tree.activate(map, first);
  EXPECT_EQ(tree.find(first), nullptr);
  EXPECT_FALSE(tree.isSeparator(4));
  EXPECT_TRUE(tree.isSeparator(5));
  EXPECT_NE(faultOf([&]() { tree.activate(map, first); }).find("no leaf 0"), std::string::npos);
  tree.clear();
  EXPECT_TRUE(tree.empty());
  EXPECT_FALSE(tree.isSeparator(5));
}

}  // namespace
}  // namespace active_matching_slam
