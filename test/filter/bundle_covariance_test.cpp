// The covariance of an adjusted start against plain formulas, with Jacobians by differences.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <utility>
#include <vector>

#include "active_matching_slam/filter/bundle_adjustment.h"
#include "filter/example_bundle.h"

namespace active_matching_slam {
namespace {

constexpr int kCalibrationSize = CameraError::kCalibrationSize;
constexpr double kScaleSigma = 0.01;

BundleOptions bundleOptions() {
  BundleOptions options = weakPrior();
  options.sigma_px = 0.45;
  options.outlier_px = 1e6;
  options.sigma_calibration << 0.01, 0.01, 0.01, 0.1, 0.1;
  return options;
}

/// Image points are where they would be without noise, and answer to the calibration.
Bundle exactBundle(const CameraModel& model, int images, int features) {
  Bundle bundle = exampleBundle(model, images, features, 0.1, 0.0, 3);
  Random random(3);
  for (auto& observations : bundle.observations) {
    for (BundleObservation& o : observations) {
      o.d_calibration.col(0) = Eigen::Vector2d(random.normal(100.0), random.normal(100.0));
      o.d_calibration.rightCols<4>() = model.pixelByCorrection(o.pixel);
    }
  }
  return bundle;
}

/// Where the parameters are: cameras but the first (6 each), calibration, features (3 each).
struct Layout {
  explicit Layout(const Bundle& bundle)
      : calibration(6 * static_cast<int>(bundle.cameras.size() - 1)),
        first_feature(calibration + kCalibrationSize),
        size(first_feature + 3 * static_cast<int>(bundle.features.size())) {}
  int calibration, first_feature, size;
};

Bundle moved(Bundle b, int parameter, double step) {
  const Layout layout(b);
  if (parameter < layout.calibration) {
    CameraState& camera = b.cameras[1 + parameter / 6];
    const Eigen::Vector3d d = step * Eigen::Vector3d::Unit(parameter % 3);
    if (parameter % 6 < 3) {
      camera.position_world += d;
    } else {
      camera.q_world_camera = rotationFromVector(d) * camera.q_world_camera;
    }
  } else if (parameter < layout.first_feature) {
    b.calibration[parameter - layout.calibration] += step;
  } else {
    FeatureState& f = b.features[(parameter - layout.first_feature) / 3];
    const int which = (parameter - layout.first_feature) % 3;
    if (which == 2) {
      f.inverse_depth += step;
    } else {
      f.bearing_world = (f.bearing_world + step * f.tangentBasis().col(which)).normalized();
    }
  }
  return b;
}

Eigen::VectorXd pixels(const CameraModel& model, const Bundle& b) {
  std::vector<double> values;
  for (std::size_t k = 0; k < b.cameras.size(); ++k)
    for (const BundleObservation& o : b.observations[k]) {
      const Eigen::Vector2d z = projectFeature(model, b.cameras[k], b.features[o.feature])->pixel +
                                o.d_calibration * b.calibration;
      values.insert(values.end(), {z.x(), z.y()});
    }
  return Eigen::Map<Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

Eigen::MatrixXd jacobian(const CameraModel& model, const Bundle& bundle) {
  const int size = Layout(bundle).size;
  Eigen::MatrixXd J(pixels(model, bundle).size(), size);
  for (int p = 0; p < size; ++p)
    J.col(p) =
        (pixels(model, moved(bundle, p, 1e-6)) - pixels(model, moved(bundle, p, -1e-6))) / 2e-6;
  return J;
}

/// Information that the priors give of the calibration and of the inverse depths.
Eigen::VectorXd priorInformation(const BundleOptions& options, const Bundle& bundle) {
  const Layout layout(bundle);
  Eigen::VectorXd information = Eigen::VectorXd::Zero(layout.size);
  information.segment<kCalibrationSize>(layout.calibration) =
      options.sigma_calibration.array().square().inverse();
  for (int row = layout.first_feature + 2; row < layout.size; row += 3)
    information[row] = 1.0 / (options.sigma_inverse_depth * options.sigma_inverse_depth);
  return information;
}

/// How the mean logarithm of the inverse depths follows the parameters.
Eigen::VectorXd unitByParameters(const Bundle& bundle) {
  const Layout layout(bundle);
  const auto features = static_cast<double>(bundle.features.size());
  Eigen::VectorXd d = Eigen::VectorXd::Zero(layout.size);
  for (std::size_t i = 0; i < bundle.features.size(); ++i)
    d[layout.first_feature + 3 * static_cast<int>(i) + 2] =
        1.0 / (features * bundle.features[i].inverse_depth);
  return d;
}

TEST(BundleCovariance, IsThatOfThePlainFormula) {
  const CameraModel model(exampleCalibration());
  const BundleOptions options = bundleOptions();
  const Bundle bundle = exactBundle(model, 4, 12);
  const Layout layout(bundle);
  const int size = layout.size;
  const Eigen::MatrixXd J = jacobian(model, bundle) / options.sigma_px;
  Eigen::MatrixXd information = J.transpose() * J;
  information.diagonal() += priorInformation(options, bundle);
  // The lens stays as doubtful as it was and makes the rest so: what images tell of it is left out.
  std::vector<int> order(size);
  std::iota(order.begin(), order.end(), 0);
  std::rotate(order.begin() + layout.calibration + 1, order.begin() + layout.first_feature,
              order.end());
  Eigen::PermutationMatrix<Eigen::Dynamic> lens_last(
      Eigen::Map<Eigen::VectorXi>(order.data(), size));
  Eigen::MatrixXd I = lens_last.transpose() * information * lens_last;
  const Eigen::MatrixXd cross = I.bottomLeftCorner(4, size - 4);
  I.bottomRightCorner<4, 4>() =
      cross * I.topLeftCorner(size - 4, size - 4).inverse() * cross.transpose();
  I.diagonal().tail<4>() += options.sigma_calibration.tail<4>().array().square().inverse().matrix();
  information = lens_last * I * lens_last.transpose();
  const Eigen::VectorXd unit = unitByParameters(bundle);
  const Eigen::MatrixXd plain =
      (information + unit * unit.transpose() / (kScaleSigma * kScaleSigma)).inverse();
  const Eigen::MatrixXd covariance = bundleCovariance(model, options, bundle, 2, kScaleSigma);
  const int kept = size - 6;
  ASSERT_EQ(covariance.rows(), kept);
  EXPECT_LT((covariance - plain.bottomRightCorner(kept, kept)).norm(), 1e-4 * plain.norm());
}

// Where errors of image points are correlated with covariance R, weighted by W, the estimate's
// covariance is A^-1 J^T W R W J A^-1 and what priors add (White 1980).
TEST(BundleCovariance, AllowsForErrorsThatLast) {
  const CameraModel model(exampleCalibration());
  BundleOptions options = bundleOptions();
  options.sigma_calibration.tail<4>().setConstant(1e-9);  // the lens is beyond doubt
  options.lasting_share = 0.5;
  Bundle bundle = exactBundle(model, 6, 12);
  bundle.persistence = {0.0, 0.9, 0.7, 0.95, 0.4, 0.8};
  bundle.observations[3].erase(bundle.observations[3].begin() + 2);  // not all are seen in all
  bundle.observations[0].erase(bundle.observations[0].begin() + 5);
  const Layout layout(bundle);
  std::vector<std::pair<int, int>> points;  // feature, image
  for (std::size_t k = 0; k < bundle.observations.size(); ++k)
    for (const BundleObservation& o : bundle.observations[k])
      points.emplace_back(o.feature, static_cast<int>(k));
  const auto isFirst = [&points](const std::pair<int, int>& point) {
    return std::none_of(points.begin(), points.end(), [&point](const auto& other) {
      return other.first == point.first && other.second < point.second;
    });
  };
  const auto n = static_cast<Eigen::Index>(2 * points.size());
  Eigen::MatrixXd R = Eigen::MatrixXd::Identity(n, n);  // in the noise of image points
  for (std::size_t a = 0; a < points.size(); ++a) {
    for (std::size_t b = 0; b < points.size(); ++b) {
      if (a == b || points[a].first != points[b].first || isFirst(points[a]) || isFirst(points[b]))
        continue;
      double lasts = options.lasting_share;
      const auto [from, to] = std::minmax(points[a].second, points[b].second);
      for (int k = from + 1; k <= to; ++k) lasts *= bundle.persistence[k];
      R.block<2, 2>(static_cast<Eigen::Index>(2 * a), static_cast<Eigen::Index>(2 * b)) =
          lasts * Eigen::Matrix2d::Identity();
    }
  }
  Eigen::MatrixXd J = jacobian(model, bundle) / options.sigma_px;
  J.middleCols<4>(layout.calibration + 1).setZero();
  const Eigen::MatrixXd prior = priorInformation(options, bundle).asDiagonal();
  const Eigen::MatrixXd inverse = (J.transpose() * J + prior).inverse();
  Eigen::MatrixXd plain = inverse * (J.transpose() * R * J + prior) * inverse;
  const Eigen::MatrixXd white = inverse;
  const Eigen::VectorXd unit = unitByParameters(bundle);
  const Eigen::VectorXd along = plain * unit;
  plain -= along * along.transpose() / (kScaleSigma * kScaleSigma + unit.dot(along));
  const Eigen::MatrixXd covariance = bundleCovariance(model, options, bundle, 4, kScaleSigma);
  const int kept = layout.size - 18;
  ASSERT_EQ(covariance.rows(), kept);
  EXPECT_LT((covariance - plain.bottomRightCorner(kept, kept)).norm(), 1e-4 * plain.norm());
  EXPECT_GT((covariance - white.bottomRightCorner(kept, kept)).norm(), 0.1 * white.norm());
}

}  // namespace
}  // namespace active_matching_slam
