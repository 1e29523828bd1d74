#include "active_matching_slam/tracker/image_motion_prior.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <random>

namespace active_matching_slam {
namespace {

constexpr double kNoisePx2 = 0.25;

struct Case {
  MeasurementPrior prior;
  std::vector<std::optional<Eigen::Vector2d>> before_px;
};

/// Features of a camera that may turn by much and move by less, seen about `shift` before.
Case makeCase(int features, unsigned seed, const Eigen::Vector2d& shift = {12.0, -5.0}) {
  std::mt19937 generator(seed);
  std::normal_distribution<double> normal;
  Case result;
  MeasurementPrior& prior = result.prior;
  prior.z.resize(2 * features);
  Eigen::MatrixXd J(2 * features, 5);
  for (int i = 0; i < features; ++i) {
    prior.ids.push_back(i);
    prior.z.segment<2>(2 * i) << 320.0 + 120.0 * normal(generator),
        240.0 + 90.0 * normal(generator);
    const double depth = 1.0 + std::abs(normal(generator));
    J.middleRows<2>(2 * i) << 40.0, 0.0, -0.1 * (prior.z[2 * i + 1] - 240.0), 20.0 / depth, 0.0,
        0.0, 40.0, 0.1 * (prior.z[2 * i] - 320.0), 0.0, 20.0 / depth;
    const Eigen::Vector2d own(normal(generator), normal(generator));
    result.before_px.emplace_back(prior.mean(i) - shift + 3.0 * own);
  }
  prior.S = J * J.transpose();
  prior.S.diagonal().array() += kNoisePx2 + 0.5;
  prior.noise_variance_px2 = kNoisePx2;
  return result;
}

ImageMotion shiftedBy(double u, double v, double sigma_px) {
  ImageMotion motion;
  motion.shift_px = Eigen::Vector2d(u, v);
  motion.sigma_px = sigma_px;
  return motion;
}

/// Mean shift of all features in a Gaussian over their image points.
Eigen::MatrixXd meanShift(int features) {
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(2, 2 * features);
  for (int i = 0; i < features; ++i) M.middleCols<2>(2 * i).setIdentity();
  return M / features;
}

TEST(ImageMotionPrior, TheFeaturesTogetherGoWhereTheImageWent) {
  const int n = 30;
  const Case c = makeCase(n, 1);
  const ImageMotion motion = shiftedBy(52.0, -25.0, 2.0);
  const MeasurementPrior after = conditionOnImageMotion(c.prior, c.before_px, motion);
  Eigen::Vector2d wanted = Eigen::Vector2d::Zero();
  for (const auto& before : c.before_px) wanted += motion(*before) / n;
  const Eigen::MatrixXd M = meanShift(n);
  EXPECT_LT((M * after.z - wanted).norm(), 1.0);
  EXPECT_GT((M * c.prior.z - wanted).norm(), 40.0);
  const Eigen::Matrix2d S = M * after.S * M.transpose();
  EXPECT_GT(std::sqrt(S.trace() / 2.0), 1.5);  // no better known than the image's motion is
  EXPECT_LT(std::sqrt(S.trace() / 2.0), 4.0);
}

/// The same by the information form: inverse of S without noise, plus that of three pseudo
/// measurements made by explicit sums.
TEST(ImageMotionPrior, IsBayesRule) {
  const int n = 12;
  const Case c = makeCase(n, 2);
  ImageMotion motion = shiftedBy(10.0, 4.0, 3.0);
  motion.turn = Eigen::Rotation2Dd(0.02).toRotationMatrix();
  const MeasurementPrior after = conditionOnImageMotion(c.prior, c.before_px, motion);

  Eigen::Vector2d centre = Eigen::Vector2d::Zero();
  for (int i = 0; i < n; ++i) centre += c.prior.mean(i) / n;
  double square = 0.0;
  for (int i = 0; i < n; ++i) square += (c.prior.mean(i) - centre).squaredNorm();
  const double radius = std::sqrt(square / n);
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(3, 2 * n);
  Eigen::VectorXd r(2 * n);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d arm = c.prior.mean(i) - centre;
    A(0, 2 * i) = A(1, 2 * i + 1) = 1.0 / n;
    A(2, 2 * i) = -arm.y() * radius / square;
    A(2, 2 * i + 1) = arm.x() * radius / square;
    r.segment<2>(2 * i) = motion(*c.before_px[i]) - c.prior.mean(i);
  }
  const Eigen::Vector3d common = A * r;
  double spread = 0.0;
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d arm = (c.prior.mean(i) - centre) / radius;
    const Eigen::Vector2d explained =
        common.head<2>() + common[2] * Eigen::Vector2d(-arm.y(), arm.x());
    spread += (r.segment<2>(2 * i) - explained).squaredNorm() / (2.0 * n);
  }
  const double variance = 9.0 + 0.25 * spread;
  const Eigen::MatrixXd noise = kNoisePx2 * Eigen::MatrixXd::Identity(2 * n, 2 * n);
  const Eigen::MatrixXd information = (c.prior.S - noise).inverse() + A.transpose() * A / variance;
  const Eigen::MatrixXd covariance = information.inverse();
  EXPECT_LT((after.S - noise - covariance).norm(), 1e-6 * covariance.norm());
  const Eigen::VectorXd z = c.prior.z + covariance * A.transpose() * common / variance;
  EXPECT_LT((after.z - z).norm(), 1e-6 * z.norm());
}

TEST(ImageMotionPrior, FollowsAJerkThatThePriorDidNotAllowFor) {
  const int n = 30;
  Case c = makeCase(n, 3);
  const Eigen::MatrixXd M = meanShift(n), shift = n * M.transpose();
  // A turn of the camera, 4 px, and half a pixel of each feature's own.
  c.prior.S = 16.0 * shift * shift.transpose();
  c.prior.S.diagonal().array() += 0.25 + kNoisePx2;
  Eigen::VectorXd turn(2 * n);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector2d arm = c.prior.mean(i) - M * c.prior.z;
    turn.segment<2>(2 * i) << -arm.y(), arm.x();
  }
  const auto wantedOf = [&](const ImageMotion& motion) {
    Eigen::Vector2d wanted = Eigen::Vector2d::Zero();
    for (const auto& before : c.before_px) wanted += motion(*before) / n;
    return wanted;
  };
  for (const double jerk_px : {20.0, 40.0, 80.0}) {
    const ImageMotion motion = shiftedBy(12.0 + jerk_px, -5.0, 3.0);
    const MeasurementPrior after = conditionOnImageMotion(c.prior, c.before_px, motion);
    const Eigen::Vector2d off = M * after.z - wantedOf(motion);
    const Eigen::Matrix2d S = M * after.S * M.transpose();
    EXPECT_LT(off.norm(), 0.25 * jerk_px) << jerk_px;
    EXPECT_LT(off.dot(S.inverse() * off), 9.0) << jerk_px;  // where the gates reach
    EXPECT_LT(std::sqrt(S.trace() / 2.0), 4.0) << jerk_px;  // and no wider than needed
    EXPECT_EQ(after.S, after.S.transpose());
    // What the features do on their own is as open as it was.
    Eigen::VectorXd own = Eigen::VectorXd::Zero(2 * n);
    own[0] = own[2] = 1.0;
    own[4] = own[6] = -1.0;
    own -= turn * (turn.dot(own) / turn.squaredNorm());
    EXPECT_NEAR(own.dot(after.S * own) / own.dot(c.prior.S * own), 1.0, 1e-9) << jerk_px;
  }
}

TEST(ImageMotionPrior, NeverKnowsAMatchBetterThanItsNoise) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const Case c = makeCase(3 + static_cast<int>(seed), seed);
    const MeasurementPrior after =
        conditionOnImageMotion(c.prior, c.before_px, shiftedBy(0.0, 0.0, 1e-6));
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(after.S, Eigen::EigenvaluesOnly);
    EXPECT_GT(eigen.eigenvalues()[0], kNoisePx2 - 1e-9) << seed;
    EXPECT_EQ(after.S, after.S.transpose());
  }
}

TEST(ImageMotionPrior, ThePredictedMotionConfirmsThePrediction) {
  const int n = 40;
  const Case c = makeCase(n, 7);
  ImageMotion predicted = predictedImageMotion(c.prior, c.before_px);
  EXPECT_LT((predicted.shift_px - Eigen::Vector2d(12.0, -5.0)).norm(), 2.0);
  predicted.sigma_px = 3.0;
  const MeasurementPrior after = conditionOnImageMotion(c.prior, c.before_px, predicted);
  EXPECT_LT((meanShift(n) * (after.z - c.prior.z)).norm(), 1.0);
  EXPECT_LT(after.S.trace(), 0.5 * c.prior.S.trace());
}

TEST(ImageMotionPrior, OfTooFewFeaturesSaysNothing) {
  Case c = makeCase(5, 8);
  for (const int i : {0, 2, 3}) c.before_px[i].reset();
  const MeasurementPrior after =
      conditionOnImageMotion(c.prior, c.before_px, shiftedBy(80.0, 0.0, 1.0));
  EXPECT_EQ(after.z, c.prior.z);
  EXPECT_EQ(after.S, c.prior.S);
}

/// A draw from the prior is tracked, to a pixel: gates shrink to about that, and lie where it is.
TEST(ImageMotionPrior, FlowNarrowsGatesAndAWrongOneIsLeftOut) {
  const int n = 30;
  const Case c = makeCase(n, 4);
  std::mt19937 generator(5);
  std::normal_distribution<double> normal;
  Eigen::VectorXd draw(2 * n);
  for (int i = 0; i < 2 * n; ++i) draw[i] = normal(generator);
  Eigen::MatrixXd P = c.prior.S;
  P.diagonal().array() -= kNoisePx2;
  const Eigen::VectorXd truth = c.prior.z + Eigen::MatrixXd(P.llt().matrixL()) * draw;
  std::vector<std::optional<Eigen::Vector2d>> flow;
  for (int i = 0; i < n; ++i)
    flow.emplace_back(truth.segment<2>(2 * i) +
                      Eigen::Vector2d(normal(generator), normal(generator)));
  *flow[7] += Eigen::Vector2d(40.0, 15.0);
  flow[9].reset();
  const auto after = conditionOnFlow(c.prior, flow, 1.0);
  ASSERT_TRUE(after);
  for (int i = 0; i < n; ++i) {
    EXPECT_LT(after->covariance(i).trace(), 0.05 * c.prior.covariance(i).trace()) << i;
    EXPECT_GE(after->covariance(i).trace(), 2.0 * kNoisePx2) << i << ": the noise of a match stays";
    const Eigen::Vector2d off = after->mean(i) - truth.segment<2>(2 * i);
    EXPECT_LT(off.dot(after->covariance(i).inverse() * off), 20.0) << i;
  }
}

TEST(ImageMotionPrior, FlowOfAMinorityIsNoGuide) {
  const int n = 20;
  const Case c = makeCase(n, 6);
  std::vector<std::optional<Eigen::Vector2d>> flow(n);
  for (int i = 0; i < n / 2; ++i) flow[i] = c.prior.mean(i);
  EXPECT_FALSE(conditionOnFlow(c.prior, flow, 1.0));
  flow[n / 2] = c.prior.mean(n / 2);
  EXPECT_TRUE(conditionOnFlow(c.prior, flow, 1.0));
}

}  // namespace
}  // namespace active_matching_slam
