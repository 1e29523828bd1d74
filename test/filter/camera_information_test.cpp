#include "active_matching_slam/filter/camera_information.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "filter/example_filter.h"

namespace active_matching_slam {
namespace {

double logDeterminant(const Eigen::MatrixXd& A) { return std::log2(A.determinant()); }

/// By the joint covariance of camera and image point: I = 1/2 log2 |P_c| |S| / |joint|, and all
/// that the match tells of the state by 1/2 log2 |S| / |R|.
TEST(CameraInformation, EqualsThatOfTheJointCovariance) {
  const CameraModel model(exampleCalibration());
  Ekf filter = exampleFilter(model, 5);
  filter.predict(0.1);
  const std::vector<FeatureId> ids = idsOf(filter);
  std::vector<double> sigmas_px;
  for (std::size_t i = 0; i < ids.size(); ++i) sigmas_px.push_back(0.4 + 0.3 * i);
  const auto measurements = measurementsOfCamera(filter, model, ids, sigmas_px);
  ASSERT_EQ(measurements.size(), ids.size());
  const CameraModel lens = model.corrected(filter.camera().lens);
  const Eigen::MatrixXd P = filter.covariance();
  int compared = 0;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const FeatureState& feature = *filter.find(ids[i]);
    const auto projection = projectFeature(lens, filter.camera(), feature);
    ASSERT_EQ(projection.has_value(), measurements[i].has_value());
    if (!projection) continue;
    constexpr int kMotion = CameraError::kMotionSize;
    Eigen::MatrixXd H = Eigen::MatrixXd::Zero(kMotion + 2, P.rows());
    H.topLeftCorner<kMotion, kMotion>().setIdentity();
    H.block<2, CameraError::kSize>(kMotion, 0) = projection->d_camera;
    H.block(kMotion, feature.offset, 2, feature.size()) =
        projection->d_feature.leftCols(feature.size());
    Eigen::MatrixXd joint = H * P * H.transpose();
    const double variance = sigmas_px[i] * sigmas_px[i];
    joint.bottomRightCorner<2, 2>() += variance * Eigen::Matrix2d::Identity();
    const Eigen::Matrix2d S = joint.bottomRightCorner<2, 2>();
    const double bits = 0.5 * (logDeterminant(joint.topLeftCorner<kMotion, kMotion>()) +
                               logDeterminant(S) - logDeterminant(joint));
    const auto& W = measurements[i]->W;
    EXPECT_NEAR(0.5 * logDeterminant(Eigen::Matrix2d::Identity() + W * W.transpose()), bits,
                1e-4 + 1e-4 * bits);
    EXPECT_NEAR(bits + measurements[i]->own_bits,
                0.5 * (logDeterminant(S) - 2.0 * std::log2(variance)), 1e-4 + 1e-4 * bits);
    EXPECT_NEAR(measurements[i]->gate_area_px2, 9.0 * M_PI * std::sqrt(S.determinant()), 1e-6);
    ++compared;
  }
  EXPECT_GT(compared, 3);
}

/// All drift alike: no match tells of it, and what it tells of the rest stays.
TEST(CameraInformation, IsNotLostInDrift) {
  const CameraModel model(exampleCalibration());
  const auto bitsAfter = [&](double drift_m) {
    Ekf filter = exampleFilter(model, 5);
    filter.predict(0.1);
    const std::vector<FeatureId> ids = idsOf(filter);
    Eigen::MatrixXd P = filter.covariance();
    Eigen::MatrixXd shift = Eigen::MatrixXd::Zero(P.rows(), 3);
    shift.topRows<3>().setIdentity();
    for (const FeatureId id : ids) shift.middleRows<3>(filter.find(id)->offset).setIdentity();
    P += drift_m * drift_m * shift * shift.transpose();
    filter.restore(filter.camera(), filter.features(), P, 1000000);
    const auto measurements =
        measurementsOfCamera(filter, model, ids, std::vector<double>(ids.size(), 0.5));
    double sum = 0.0;
    for (const auto& m : measurements)
      if (m) sum += 0.5 * logDeterminant(Eigen::Matrix2d::Identity() + m->W * m->W.transpose());
    return sum;
  };
  const double without = bitsAfter(0.0);
  EXPECT_GT(without, 1.0);
  EXPECT_GT(bitsAfter(10.0), 0.5 * without);
}

TEST(CameraInformation, OfWhatIsNotThereIsNone) {
  const CameraModel model(exampleCalibration());
  const Ekf filter = exampleFilter(model, 5);
  EXPECT_FALSE(measurementsOfCamera(filter, model, {987654}, {0.5}).front());
}

}  // namespace
}  // namespace active_matching_slam
