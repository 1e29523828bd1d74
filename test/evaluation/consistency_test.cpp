#include "active_matching_slam/evaluation/consistency.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <random>
#include <stdexcept>

#include "evaluation/test_trajectories.h"

namespace active_matching_slam {
namespace {

TEST(PoseError, MovesTheEstimateOntoTheTruth) {
  const Trajectory poses = randomTrajectory(40);
  const Eigen::Isometry3d estimate = poses[3].T_world_camera, truth = poses[30].T_world_camera;
  const Eigen::Matrix<double, 6, 1> error = poseError(estimate, truth);
  EXPECT_TRUE((estimate.translation() + error.head<3>()).isApprox(truth.translation()));
  const Eigen::Vector3d r = error.tail<3>();
  EXPECT_TRUE((Eigen::AngleAxisd(r.norm(), r.normalized()) * estimate.linear())
                  .isApprox(truth.linear(), 1e-12));
  EXPECT_LT(poseError(truth, truth).norm(), 1e-15);
}

TEST(NormalisedErrorSquared, EqualsThePlainFormula) {
  std::srand(5);
  const Eigen::MatrixXd A = Eigen::MatrixXd::Random(6, 6);
  const Eigen::MatrixXd P = A * A.transpose() + 0.1 * Eigen::MatrixXd::Identity(6, 6);
  const Eigen::VectorXd e = Eigen::VectorXd::Random(6);
  EXPECT_NEAR(*normalisedErrorSquared(e, P), e.dot(P.inverse() * e), 1e-10);
}

TEST(NormalisedErrorSquared, OfAnImproperCovarianceIsEmpty) {
  const Eigen::VectorXd e = Eigen::VectorXd::Ones(3);
  Eigen::MatrixXd P = Eigen::MatrixXd::Identity(3, 3);
  P(2, 2) = 0.0;
  EXPECT_FALSE(normalisedErrorSquared(e, P));
  P(2, 2) = -1.0;
  EXPECT_FALSE(normalisedErrorSquared(e, P));
  P(2, 2) = NAN;
  EXPECT_FALSE(normalisedErrorSquared(e, P));
  EXPECT_FALSE(normalisedErrorSquared(e, Eigen::MatrixXd::Identity(4, 4)));
  EXPECT_FALSE(normalisedErrorSquared(NAN * e, Eigen::MatrixXd::Identity(3, 3)));
  EXPECT_FALSE(normalisedErrorSquared(Eigen::VectorXd(), Eigen::MatrixXd()));
}

TEST(ChiSquareMeanBounds, AgreeWithPublishedTables) {
  // 6 degrees of freedom: 2.5 % and 97.5 % quantiles; 50 runs of 2: Bar-Shalom 2001, section 5.4.
  EXPECT_NEAR(chiSquareMeanBounds(6, 1).lower, 1.2373, 1e-4);
  EXPECT_NEAR(chiSquareMeanBounds(6, 1).upper, 14.4494, 1e-4);
  EXPECT_NEAR(chiSquareMeanBounds(2, 50).lower, 74.2219 / 50, 1e-4);
  EXPECT_NEAR(chiSquareMeanBounds(2, 50).upper, 129.5612 / 50, 1e-4);
}

TEST(ChiSquareMeanBounds, RefuseWhatHasNoMeaning) {
  EXPECT_THROW(chiSquareMeanBounds(0, 1), std::invalid_argument);
  EXPECT_THROW(chiSquareMeanBounds(6, 0), std::invalid_argument);
  EXPECT_THROW(chiSquareMeanBounds(6, 1, 1.0), std::invalid_argument);
  EXPECT_THROW(chiSquareMeanBounds(6, 1, NAN), std::invalid_argument);
}

TEST(LikeliestScale, MakesTheSumOfNormalisedErrorsLeast) {
  std::mt19937 random(3);
  std::normal_distribution<double> normal;
  const auto drawn = [&] {
    return Eigen::Vector3d(normal(random), normal(random), normal(random));
  };
  std::vector<Eigen::Isometry3d> estimates, truth;
  std::vector<Eigen::Matrix<double, 6, 6>> covariances;
  for (int i = 0; i < 20; ++i) {
    Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
    T.translation() = drawn();
    T.linear() = Eigen::AngleAxisd(0.3 * i, drawn().normalized()).toRotationMatrix();
    truth.push_back(T);
    T.translation() = 0.4 * T.translation() + 0.02 * drawn();
    T.linear() = Eigen::AngleAxisd(0.02, drawn().normalized()) * T.linear();
    estimates.push_back(T);
    Eigen::Matrix<double, 6, 6> root;
    for (int k = 0; k < 36; ++k) root(k) = normal(random);
    covariances.push_back(root * root.transpose());
  }
  const auto cost = [&](double scale) {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) {
      Eigen::Isometry3d scaled = truth[i];
      scaled.translation() *= scale;
      sum += *normalisedErrorSquared(poseError(estimates[i], scaled), covariances[i]);
    }
    return sum;
  };
  const auto scale = likeliestScale(estimates, truth, covariances);
  ASSERT_TRUE(scale);
  EXPECT_NEAR(*scale, 0.4, 0.05);
  EXPECT_LT(cost(*scale), cost(*scale + 1e-4));
  EXPECT_LT(cost(*scale), cost(*scale - 1e-4));
}

TEST(LikeliestScale, IsUnknownWithoutMotionOrCovariance) {
  const std::vector<Eigen::Isometry3d> still(2, Eigen::Isometry3d::Identity());
  using Covariances = std::vector<Eigen::Matrix<double, 6, 6>>;
  EXPECT_FALSE(likeliestScale({}, {}, {}));
  EXPECT_FALSE(likeliestScale(still, still, Covariances(2, Covariances::value_type::Identity())));
  std::vector<Eigen::Isometry3d> moved = still;
  moved[1].translation().x() = 1.0;
  EXPECT_FALSE(likeliestScale(moved, moved, Covariances(2, Covariances::value_type::Zero())));
}

class MonteCarlo : public testing::Test {
 protected:
  /// Mean NEES over 30 runs of 400 steps, the covariance stated being `claimed` times the true one.
  std::vector<double> meanNees(double claimed) {
    std::mt19937 random(11);
    std::normal_distribution<double> normal;
    Eigen::MatrixXd root = Eigen::MatrixXd::Zero(6, 6);
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j <= i; ++j) root(i, j) = i == j ? 1.0 + i : normal(random);
    std::vector<std::vector<double>> runs(30, std::vector<double>(400));
    for (auto& run : runs) {
      for (double& nees : run) {
        Eigen::VectorXd e(6);
        for (int i = 0; i < 6; ++i) e(i) = normal(random);
        nees = *normalisedErrorSquared(root * e, claimed * root * root.transpose());
      }
    }
    return meanOverRuns(runs);
  }
  ChiSquareBounds bounds_ = chiSquareMeanBounds(6, 30);
};

TEST_F(MonteCarlo, AConsistentEstimatorLiesWithinTheBoundsNineteenTimesInTwenty) {
  EXPECT_NEAR(fractionWithin(meanNees(1.0), bounds_), 0.95, 0.03);
}

TEST_F(MonteCarlo, AnOverconfidentOrTimidEstimatorDoesNot) {
  EXPECT_LT(fractionWithin(meanNees(0.5), bounds_), 0.05);
  EXPECT_LT(fractionWithin(meanNees(2.0), bounds_), 0.05);
}

TEST(MeanOverRuns, LeavesOutWhatIsMissing) {
  const std::vector<double> mean = meanOverRuns({{1.0, NAN, NAN}, {3.0, 5.0}});
  ASSERT_EQ(mean.size(), 3u);
  EXPECT_EQ(mean[0], 2.0);
  EXPECT_EQ(mean[1], 5.0);
  EXPECT_TRUE(std::isnan(mean[2]));
  EXPECT_EQ(fractionWithin(mean, {1.0, 3.0}), 0.5);
  EXPECT_TRUE(std::isnan(fractionWithin({}, {1.0, 3.0})));
}

}  // namespace
}  // namespace active_matching_slam
