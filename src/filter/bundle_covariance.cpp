#include "active_matching_slam/filter/triangular.h"
#include "bundle_equations.h"

namespace active_matching_slam {
namespace {

/// Adds to the covariance what lasting errors do to the estimate beyond white ones: A^-1 E A^-1
/// (White's sandwich), with the information A and the `excess` E. `inverse_root` and `M` as below.
void addLastingErrors(const BundleMatrix& excess, const CameraEquations& reduced,
                      const Eigen::MatrixXd& inverse_root, const Eigen::MatrixXd& M, int kept,
                      Eigen::MatrixXd* covariance) {
  const Eigen::Index C = excess.cameras.rows();  // without the lens, which comes last
  const auto W = reduced.cross.topRows(C);
  const int F = static_cast<int>(excess.features.size());
  // Once the features are eliminated, the cameras' excess is E - Z W^T - W Z^T, and that with the
  // features' own U.
  Eigen::MatrixXd Z(C, W.cols()), U(C, W.cols());
  for (int i = 0; i < F; ++i) {
    const Eigen::Matrix3d& root = reduced.inverse_roots[i];
    const Eigen::Matrix3d own = root * excess.features[i] * root.transpose();
    const Eigen::Matrix<double, Eigen::Dynamic, 3> half = 0.5 * W.middleCols<3>(3 * i) * own;
    auto Zi = Z.middleCols<3>(3 * i);
    Zi.noalias() = excess.cross.middleCols<3>(3 * i).lazyProduct(root.transpose()) - half;
    U.middleCols<3>(3 * i).noalias() = (Zi - half).lazyProduct(root);
    covariance->block<3, 3>(kept + 3 * i, kept + 3 * i) += root.transpose() * own * root;
  }
  Eigen::MatrixXd E = excess.cameras.selfadjointView<Eigen::Lower>();
  const Eigen::MatrixXd by_features = Z * W.transpose();
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
