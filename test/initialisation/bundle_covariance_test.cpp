// The covariance of an adjusted start against plain formulas, with Jacobians by differences.

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
  options.outlier_px = 1e6;
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

/// How the mean logarithm of the inverse depths, by what each would tell if the cameras were known,
/// follows the parameters.
Eigen::VectorXd unitByParameters(const Bundle& bundle, const Eigen::MatrixXd& information) {
  const Layout layout(bundle);
  Eigen::VectorXd d = Eigen::VectorXd::Zero(layout.size);
  double all = 0.0;
  for (std::size_t i = 0; i < bundle.features.size(); ++i) {
    const int row = layout.first_feature + 3 * static_cast<int>(i);
    const double depth = bundle.features[i].inverse_depth;
    const double variance = information.block<3, 3>(row, row).inverse()(2, 2);
    d[row + 2] = depth / variance;
    all += depth * depth / variance;
  }
  return d / all;
}

TEST(BundleCovariance, IsThatOfThePlainFormula) {
  const CameraModel model(exampleCalibration());
  const BundleOptions options = bundleOptions();
  const Bundle bundle = exactBundle(model, 4, 12);
  const Layout layout(bundle);
  const int size = layout.size;
  Eigen::MatrixXd J = jacobian(model, bundle) / options.sigma_px;
  whiten(bundle, &J);
  Eigen::MatrixXd all = J.transpose() * J;
  all.diagonal() += priorInformation(options, bundle);
  const Precise unit = unitByParameters(bundle, all).cast<long double>();
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
  const Precise with_unit = information + unit * unit.transpose() / (kScaleSigma * kScaleSigma);
  const Eigen::MatrixXd plain = Precise(with_unit.inverse()).cast<double>();
  const Eigen::MatrixXd covariance =
      bundleCovariance(model, options, bundle, 2, depthShares(model, options, bundle), kScaleSigma);
  const int kept = size - 6;
  ASSERT_EQ(covariance.rows(), kept);
  EXPECT_LT((covariance - plain.bottomRightCorner(kept, kept)).norm(), 1e-6 * plain.norm());
}

/// Image points with noise, of which a share lasts from image to image as long as the feature is
/// seen.
Bundle noisyBundle(const CameraModel& model, double sigma_px, double lasting_share, unsigned seed) {
  constexpr double kPersistence = 0.9;
  Bundle bundle = exampleBundle(model, 8, 40, 0.1, 0.0, 3);
  Random random(seed);
  std::vector<Eigen::Vector2d> lasting(bundle.features.size());
  const auto drawn = [&random](double sigma) {
    const double x = random.normal(sigma), y = random.normal(sigma);
    return Eigen::Vector2d(x, y);
  };
  for (Eigen::Vector2d& error : lasting) error = drawn(1.0);
  const double fresh = std::sqrt(1.0 - kPersistence * kPersistence);
  for (std::size_t k = 1; k < bundle.observations.size(); ++k) {
    for (Eigen::Vector2d& error : lasting) error = kPersistence * error + drawn(fresh);
    for (BundleObservation& o : bundle.observations[k])
      o.pixel += sigma_px * (std::sqrt(lasting_share) * lasting[o.feature] +
                             drawn(std::sqrt(1.0 - lasting_share)));
  }
  return bundle;
}

BundleOptions scaledByScatter() {
  BundleOptions options = weakPrior();
  options.sigma_px = 0.45;
  options.outlier_px = 1e6;
  options.sigma_calibration.setConstant(1e-9);  // beyond doubt
  options.scale_by_scatter = true;
  return options;
}

/// How much larger the covariance is made than by the noise assumed.
double scatter(const CameraModel& model, BundleOptions options, const Bundle& bundle) {
  const int last = static_cast<int>(bundle.cameras.size()) - 1;
  const Eigen::MatrixXd scaled = bundleCovariance(model, options, bundle, last,
                                                  depthShares(model, options, bundle), kScaleSigma);
  options.scale_by_scatter = false;
  const Eigen::MatrixXd said = bundleCovariance(model, options, bundle, last,
                                                depthShares(model, options, bundle), kScaleSigma);
  return scaled.block<3, 3>(3, 3).trace() / said.block<3, 3>(3, 3).trace();  // of rotations
}

// In units of what the other features say of the camera.
TEST(BundleCovariance, IsScaledByHowFarTheCameraMovesWithoutOneFeature) {
  const CameraModel model(exampleCalibration());
  const BundleOptions options = scaledByScatter();
  for (unsigned seed = 1; seed <= 3; ++seed) {
    Bundle bundle = noisyBundle(model, 0.3, 0.5, seed);
    adjustBundle(model, options, &bundle);
    const Layout layout(bundle);
    const Eigen::MatrixXd J = jacobian(model, bundle) / options.sigma_px;
    std::vector<double> left;  // of the image points, and whose they are
    std::vector<int> feature;
    const Eigen::VectorXd expected = pixels(model, bundle);
    for (const auto& observations : bundle.observations)
      for (const BundleObservation& o : observations)
        for (int axis = 0; axis < 2; ++axis) {
          left.push_back((o.pixel[axis] - expected[static_cast<int>(left.size())]) /
                         options.sigma_px);
          feature.push_back(o.feature);
        }
    // The last camera's rotation and position across the way, of an adjustment without `without`.
    Eigen::MatrixXd seen = Eigen::MatrixXd::Zero(5, layout.size);
    const Eigen::Vector3d along = bundle.cameras.back().position_world.normalized();
    const Eigen::Vector3d across = along.unitOrthogonal();
    const int last = layout.calibration - 6;
    seen.block<1, 3>(0, last) = across.transpose();
    seen.block<1, 3>(1, last) = along.cross(across).transpose();
    seen.block<3, 3>(2, last + 3).setIdentity();
    const auto solve = [&](int without, Eigen::VectorXd* move) {
      Eigen::MatrixXd A = priorInformation(options, bundle).asDiagonal();
      Eigen::VectorXd g = Eigen::VectorXd::Zero(layout.size);
      for (int i = 0; i < J.rows(); ++i) {
        if (feature[i] == without) continue;
        A += J.row(i).transpose() * J.row(i);
        g += left[i] * J.row(i).transpose();
      }
      for (std::size_t i = 0; i < bundle.features.size(); ++i) {
        const int row = layout.first_feature + 3 * static_cast<int>(i) + 2;
        g[row] += (options.inverse_depth - bundle.features[i].inverse_depth) /
                  std::pow(options.sigma_inverse_depth, 2);
      }
      if (without >= 0) A.diagonal().segment<3>(layout.first_feature + 3 * without).array() += 1.0;
      const Eigen::MatrixXd inverse = A.inverse();
      *move = seen * inverse * g;
      return Eigen::MatrixXd(seen * inverse * seen.transpose());
    };
    Eigen::VectorXd none;
    solve(-1, &none);
    double squares = 0.0, of_squares = 0.0, missed = 0.0;
    for (int i = 0; i < static_cast<int>(bundle.features.size()); ++i) {
      Eigen::VectorXd move;
      const Eigen::MatrixXd by_others = solve(i, &move);
      move -= none;
      const double square = move.dot(by_others.inverse() * move);
      squares += square;
      of_squares += square * square;
    }
    for (const double miss : left) missed += miss * miss;
    missed /= static_cast<double>(left.size()) - 6.0 * (bundle.cameras.size() - 1.0) -
              3.0 * bundle.features.size();
    const double shown_by = squares * squares / of_squares;
    const double by_images = std::min(1.0, (bundle.cameras.size() - 2.0) / 10.0);
    const double by_misses = (1.0 + 1.6 * by_images) * missed;
    const double plain = (4.0 * by_misses + shown_by * squares / 5.0) / (4.0 + shown_by);
    EXPECT_NEAR(scatter(model, options, bundle) / plain, 1.0, 0.1) << plain;
  }
}

// Whatever noise was assumed, and however errors last.
TEST(BundleCovariance, IsThatOfTheErrorsMade) {
  const CameraModel model(exampleCalibration());
  const BundleOptions options = scaledByScatter();
  BundleOptions as_assumed = options;
  as_assumed.scale_by_scatter = false;
  as_assumed.sigma_px = 0.1;  // that of the image points
  const Bundle truth = noisyBundle(model, 0.0, 0.0, 1);
  for (const double lasting_share : {0.0, 0.8}) {
    double nees = 0.0, nees_as_assumed = 0.0;
    constexpr int kDraws = 40;
    for (int draw = 1; draw <= kDraws; ++draw) {
      Bundle bundle = noisyBundle(model, 0.1, lasting_share, draw);
      adjustBundle(model, options, &bundle);
      const Eigen::MatrixXd J = jacobian(model, bundle) / options.sigma_px;
      Eigen::MatrixXd information = J.transpose() * J;
      information.diagonal() += priorInformation(options, bundle);
      const Eigen::VectorXd unit = unitByParameters(bundle, information);
      const int first = Layout(bundle).first_feature;
      double larger = 0.0;
      for (std::size_t i = 0; i < bundle.features.size(); ++i)
        larger += unit[first + 3 * static_cast<int>(i) + 2] * bundle.features[i].inverse_depth *
                  std::log(bundle.features[i].inverse_depth / truth.features[i].inverse_depth);
      rescaleBundle(std::exp(larger), &bundle);
      const CameraState &is = bundle.cameras.back(), &was = truth.cameras.back();
      Eigen::Matrix<double, 6, 1> error;
      error << was.position_world - is.position_world,
          vectorFromRotation(was.q_world_camera * is.q_world_camera.conjugate());
      const auto normalised = [&](const BundleOptions& said) {
        const Eigen::MatrixXd P =
            bundleCovariance(model, said, bundle, 7, depthShares(model, said, bundle), 1e-6);
        return error.dot(P.topLeftCorner<6, 6>().inverse() * error);
      };
      nees += normalised(options) / kDraws;
      nees_as_assumed += normalised(as_assumed) / kDraws;
    }
    EXPECT_LT(nees, 7.5) << "lasting share " << lasting_share;
    // Errors are taken to last until many features show that they do not.
    EXPECT_GT(nees, lasting_share > 0.0 ? 4.5 : 3.5) << "lasting share " << lasting_share;
    if (lasting_share > 0.0) {
      EXPECT_GT(std::abs(nees_as_assumed - 6.0), 2.0);
    }
  }
}

}  // namespace
}  // namespace active_matching_slam
