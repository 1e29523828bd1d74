#include "active_matching_slam/information/gaussian_information.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <limits>

#include "information/random_gaussian.h"
#include "information/vectors.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using test::randomMeasurementCovariance;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

/// log2 |P| by an LU factorisation, for the plain formulas.
double plainLogDeterminant(const MatrixXd& P) {
  if (P.rows() == 0) return 0.0;
  const Eigen::PartialPivLU<MatrixXd> lu(P);
  return lu.matrixLU().diagonal().array().abs().log().sum() / std::log(2.0);
}

MatrixXd select(const MatrixXd& P, const std::vector<int>& indices) {
  MatrixXd selected(indices.size(), indices.size());
  for (std::size_t k = 0; k < indices.size(); ++k) {
    for (std::size_t i = 0; i < indices.size(); ++i) selected(i, k) = P(indices[i], indices[k]);
  }
  return selected;
}

std::vector<int> variablesOf(const std::vector<int>& features) {
  std::vector<int> variables;
  for (int feature : features) {
    variables.push_back(2 * feature);
    variables.push_back(2 * feature + 1);
  }
  return variables;
}

/// 1/2 log2(|P_aa| |P_bb| / |P|), three determinants.
double plainInformation(const MatrixXd& P, const std::vector<int>& a) {
  std::vector<int> b;
  for (int i = 0; i < P.rows(); ++i) {
    if (std::find(a.begin(), a.end(), i) == a.end()) b.push_back(i);
  }
  return 0.5 * (plainLogDeterminant(select(P, a)) + plainLogDeterminant(select(P, b)) -
                plainLogDeterminant(P));
}

double relative(double value) { return 1e-9 * std::max(1.0, std::abs(value)); }

TEST(GaussianInformation, EntropyIsThatOfTheDefinition) {
  const MatrixXd P = randomMeasurementCovariance(6, 3);
  const double expected =
      0.5 * (12 * std::log2(2.0 * M_PI * std::exp(1.0)) + plainLogDeterminant(P));
  ASSERT_TRUE(entropyBits(P).has_value());
  EXPECT_NEAR(*entropyBits(P), expected, relative(expected));
  EXPECT_DOUBLE_EQ(*entropyBits(MatrixXd(0, 0)), 0.0);
}

TEST(GaussianInformation, EntropyOfWhatIsNoCovarianceIsEmpty) {
  EXPECT_FALSE(entropyBits(MatrixXd::Zero(2, 2)).has_value());
  EXPECT_FALSE(entropyBits(MatrixXd::Ones(2, 2)).has_value());
  EXPECT_FALSE(entropyBits(-MatrixXd::Identity(2, 2)).has_value());
  EXPECT_FALSE(entropyBits(MatrixXd::Constant(1, 1, kNaN)).has_value());
  EXPECT_THROW(entropyBits(MatrixXd::Zero(2, 3)), std::invalid_argument);
}

TEST(GaussianInformation, PartitionIsThePlainFormula) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const MatrixXd P = randomMeasurementCovariance(4, seed);
    for (const std::vector<int>& part :
         {std::vector<int>{0}, {3, 1}, {7, 0, 2, 5}, {0, 1, 2, 3, 4, 5, 6}}) {
      const double expected = plainInformation(P, part);
      EXPECT_NEAR(*partitionInformationBits(P, part), expected, relative(expected));
    }
  }
}

TEST(GaussianInformation, PartitionIsSymmetricAndZeroAgainstNothing) {
  const MatrixXd P = randomMeasurementCovariance(2, 9);
  EXPECT_NEAR(*partitionInformationBits(P, {0, 2}), *partitionInformationBits(P, {1, 3}), 1e-9);
  EXPECT_DOUBLE_EQ(*partitionInformationBits(P, {}), 0.0);
  EXPECT_DOUBLE_EQ(*partitionInformationBits(P, {3, 2, 1, 0}), 0.0);
}

TEST(GaussianInformation, PartitionSaysWhatIsWrong) {
  const MatrixXd P = MatrixXd::Identity(3, 3);
  EXPECT_THROW(partitionInformationBits(P, {3}), std::invalid_argument);
  EXPECT_THROW(partitionInformationBits(P, {-1}), std::invalid_argument);
  EXPECT_THROW(partitionInformationBits(P, {1, 1}), std::invalid_argument);
  EXPECT_FALSE(partitionInformationBits(MatrixXd::Ones(3, 3), {0}).has_value());
}

TEST(GaussianInformation, StateInformationIsThePlainFormulaOfEachJointCovariance) {
  const int state = 5, features = 4;
  // A joint covariance of 8 'image points'; the first 5 variables play the state.
  const MatrixXd joint = randomMeasurementCovariance(7, 4).topLeftCorner(13, 13);
  const MatrixXd S = joint.bottomRightCorner(8, 8);
  const VectorXd bits =
      stateInformationBits(joint.topLeftCorner(5, 5), joint.topRightCorner(5, 8), S);
  ASSERT_EQ(bits.size(), features);
  for (int i = 0; i < features; ++i) {
    const MatrixXd pair = select(joint, {0, 1, 2, 3, 4, state + 2 * i, state + 2 * i + 1});
    const double expected = plainInformation(pair, {0, 1, 2, 3, 4});
    EXPECT_NEAR(bits(i), expected, relative(expected));
  }
}

TEST(GaussianInformation, StateInformationOfBadInputIsZero) {
  MatrixXd S = MatrixXd::Identity(4, 4);
  S(2, 2) = kNaN;
  const MatrixXd cross = MatrixXd::Constant(2, 4, 0.4);
  const VectorXd bits = stateInformationBits(MatrixXd::Identity(2, 2), cross, S);
  EXPECT_GT(bits(0), 0.0);
  EXPECT_DOUBLE_EQ(bits(1), 0.0);
  EXPECT_TRUE(stateInformationBits(MatrixXd::Zero(2, 2), cross, S).isZero(0.0));
  EXPECT_THROW(stateInformationBits(MatrixXd::Identity(3, 3), cross, S), std::invalid_argument);
}

TEST(GaussianInformation, FeaturesInformationIsThePlainFormulaOfEveryFeature) {
  for (int features : {1, 2, 3, 7, 8, 9, 16, 33, 40}) {
    const MatrixXd S = randomMeasurementCovariance(features, 10 + features);
    const FeatureInformation information = featureInformation(S);
    const MatrixXd precision = S.inverse();
    EXPECT_DOUBLE_EQ(information.regularisation, 0.0);
    for (int i = 0; i < features; ++i) {
      const double expected = plainInformation(S, variablesOf({i}));
      EXPECT_NEAR(information.bits(i), expected, relative(expected)) << features << " " << i;
      const double determinant = precision.block<2, 2>(2 * i, 2 * i).determinant();
      EXPECT_NEAR(information.precision_determinant(i) / determinant, 1.0, 1e-9);
      EXPECT_TRUE(information.usable[i]);
    }
  }
}

TEST(GaussianInformation, PrecisionDeterminantStaysValidForEveryConditionalCovariance) {
  const int features = 6;
  const MatrixXd S = randomMeasurementCovariance(features, 5);
  const FeatureInformation information = featureInformation(S);
  // Condition the last four features on the first two, by the plain formula.
  const MatrixXd rest = S.bottomRightCorner(8, 8) - S.bottomLeftCorner(8, 4) *
                                                        S.topLeftCorner(4, 4).inverse() *
                                                        S.topRightCorner(4, 8);
  for (int i = 0; i < 4; ++i) {
    const double expected = plainInformation(rest, variablesOf({i}));
    const double bits = informationBits(rest.block<2, 2>(2 * i, 2 * i).determinant(),
                                        information.precision_determinant(i + 2));
    EXPECT_NEAR(bits, expected, relative(expected));
  }
}

TEST(GaussianInformation, NothingAndOneFeatureHaveNoInformation) {
  EXPECT_EQ(featureInformation(MatrixXd(0, 0)).bits.size(), 0);
  EXPECT_EQ(pairInformationMatrix(MatrixXd(0, 0)).size(), 0);
  const MatrixXd S = randomMeasurementCovariance(1, 0);
  EXPECT_NEAR(featureInformation(S).bits(0), 0.0, 1e-12);
  EXPECT_DOUBLE_EQ(pairInformationMatrix(S)(0, 0), 0.0);
  EXPECT_THROW(featureInformation(MatrixXd::Identity(3, 3)), std::invalid_argument);
  EXPECT_THROW(featureInformation(MatrixXd::Zero(4, 2)), std::invalid_argument);
}

TEST(GaussianInformation, AFeatureThatIsNotUsableIsAsIfAbsent) {
  const MatrixXd good = randomMeasurementCovariance(3, 8);
  const FeatureInformation expected = featureInformation(good);
  for (double bad : {kNaN, std::numeric_limits<double>::infinity(), 0.0, -1.0}) {
    MatrixXd S = randomMeasurementCovariance(4, 8);
    S.setZero();
    S.topLeftCorner(4, 4) = good.topLeftCorner(4, 4);
    S.bottomRightCorner(2, 2) = good.bottomRightCorner(2, 2);
    S.topRightCorner(4, 2) = good.topRightCorner(4, 2);
    S.bottomLeftCorner(2, 4) = good.bottomLeftCorner(2, 4);
    S(4, 4) = S(5, 5) = bad;
    const FeatureInformation information = featureInformation(S);
    const int original[] = {0, 1, -1, 2};
    for (int i = 0; i < 4; ++i) {
      EXPECT_EQ(static_cast<bool>(information.usable[i]), i != 2);
      const double bits = i == 2 ? 0.0 : expected.bits(original[i]);
      EXPECT_NEAR(information.bits(i), bits, relative(bits));
    }
    EXPECT_DOUBLE_EQ(information.precision_determinant(2), 0.0);
    EXPECT_TRUE(pairInformationMatrix(S).row(2).isZero(0.0));
    EXPECT_TRUE(pairInformationMatrix(S).allFinite());
  }
}

TEST(GaussianInformation, ANotFiniteCrossCovarianceCostsTheLaterFeatureOnly) {
  MatrixXd S = randomMeasurementCovariance(3, 2);
  S(0, 4) = S(4, 0) = kNaN;
  const FeatureInformation information = featureInformation(S);
  EXPECT_TRUE(information.usable[0]);
  EXPECT_TRUE(information.usable[1]);
  EXPECT_FALSE(information.usable[2]);
  EXPECT_TRUE(information.bits.allFinite());
  EXPECT_DOUBLE_EQ(pairInformationMatrix(S)(0, 2), 0.0);
  EXPECT_GT(pairInformationMatrix(S)(1, 2), 0.0);
}

TEST(GaussianInformation, IdenticalFeaturesWithoutNoiseShareMuchButFinite) {
  const MatrixXd one = randomMeasurementCovariance(1, 6);
  MatrixXd S(4, 4);
  S << one, one, one, one;
  const FeatureInformation information = featureInformation(S);
  EXPECT_GT(information.regularisation, 0.0);
  EXPECT_TRUE(information.bits.allFinite());
  EXPECT_GT(information.bits(0), 20.0);
  const double pair = pairInformationBits(S, 0, 1);
  EXPECT_GT(pair, 20.0);
  EXPECT_LE(pair, kMaximumPairBits + 1e-9);
}

TEST(GaussianInformation, WhatIsNoCovarianceHasADefinedResult) {
  MatrixXd S = MatrixXd::Identity(4, 4);
  S(0, 2) = S(2, 0) = 5.0;  // a correlation of 5
  EXPECT_DOUBLE_EQ(pairInformationBits(S, 0, 1), 0.0);
  const FeatureInformation information = featureInformation(S);
  EXPECT_TRUE(information.bits.isZero(0.0));
  EXPECT_FALSE(information.usable[0]);
}

TEST(GaussianInformation, PairwiseIsThePlainFormulaOfEveryPair) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    const int features = 9;
    const MatrixXd S = randomMeasurementCovariance(features, seed, 3 + seed);
    const MatrixXd bits = pairInformationMatrix(S);
    for (int i = 0; i < features; ++i) {
      EXPECT_DOUBLE_EQ(bits(i, i), 0.0);
      for (int k = i + 1; k < features; ++k) {
        const double expected = plainInformation(select(S, variablesOf({i, k})), {0, 1});
        EXPECT_NEAR(bits(i, k), expected, relative(expected));
        EXPECT_DOUBLE_EQ(bits(i, k), bits(k, i));
        EXPECT_DOUBLE_EQ(bits(i, k), pairInformationBits(S, i, k));
        EXPECT_DOUBLE_EQ(bits(i, k), pairInformationBits(S, k, i));
      }
    }
  }
  EXPECT_THROW(pairInformationBits(MatrixXd::Identity(4, 4), 0, 2), std::invalid_argument);
}

TEST(GaussianInformation, PairwiseKeepsItsDigitsNearIndependenceAndNearEquality) {
  for (double correlation : {1e-9, 1e-6, 1e-3, 0.5, 0.9, 1.0 - 1e-4, 1.0 - 1e-7}) {
    MatrixXd S = MatrixXd::Identity(4, 4);
    S(0, 2) = S(2, 0) = S(1, 3) = S(3, 1) = correlation;
    // Two independent pairs of variables: I = -log2(1 - correlation^2).
    const double expected = -std::log1p(-correlation * correlation) / std::log(2.0);
    EXPECT_NEAR(pairInformationBits(S, 0, 1) / expected, 1.0, 1e-9) << correlation;
  }
}

TEST(GaussianInformation, TwoFeaturesHaveTheirPairInformation) {
  const MatrixXd S = randomMeasurementCovariance(2, 17);
  EXPECT_NEAR(featureInformation(S).bits(0), pairInformationBits(S, 0, 1), 1e-9);
  EXPECT_NEAR(featureInformation(S).bits(1), pairInformationBits(S, 0, 1), 1e-9);
}

TEST(GaussianInformation, EllipseAreaAndEfficiency) {
  Eigen::Matrix2d S;
  S << 4.0, 0.0, 0.0, 9.0;
  EXPECT_NEAR(ellipseArea(S), M_PI * 3.0 * 2.0 * 3.0 * 3.0, 1e-9);  // pi a b of 3 sigma
  EXPECT_DOUBLE_EQ(informationEfficiency(5.0, 10.0), 0.5);
  EXPECT_DOUBLE_EQ(informationEfficiency(5.0, 0.0), 0.0);
  EXPECT_DOUBLE_EQ(ellipseArea(Eigen::Matrix2d::Zero()), 0.0);
  EXPECT_DOUBLE_EQ(ellipseArea(Eigen::Matrix2d::Constant(kNaN)), 0.0);
}

TEST(GaussianInformation, AgreesWithTheGoldenVectors) {
  const std::vector<std::string> files = test::vectorFiles();
  if (files.empty()) GTEST_SKIP() << "no vectors beside AMS_DATA";
  for (const std::string& file : files) {
    SCOPED_TRACE(file);
    const nlohmann::json vector = test::readJson(file);
    const MatrixXd S = test::matrixOf(vector["input"]["S"]);
    const FeatureInformation information = featureInformation(S);
    const MatrixXd pairs = pairInformationMatrix(S);
    const nlohmann::json& mi = vector["mi"];
    EXPECT_LE((pairs - test::matrixOf(mi["pairwise"])).cwiseAbs().maxCoeff(), 1e-9);
    for (Eigen::Index i = 0; i < pairs.rows(); ++i) {
      EXPECT_NEAR(information.bits(i), mi["features"][i].get<double>(), 1e-9);
      EXPECT_NEAR(information.precision_determinant(i) / mi["L_det"][i].get<double>(), 1.0, 1e-9);
      EXPECT_NEAR(ellipseArea(S.block<2, 2>(2 * i, 2 * i)) / mi["areas"][i].get<double>(), 1.0,
                  1e-9);
    }
  }
}

}  // namespace
}  // namespace active_matching_slam
