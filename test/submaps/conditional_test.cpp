#include "active_matching_slam/submaps/conditional.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include "submaps/plain_active_map.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

using test::idsFrom;

PointGaussian somePoints(int count, unsigned seed) {
  return test::randomMap(count, {}, seed).points();
}

TEST(Conditional, IsTheRegressionOfAJointGaussian) {
  const PointGaussian joint = somePoints(6, 1);
  const Conditional conditional = Conditional::of(joint, {4, 1}, {3, 0});
  std::vector<int> given = {0, 1};
  for (int row : rowsOf(2, {3, 0})) given.push_back(row);
  const std::vector<int> own = rowsOf(2, {4, 1});
  const Eigen::MatrixXd P_CC = selectBlock(joint.covariance, given, given);
  const Eigen::MatrixXd P_JC = selectBlock(joint.covariance, own, given);
  EXPECT_LT((conditional.K - P_JC * P_CC.inverse()).norm(), 1e-9);
  EXPECT_LT((conditional.Q -
             (selectBlock(joint.covariance, own, own) - P_JC * P_CC.inverse() * P_JC.transpose()))
                .norm(),
            1e-9);
  EXPECT_EQ(conditional.calibrationSize(), 2);
}

TEST(Conditional, AppliedToWhatItIsGivenRestoresTheJoint) {
  const PointGaussian joint = somePoints(7, 2);
  PointGaussian rebuilt;
  rebuilt.ids = idsFrom(0, 5);
  std::vector<int> rows = {0, 1};
  for (int row : rowsOf(2, {0, 1, 2, 3, 4})) rows.push_back(row);
  rebuilt.mean = selectRows(joint.mean, rows);
  rebuilt.covariance = selectBlock(joint.covariance, rows, rows);
  Conditional::of(joint, {6, 5}, idsFrom(0, 5)).apply(rebuilt);
  EXPECT_EQ(rebuilt.ids, (std::vector<FeatureId>{0, 1, 2, 3, 4, 6, 5}));
  EXPECT_LT(test::difference(joint, rebuilt), 1e-12);
}

TEST(Conditional, FollowsWhatItIsGiven) {
  PointGaussian joint = somePoints(4, 3);
  const Conditional conditional = Conditional::of(joint, {3}, {0, 2});
  EXPECT_LT((conditional.meanAt(joint) - joint.mean.tail(3)).norm(), 1e-12);
  joint.mean.segment<3>(joint.firstRow(2)) += Eigen::Vector3d(0.1, -0.2, 0.3);
  EXPECT_LT((conditional.meanAt(joint) -
             (joint.mean.tail(3) + conditional.K.rightCols(3) * Eigen::Vector3d(0.1, -0.2, 0.3)))
                .norm(),
            1e-12);
}

TEST(Conditional, OfAScaledMapIsTheScaledConditional) {
  PointGaussian joint = somePoints(5, 4);
  Conditional conditional = Conditional::of(joint, {1, 2}, {0, 4});
  conditional.rescale(2.5);
  Eigen::VectorXd scale = Eigen::VectorXd::Constant(joint.mean.size(), 2.5);
  scale.head(2).setOnes();
  joint.mean = joint.mean.cwiseProduct(scale);
  joint.covariance = scale.asDiagonal() * joint.covariance * scale.asDiagonal();
  const Conditional other = Conditional::of(joint, {1, 2}, {0, 4});
  EXPECT_LT((conditional.K - other.K).norm(), 1e-12 * other.K.norm());
  EXPECT_LT((conditional.Q - other.Q).norm(), 1e-12 * other.Q.norm());
  EXPECT_LT((conditional.meanAt(joint) - other.mean).norm(), 1e-12);
}

TEST(Conditional, OfACalibrationThatIsKnownExactly) {
  PointGaussian joint = somePoints(4, 5);
  joint.covariance.topRows(1).setZero();
  joint.covariance.leftCols(1).setZero();
  const Conditional conditional = Conditional::of(joint, {3}, {0, 1, 2});
  EXPECT_TRUE(conditional.K.col(0).isZero(0.0));
  EXPECT_TRUE(conditional.K.allFinite());
}

TEST(Conditional, NamesAPointThatIsNotThere) {
  const PointGaussian joint = somePoints(3, 6);
  EXPECT_NE(faultOf([&]() { Conditional::of(joint, {9}, {0}); }).find("point 9"),
            std::string::npos);
  EXPECT_NE(faultOf([&]() {
              Conditional::of(joint, {1}, {0, 1});
            }).find("point 1"),
            std::string::npos);
  EXPECT_NE(faultOf([&]() { marginal(Conditional::of(joint, {1}, {0}), {2}); }).find("point 2"),
            std::string::npos);
}

}  // namespace
}  // namespace active_matching_slam
