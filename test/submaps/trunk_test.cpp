#include "active_matching_slam/submaps/trunk.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "active_matching_slam/submaps/submap_tree.h"
#include "submaps/compressed_filter.h"
#include "submaps/plain_active_map.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;
using test::idsFrom;
using test::PlainActiveMap;

/// Covariance of the whole state, with the points in ascending order of their ids.
MatrixXd orderedCovariance(const PlainActiveMap& map) {
  std::vector<FeatureId> ids = map.ids();
  std::sort(ids.begin(), ids.end());
  std::vector<int> rows;
  for (int row = 0; row < test::kMotion + test::kCalibration; ++row) rows.push_back(row);
  for (FeatureId id : ids) {
    for (int axis = 0; axis < 3; ++axis) rows.push_back(map.row(id) + axis);
  }
  return selectBlock(map.covariance(), rows, rows);
}

/// A point that hangs on another.
Conditional newPoint(FeatureId id, FeatureId given, test::RandomNumbers& random) {
  Conditional point;
  point.ids = {id};
  point.given_ids = {given};
  point.mean = random.matrix(3, 1);
  point.given_mean = random.matrix(test::kCalibration + 3, 1);
  point.K = random.matrix(3, test::kCalibration + 3);
  point.Q = MatrixXd::Identity(3, 3);
  return point;
}

TEST(Trunk, PointsComeBackAsTheyLeft) {
  const PlainActiveMap before = test::randomMap(12, idsFrom(0, 4), 1);
  PlainActiveMap map = before;
  SubmapTree tree;
  tree.rest(map, {8, 10, 9});
  EXPECT_EQ(map.points().pointCount(), 9);
  tree.rest(map, {7});
  tree.activateTrunk(map, {9, 7});
  tree.activateTrunk(map, {10, 8});
  EXPECT_TRUE(tree.empty());
  EXPECT_LT(test::difference(before.points(), map.points()), 1e-9);
  EXPECT_LT((orderedCovariance(before) - orderedCovariance(map)).norm(), 1e-9);
}

TEST(Trunk, TellsOfSomeOfItsPointsWithoutTheOthers) {
  PlainActiveMap map = test::randomMap(12, idsFrom(0, 4), 3);
  SubmapTree tree;
  tree.rest(map, {8, 10, 9});
  test::RandomNumbers random(4);
  run(test::randomFrame({0, 1, 2}, random), map);
  Trunk whole = tree.trunk();
  whole.refresh(map.points());
  const Conditional expected = marginal(whole.conditional(), {9, 8});
  const Conditional some = tree.trunk().givenActive(map.points(), {9, 8});
  EXPECT_EQ(some.ids, expected.ids);
  EXPECT_EQ(some.given_ids, expected.given_ids);
  EXPECT_LT((some.mean - expected.mean).norm(), 1e-12);
  EXPECT_LT((some.K - expected.K).norm(), 1e-12);
  EXPECT_LT((some.Q - expected.Q).norm(), 1e-12);
}

TEST(Trunk, APointOfWhichItKnowsNothingLeavesItAsItWas) {
  PlainActiveMap map = test::randomMap(12, idsFrom(0, 4), 5);
  SubmapTree tree;
  tree.rest(map, {8, 9});
  test::RandomNumbers random(6);
  const Conditional fresh = newPoint(50, 1, random);
  map.insert(fresh);
  EXPECT_TRUE(tree.trunk().dependsOn(0));
  EXPECT_FALSE(tree.trunk().dependsOn(50));
  EXPECT_FALSE(tree.trunk().dependsOn(1000));
  for (const bool is_listed : {false, true}) {
    SubmapTree other = tree;
    PlainActiveMap rest = map;
    Trunk listing = other.trunk();
    if (is_listed) {  // with columns of zeros
      listing.refresh(map.points());
      other.restore(listing.conditional(), {}, 0);
    }
    const Conditional before = marginal(other.trunk().conditional(), {8, 9});
    other.remove(rest, {50});
    EXPECT_EQ(other.trunk().conditional().Q, before.Q);
    const auto& given = other.trunk().ids();
    EXPECT_EQ(given, before.ids);
    EXPECT_EQ(std::count(other.trunk().conditional().given_ids.begin(),
                         other.trunk().conditional().given_ids.end(), 50),
              0);
    EXPECT_LT(test::difference(other.trunk().joint(rest.points(), {8, 9}),
                               tree.trunk().joint(rest.points(), {8, 9})),
              1e-12);
  }
}

TEST(Trunk, EqualsThePlainFilterWhateverHappensInBetween) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    PlainActiveMap plain = test::randomMap(14, idsFrom(0, 4), seed);
    PlainActiveMap map = plain;
    SubmapTree tree;
    test::RandomNumbers random(100 + seed);
    const auto frames = [&](int count, const std::vector<FeatureId>& seen) {
      for (int i = 0; i < count; ++i) {
        const test::RandomFrame frame = test::randomFrame(seen, random);
        run(frame, plain);
        run(frame, map);
      }
    };
    tree.rest(map, {8, 9, 10});
    frames(5, {0, 2, 5});
    // A new point, and one that goes for good.
    const Conditional fresh = newPoint(50, 1, random);
    map.insert(fresh);
    plain.insert(fresh);
    tree.remove(map, {7});
    frames(3, {1, 50, 6});
    tree.rest(map, {11, 12});
    frames(3, {50, 3});
    tree.activateTrunk(map, {9, 11});
    frames(4, {9, 11, 2});
    tree.rest(map, {13});
    frames(2, {0, 9});
    EXPECT_LT(test::difference(tree.trunk().joint(map.points(), {12, 8}), plain.points()), 1e-9);
    tree.activateTrunk(map, {8, 10, 12, 13});
    plain.remove({7});
    EXPECT_LT(test::difference(map.points(), plain.points()), 1e-9);
    EXPECT_LT((orderedCovariance(plain) - orderedCovariance(map)).norm(),
              1e-9 * orderedCovariance(plain).norm());
  }
}

TEST(Trunk, TheCameraKeepsWhatItKnowsThroughActivePoints) {
  // The camera knows of point 9 by itself: that is lost, and nothing else.
  const PlainActiveMap before = test::randomMap(10, {0, 9}, 3);
  PlainActiveMap map = before;
  SubmapTree tree;
  tree.rest(map, {9});
  tree.activateTrunk(map, {9});
  EXPECT_LT(test::difference(before.points(), map.points()), 1e-9);
  const int others = test::kMotion + test::kCalibration + 27;
  EXPECT_LT((before.covariance() - map.covariance()).topLeftCorner(others, others).norm(), 1e-9);
  EXPECT_GT((before.covariance() - map.covariance()).norm(), 1e-2);
}

/// Points walk while others rest in the trunk.
struct RandomWalk {
  PlainActiveMap plain;          ///< holds all
  PlainActiveMap map;            ///< without those that rest
  SubmapTree tree;               ///< with them
  test::CompressedFilter exact;  ///< of them
};

RandomWalk walked(double fraction_of_variance, unsigned seed) {
  const int frames = 8;
  PlainActiveMap plain = test::randomMap(12, idsFrom(0, 4), seed);
  const std::vector<FeatureId> resting = {8, 9, 10, 11};
  const int touched = plain.row(8), all = static_cast<int>(plain.mean().size());
  const MatrixXd P = plain.covariance();
  RandomWalk walk{
      plain,
      plain,
      {},
      {plain.mean().tail(all - touched), P.bottomRightCorner(all - touched, all - touched),
       P.bottomLeftCorner(all - touched, touched)}};
  walk.tree.rest(walk.map, resting);
  test::RandomNumbers random(seed + 50);
  for (int i = 0; i < frames; ++i) {
    const test::RandomFrame frame = test::randomFrame({0, 3, 6}, random);
    const int motion = static_cast<int>(frame.F.rows());
    MatrixXd F = MatrixXd::Identity(touched, touched);
    F.topLeftCorner(motion, motion) = frame.F;
    walk.exact.move(F);
    MatrixXd noise = MatrixXd::Zero(all, all);
    for (int row = motion + test::kCalibration; row < touched; ++row) {
      noise(row, row) = fraction_of_variance / frames * walk.plain.covariance()(row, row);
    }
    walk.plain.inflate(noise);
    walk.map.inflate(noise.topLeftCorner(touched, touched));
    walk.plain.move(frame.F, frame.Q);
    walk.map.move(frame.F, frame.Q);
    for (int k = 0; k < 3; ++k) {
      const auto id = frame.seen[static_cast<std::size_t>(k)];
      const Eigen::Matrix2d R = 0.3 * Eigen::Matrix2d::Identity();
      const MatrixXd H = walk.plain.jacobian(id, frame.H.middleRows(2 * k, 2));
      const Eigen::VectorXd z = frame.z.middleRows(2 * k, 2);
      walk.exact.measure(walk.plain.covariance().topLeftCorner(touched, touched),
                         H.leftCols(touched), z - H * walk.plain.mean(), R);
      walk.plain.update(H, z, R);
      walk.map.measure(id, frame.H.middleRows(2 * k, 2), z, R);
    }
  }
  walk.tree.activateTrunk(walk.map, resting);
  return walk;
}

TEST(Trunk, AccumulatorsAreExactUnderAnyProcessNoise) {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const RandomWalk walk = walked(0.5, seed);
    const int size = static_cast<int>(walk.exact.mean().size());
    const MatrixXd P = walk.plain.covariance();
    EXPECT_LT((walk.plain.mean().tail(size) - walk.exact.mean()).norm(), 1e-9);
    EXPECT_LT((P.bottomRightCorner(size, size) - walk.exact.covariance()).norm(), 1e-9 * P.norm());
    EXPECT_LT((P.bottomLeftCorner(size, P.cols() - size) - walk.exact.crossCovariance()).norm(),
              1e-9 * P.norm());
  }
}

TEST(Trunk, LittleProcessNoiseOfActivePointsDoesLittleHarm) {
  for (unsigned seed = 1; seed <= 10; ++seed) {
    const RandomWalk walk = walked(0.03, seed);
    const int size = static_cast<int>(walk.exact.mean().size());
    const MatrixXd plain = walk.exact.covariance();
    const MatrixXd trunk = walk.map.covariance().bottomRightCorner(size, size);
    const Eigen::ArrayXd ratio = trunk.diagonal().array() / plain.diagonal().array();
    EXPECT_GT(ratio.minCoeff(), 0.9) << "seed " << seed;
    EXPECT_LT(ratio.maxCoeff(), 1.1) << "seed " << seed;
    const Eigen::VectorXd off = walk.map.mean().tail(size) - walk.exact.mean();
    EXPECT_LT(off.cwiseQuotient(plain.diagonal().cwiseSqrt()).lpNorm<Eigen::Infinity>(), 0.2)
        << "seed " << seed;
  }
}

TEST(Trunk, NamesAPointThatIsNotThere) {
  PlainActiveMap map = test::randomMap(5, {0}, 1);
  Trunk trunk;
  EXPECT_NE(faultOf([&]() { trunk.take(map.points(), {7}); }).find("point 7"), std::string::npos);
  trunk.take(map.points(), {4});
  map.remove({4});
  EXPECT_NE(faultOf([&]() { trunk.give(map.points(), {3}); }).find("point 3"), std::string::npos);
  map.remove({2});  // behind the trunk's back
  EXPECT_NE(faultOf([&]() { trunk.refresh(map.points()); }).find("point 2"), std::string::npos);
}

}  // namespace
}  // namespace active_matching_slam
