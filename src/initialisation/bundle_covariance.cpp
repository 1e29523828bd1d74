#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/math/triangular.h"
#include "bundle_equations.h"

namespace active_matching_slam {
namespace {

/// Most of what is known of something that one feature is taken to tell.
constexpr double kMostShare = 0.99;
/// What image points miss shows how much the last camera scatters, too: errors that last make it so
/// many times as much once there are so many images, less in fewer (by NEES over rendered runs),
/// which counts like what so many features show.
constexpr double kScatterByMisses = 2.6, kImagesForScatter = 12.0, kFeaturesForMisses = 4.0;

double scatterByMisses(std::size_t images) {
  const double share = (static_cast<double>(images) - 2.0) / (kImagesForScatter - 2.0);
  return 1.0 + (kScatterByMisses - 1.0) * std::clamp(share, 0.0, 1.0);
}

/// How much more the last camera scatters, by what the features show, than A^-1 says for the
/// information A: its rotation, and its position across the way from the first, which no unit of
/// length changes. `inverse_root` as below.
double scatterOfLastCamera(const CameraModel& model, const BundleOptions& options,
                           const Bundle& bundle, const NormalEquations& N,
                           const CameraEquations& reduced, const Eigen::MatrixXd& inverse_root) {
  const Eigen::Index C = inverse_root.rows() - kLensSize, last = C - 7;  // before the readout
  const Eigen::Vector3d along = bundle.cameras.back().position_world.normalized();
  const Eigen::Vector3d across = along.unitOrthogonal();
  LastPoseMap seen = LastPoseMap::Zero(kLastPoseSize, C);
  seen.block<1, 3>(0, last) = across.transpose();
  seen.block<1, 3>(1, last) = along.cross(across).transpose();
  seen.block<3, 3>(2, last + 3).setIdentity();

  const auto root = inverse_root.topLeftCorner(C, C);
  const Eigen::MatrixXd half = seen * root.transpose();
  using Matrix = Eigen::Matrix<double, kLastPoseSize, kLastPoseSize>;
  const Matrix said = half * half.transpose();
  const Eigen::LLT<Matrix> said_root(said);
  if (said_root.info() != Eigen::Success) return 1.0;
  // In units of what is said, features share one unit of information.
  const LastPoseMap map = said_root.matrixL().solve(half * root);
  const FeaturePulls pulls = pullsOfFeatures(model, options, bundle, N, reduced, map);
  double squares = 0.0, of_squares = 0.0;
  for (const FeaturePull& pull : pulls.features) {
    const Eigen::SelfAdjointEigenSolver<Matrix> shares(pull.information);
    const Eigen::Array<double, kLastPoseSize, 1> moved =
        shares.eigenvectors().transpose() * pull.gradient;
    // By errors as said it would be the feature's shares (Bell and McCaffrey 2002).
    const double square =
        (moved.square() / (1.0 - shares.eigenvalues().array().min(kMostShare))).sum();
    squares += square;
    of_squares += square * square;
  }
  if (!(squares > 0.0)) return 1.0;
  const double shown_by = squares * squares / of_squares;  // so many features
  const double by_features = squares / kLastPoseSize;
  const double by_misses = scatterByMisses(bundle.cameras.size()) * pulls.missed;
  return pulls.yielding * pulls.yielding *
         (kFeaturesForMisses * by_misses + shown_by * by_features) /
         (kFeaturesForMisses + shown_by);
}

}  // namespace

Eigen::MatrixXd bundleCovariance(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle, int first_camera,
                                 const Eigen::VectorXd& unit_shares, double relative_scale_sigma) {
  const NormalEquations N = linearise(model, options, bundle);
  const LensVector lens_information = calibrationInformation(options).tail<kLensSize>();
  const auto reduced = eliminateFeatures(N, 0.0, &lens_information);
  if (!reduced) return {};
  const int cameras = static_cast<int>(N.cameras.rows()), kept = cameras - 6 * (first_camera - 1);
  const int F = static_cast<int>(N.features.size());
  // With S = R R^T the cameras' equations, W the cross terms and B = diag(L^-1), the covariance is
  // M M^T + diag(0, B^T B), where M = [1, -W L^-T B]^T R^-T.
  Eigen::MatrixXd M(kept + 3 * F, cameras);
  M.topRows(kept) = Eigen::MatrixXd::Identity(cameras, cameras).bottomRows(kept);
  for (int i = 0; i < F; ++i) {
    M.middleRows<3>(kept + 3 * i).noalias() = -reduced->inverse_roots[i].transpose().lazyProduct(
        reduced->cross.middleCols<3>(3 * i).transpose());
  }
  Eigen::MatrixXd inverse_root = inverseRoot(reduced->factor);
  double scatter = 1.0;
  if (options.scale_by_scatter) {
    scatter = scatterOfLastCamera(model, options, bundle, N, *reduced, inverse_root);
    inverse_root.bottomRows<kLensSize>() /= std::sqrt(scatter);  // nothing shows the lens
  }
  timesTransposeOf(inverse_root, M);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(M.rows(), M.rows());
  auto lower = covariance.selfadjointView<Eigen::Lower>();
  lower.rankUpdate(M);
  for (int i = 0; i < F; ++i)
    covariance.block<3, 3>(kept + 3 * i, kept + 3 * i) +=
        reduced->inverse_roots[i].transpose() * reduced->inverse_roots[i];
  covariance *= scatter;
  // The unit is known as well as said: one more measurement.
  Eigen::VectorXd depths = Eigen::VectorXd::Zero(M.rows());
  for (int i = 0; i < F; ++i)
    depths[kept + 3 * i + 2] = unit_shares[i] / bundle.features[i].inverse_depth;
  const Eigen::VectorXd along = lower * depths;
  const double variance = depths.dot(along);
  lower.rankUpdate(along, -1.0 / (relative_scale_sigma * relative_scale_sigma + variance));
  covariance.triangularView<Eigen::StrictlyUpper>() = covariance.transpose();
  return covariance;
}

}  // namespace active_matching_slam
