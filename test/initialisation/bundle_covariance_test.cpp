// The covariance of a bundle against plain formulas, with Jacobians by differences.

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numeric>
#include <vector>

#include "active_matching_slam/initialisation/bundle_adjustment.h"
#include "initialisation/example_bundle.h"

namespace active_matching_slam {
namespace {

constexpr int kCalibrationSize = CameraError::kCalibrationSize;
constexpr double kScaleSigma = 0.01;
/// The lens is all but a turn of all bearings: plain inverses lose more digits than doubles can
/// spare.
using Precise = Eigen::Matrix<long double, Eigen::Dynamic, Eigen::Dynamic>;

BundleOptions bundleOptions() {
  BundleOptions options = weakPrior();
  options.sigma_px = 0.45;
  options.loss_scale_sigmas = 1e6;
  options.sigma_calibration << 0.01, 0.01, 0.01, 0.1, 0.1;
  return options;
}

/// Image points are where they would be without noise, answer to the calibration, and are known
/// better along one axis than along the other.
Bundle exactBundle(const CameraModel& model, int images, int features) {
  Bundle bundle = exampleBundle(model, images, features, 0.1, 0.0, 3);
  Random random(3);
  for (auto& observations : bundle.observations) {
    for (BundleObservation& o : observations) {
      o.d_calibration.col(0) = Eigen::Vector2d(random.normal(100.0), random.normal(100.0));
      o.d_calibration.rightCols<4>() = model.pixelByCorrection(o.pixel);
      o.inverse_shape << 2.0, 0.5, 0.5, 0.8;
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

/// Takes pairs of rows times the root of what their image points tell.
void whiten(const Bundle& bundle, Eigen::MatrixXd* J) {
  Eigen::Index row = 0;
  for (const auto& observations : bundle.observations)
    for (const BundleObservation& o : observations) {
      const Eigen::Matrix2d root = o.inverse_shape.llt().matrixL();
      J->middleRows<2>(row) = (root.transpose() * J->middleRows<2>(row)).eval();
      row += 2;
    }
}

Eigen::MatrixXd jacobian(const CameraModel& model, const Bundle& bundle) {
  const int size = Layout(bundle).size;
  Eigen::MatrixXd J(pixels(model, bundle).size(), size);
  for (int p = 0; p < size; ++p)
    J.col(p) =
        (pixels(model, moved(bundle, p, 1e-5)) - pixels(model, moved(bundle, p, -1e-5))) / 2e-5;
  return J;
}

/// Information that the priors give of the calibration, of the bearings (a little: of one that no
/// image shows) and of the inverse depths.
Eigen::VectorXd priorInformation(const BundleOptions& options, const Bundle& bundle) {
  const Layout layout(bundle);
  Eigen::VectorXd information = Eigen::VectorXd::Zero(layout.size);
  information.segment<kCalibrationSize>(layout.calibration) =
      options.sigma_calibration.array().square().inverse();
  for (int row = layout.first_feature; row < layout.size; row += 3)
    information.segment<3>(row) << 1e-2, 1e-2, std::pow(options.sigma_inverse_depth, -2);
  return information;
}

/// What holds the scale: near features more than far ones.
Eigen::VectorXd scaleWeights(const Bundle& bundle) {
  Eigen::VectorXd weights(bundle.features.size());
  for (Eigen::Index i = 0; i < weights.size(); ++i)
    weights[i] = std::pow(bundle.features[i].inverse_depth, 2);
  return weights / weights.sum();
}

/// How the mean relative inverse depth follows the parameters.
Eigen::VectorXd scaleByParameters(const Bundle& bundle) {
  const Layout layout(bundle);
  const Eigen::VectorXd weights = scaleWeights(bundle);
  Eigen::VectorXd d = Eigen::VectorXd::Zero(layout.size);
  for (std::size_t i = 0; i < bundle.features.size(); ++i)
    d[layout.first_feature + 3 * static_cast<int>(i) + 2] =
        weights[static_cast<Eigen::Index>(i)] / bundle.features[i].inverse_depth;
  return d;
}

TEST(BundleCovariance, IsThatOfThePlainFormula) {
  const CameraModel model(exampleCalibration());
  const BundleOptions options = bundleOptions();
  constexpr double kInflation = 3.0;
  const Bundle bundle = exactBundle(model, 4, 12);
  const Layout layout(bundle);
  const int size = layout.size;
  Eigen::MatrixXd J = jacobian(model, bundle) / options.sigma_px / std::sqrt(kInflation);
  whiten(bundle, &J);
  Eigen::MatrixXd all = J.transpose() * J;
  all.diagonal() += priorInformation(options, bundle);
  const Precise scale = scaleByParameters(bundle).cast<long double>();
  // The lens stays as doubtful as it was and makes the rest so: what images tell of it is left out.
  std::vector<int> order(size);
  std::iota(order.begin(), order.end(), 0);
  std::rotate(order.begin() + layout.calibration + 1, order.begin() + layout.first_feature,
              order.end());
  Eigen::PermutationMatrix<Eigen::Dynamic> lens_last(
      Eigen::Map<Eigen::VectorXi>(order.data(), size));
  Precise I = (lens_last.transpose() * all * lens_last).cast<long double>();
  const Precise cross = I.bottomLeftCorner(4, size - 4);
  const Precise others = Precise(I.topLeftCorner(size - 4, size - 4)).inverse();
  const Eigen::VectorXd of_lens = options.sigma_calibration.tail<4>().array().square().inverse();
  I.bottomRightCorner<4, 4>() = cross * others * cross.transpose();
  I.diagonal().tail<4>() += of_lens.cast<long double>();
  const Precise information = lens_last * I * lens_last.transpose();
  const Precise with_gauge = information + scale * scale.transpose() / (kScaleSigma * kScaleSigma);
  const Eigen::MatrixXd plain = Precise(with_gauge.inverse()).cast<double>();
  const Eigen::MatrixXd covariance =
      bundleCovariance(model, options, bundle, 2, kInflation, scaleWeights(bundle), kScaleSigma);
  const int kept = size - 6;
  ASSERT_EQ(covariance.rows(), kept);
  EXPECT_LT((covariance - plain.bottomRightCorner(kept, kept)).norm(), 1e-6 * plain.norm());
}

/// Errors of each feature that are an autoregression from image to image.
Bundle noisyBundle(const CameraModel& model, double sigma_px, double correlation, unsigned seed) {
  Bundle bundle = exampleBundle(model, 24, 40, 0.03, 0.0, 3);
  Random random(seed);
  const auto drawn = [&random](double sigma) {
    const double x = random.normal(sigma), y = random.normal(sigma);
    return Eigen::Vector2d(x, y);
  };
  std::vector<Eigen::Vector2d> errors(bundle.features.size());
  for (Eigen::Vector2d& error : errors) error = drawn(sigma_px);
  for (auto& observations : bundle.observations) {
    for (Eigen::Vector2d& error : errors)
      error = correlation * error + drawn(sigma_px * std::sqrt(1.0 - correlation * correlation));
    for (BundleObservation& o : observations) o.pixel += errors[o.feature];
  }
  return bundle;
}

/// Mean NEES of the last camera over draws, in the gauge of the covariance.
double meanNees(double correlation, double variance_inflation) {
  constexpr int kDraws = 40;
  const CameraModel model(exampleCalibration());
  BundleOptions options = weakPrior();
  options.loss_scale_sigmas = 1e6;
  options.sigma_calibration.setConstant(1e-9);
  options.least_relative_decrease = 1e-6;
  const Bundle truth = noisyBundle(model, 0.0, 0.0, 1);
  double nees = 0.0;
  for (int draw = 1; draw <= kDraws; ++draw) {
    Bundle bundle = noisyBundle(model, 0.1, correlation, draw);
    options.sigma_px = 0.1;
    adjustBundle(model, options, &bundle);
    options.sigma_px = estimateSigma(model, bundle);
    const Eigen::VectorXd weights = scaleWeights(truth);
    double factor = 0.0;
    for (std::size_t i = 0; i < bundle.features.size(); ++i)
      factor += weights[static_cast<Eigen::Index>(i)] * bundle.features[i].inverse_depth /
                truth.features[i].inverse_depth;
    rescaleBundle(factor, &bundle);
    const CameraState &is = bundle.cameras.back(), &was = truth.cameras.back();
    Eigen::Matrix<double, 6, 1> error;
    error << was.position_world - is.position_world,
        vectorFromRotation(was.q_world_camera * is.q_world_camera.conjugate());
    const int last = static_cast<int>(bundle.cameras.size()) - 1;
    const Eigen::MatrixXd P = bundleCovariance(model, options, bundle, last, variance_inflation,
                                               scaleWeights(truth), 1e-6);
    nees += error.dot(P.topLeftCorner<6, 6>().inverse() * error) / kDraws;
  }
  return nees;
}

// Six is honest; the mean of 40 draws stays within 5 and 7.1 of it 95 times in 100.
TEST(BundleCovariance, IsThatOfTheErrorsMade) { EXPECT_NEAR(meanNees(0.0, 1.0), 6.0, 1.2); }

TEST(BundleCovariance, OfCorrelatedErrorsNeedsTheirVarianceInflation) {
  constexpr double kCorrelation = 0.45;
  const double inflation = (1.0 + kCorrelation) / (1.0 - kCorrelation);
  const double plain = meanNees(kCorrelation, 1.0), inflated = meanNees(kCorrelation, inflation);
  EXPECT_GT(plain, 7.1);     // claims too much
  EXPECT_LT(inflated, 7.1);  // does not, nor by much too little
  EXPECT_GT(inflated, 0.5 * 6.0);
}

}  // namespace
}  // namespace active_matching_slam
