#include "active_matching_slam/filter/scale_from_distances.h"

#include <gtest/gtest.h>

#include <cmath>

#include "active_matching_slam/filter/state_error.h"
#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

/// A camera and points whose scale is free: they are right but for one factor, and small errors.
class ScaleOfPoints : public testing::Test {
 protected:
  ScaleOfPoints() : filter_(exampleOptions()) { make(2.5, 0.01); }

  /// Lengths come out `factor` times too short, errors of points are of `sigma`.
  void make(double factor, double sigma) {
    filter_ = Ekf(exampleOptions());
    filter_.reset(exampleCamera(random_), exampleCameraCovariance(random_));
    points_.clear();
    ids_.clear();
    for (int i = 0; i < 6; ++i) {
      points_.push_back(Eigen::Vector3d(random_.uniform(-1, 1), random_.uniform(-1, 1), 2.0));
      ids_.push_back(
          filter_.addPointFeature((points_[i] + random_.vector(sigma)) / factor,
                                  std::pow(sigma / factor, 2) * Eigen::Matrix3d::Identity()));
    }
  }
  std::vector<KnownDistance> distances(double sigma_m) const {
    std::vector<KnownDistance> known;
    for (int i = 0; i < 4; ++i)
      for (int j = 0; j < i; ++j)
        known.push_back({ids_[i], ids_[j], (points_[i] - points_[j]).norm(), sigma_m});
    return known;
  }

  Random random_{1};
  Ekf filter_;
  std::vector<Eigen::Vector3d> points_;
  std::vector<FeatureId> ids_;
};

TEST_F(ScaleOfPoints, IsFoundAsWellAsItSays) {
  constexpr int kRuns = 200;
  double squares = 0.0, chi2 = 0.0;
  for (int run = 0; run < kRuns; ++run) {
    make(2.5, 0.01);
    const auto scale = estimateScale(filter_, distances(1e-4));
    ASSERT_TRUE(scale);
    squares += std::pow(std::log(scale->factor / 2.5) / scale->sigma, 2);
    chi2 += scale->chi2 / scale->degrees;
  }
  // Sums of squares of so many normal deviates: 1 +- 5 standard deviations.
  EXPECT_NEAR(squares / kRuns, 1.0, 5.0 * std::sqrt(2.0 / kRuns));
  EXPECT_NEAR(chi2 / kRuns, 1.0, 5.0 * std::sqrt(2.0 / kRuns));
}

TEST_F(ScaleOfPoints, DistancesOfAnotherShapeAreToldByChiSquare) {
  auto known = distances(1e-4);
  known[0].metres *= 1.5;
  EXPECT_GT(estimateScale(filter_, known)->chi2, 100.0);
}

TEST_F(ScaleOfPoints, NeedsPointsThatAreThere) {
  auto known = distances(1e-4);
  known[0].first = 4711;
  EXPECT_FALSE(estimateScale(filter_, known));
  EXPECT_FALSE(estimateScale(filter_, {distances(1e-4)[0]}));
  const CameraModel model(exampleCalibration());
  known[0].first = filter_.addInverseDepthFeature(model, {300, 200});
  EXPECT_FALSE(estimateScale(filter_, known));
}

TEST_F(ScaleOfPoints, IsKnownAsTheDistancesAreOnceTaken) {
  const auto before = estimateScale(filter_, distances(1e-3));
  takeScale(*before, &filter_);
  const auto after = estimateScale(filter_, distances(1e-3));
  EXPECT_NEAR(after->factor, 1.0, 1e-6);
  // What is left is the error of the distances, twice: theirs, and that of who measures again.
  EXPECT_NEAR(after->sigma * after->sigma, 2.0 * before->distance_variance,
              0.2 * before->distance_variance);
  // Directions, and what has no length, stay as they were.
  const Eigen::MatrixXd P = filter_.covariance();
  EXPECT_GT(Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(P).eigenvalues()(0), -1e-12);
}

/// The covariance after is that of states each of which took the scale of its own.
TEST_F(ScaleOfPoints, CovarianceIsThatOfStatesScaledOneByOne) {
  constexpr int kRuns = 3000;
  const int last = 5;
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  const std::vector<Eigen::Vector3d> truth = points_;
  Ekf scaled = filter_;
  for (int run = 0; run < kRuns; ++run) {
    Ekf one(exampleOptions());
    one.reset(filter_.camera(), filter_.cameraCovariance());
    std::vector<KnownDistance> known = distances(2e-3);
    for (int i = 0; i < 6; ++i)
      one.addPointFeature((truth[i] + random_.vector(0.01)) / 2.5,
                          std::pow(0.01 / 2.5, 2) * Eigen::Matrix3d::Identity());
    for (KnownDistance& distance : known) distance.metres += random_.normal(distance.sigma_m);
    takeScale(*estimateScale(one, known), &one);
    const Eigen::Vector3d error = one.find(ids_[last])->point_world - truth[last];
    scatter += error * error.transpose() / kRuns;
    if (run == 0) scaled = one;
  }
  const Eigen::Matrix3d stated = scaled.positionCovariance(*scaled.find(ids_[last]));
  EXPECT_LT((scatter - stated).norm(), 0.15 * stated.norm());
}

}  // namespace
}  // namespace active_matching_slam
