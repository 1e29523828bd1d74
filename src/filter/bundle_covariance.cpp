#include "active_matching_slam/filter/triangular.h"
#include "bundle_equations.h"

namespace active_matching_slam {
namespace {

/// Adds to the covariance what lasting errors do to the estimate beyond white ones, where E is what
/// they do to the gradient: A^-1 E A^-1 (White's sandwich), A the information. M as below.
void addLastingErrors(const NormalEquations& excess, const CameraEquations& reduced,
                      const Eigen::MatrixXd& inverse_root, const Eigen::MatrixXd& M, int kept,
                      Eigen::MatrixXd* covariance) {
  const Eigen::Index C = excess.cameras.rows();  // without the lens, which comes last
  const auto W = reduced.cross.topRows(C);
  // Once the features are eliminated: of the cameras E, and with the features' own U.
  Eigen::MatrixXd U(C, W.cols()), half(C, W.cols());
  const int F = static_cast<int>(excess.features.size());
  for (int i = 0; i < F; ++i) {
    const Eigen::Matrix3d& root = reduced.inverse_roots[i];
    const Eigen::Matrix3d own = root * excess.features[i] * root.transpose();
    const auto Wi = W.middleCols<3>(3 * i);
    half.middleCols<3>(3 * i).noalias() =
        excess.cross.middleCols<3>(3 * i).lazyProduct(root.transpose()) - Wi.lazyProduct(0.5 * own);
    U.middleCols<3>(3 * i).noalias() =
        (half.middleCols<3>(3 * i) - Wi.lazyProduct(0.5 * own)).lazyProduct(root);
    covariance->block<3, 3>(kept + 3 * i, kept + 3 * i) += root.transpose() * own * root;
  }
  Eigen::MatrixXd E = excess.cameras.selfadjointView<Eigen::Lower>();
  const Eigen::MatrixXd by_features = half * W.transpose();
  E -= by_features;
  E -= by_features.transpose();
  const Eigen::MatrixXd T = M.leftCols(C) * inverse_root.topLeftCorner(C, C);
  covariance->noalias() += T * E * T.transpose();
  const Eigen::MatrixXd with_features = T * U;
  covariance->rightCols(3 * F) += with_features;
  covariance->bottomRows(3 * F) += with_features.transpose();
}

}  // namespace

Eigen::MatrixXd bundleCovariance(const CameraModel& model, const BundleOptions& options,
                                 const Bundle& bundle, int first_camera,
                                 double relative_scale_sigma) {
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
  const Eigen::MatrixXd inverse_root = inverseRoot(reduced->factor);
  timesTransposeOf(inverse_root, M);
  Eigen::MatrixXd covariance = Eigen::MatrixXd::Zero(M.rows(), M.rows());
  auto lower = covariance.selfadjointView<Eigen::Lower>();
  lower.rankUpdate(M);
  for (int i = 0; i < F; ++i)
    covariance.block<3, 3>(kept + 3 * i, kept + 3 * i) +=
        reduced->inverse_roots[i].transpose() * reduced->inverse_roots[i];
  if (options.lasting_share > 0.0)
    addLastingErrors(lastingExcess(model, options, bundle), *reduced, inverse_root, M, kept,
                     &covariance);
  // The unit is known as well as said: one more measurement.
  Eigen::VectorXd depths = Eigen::VectorXd::Zero(M.rows());
  for (int i = 0; i < F; ++i)
    depths[kept + 3 * i + 2] = 1.0 / (F * bundle.features[i].inverse_depth);
  const Eigen::VectorXd along = lower * depths;
  const double variance = depths.dot(along);
  lower.rankUpdate(along, -1.0 / (relative_scale_sigma * relative_scale_sigma + variance));
  covariance.triangularView<Eigen::StrictlyUpper>() = covariance.transpose();
  return covariance;
}

}  // namespace active_matching_slam
