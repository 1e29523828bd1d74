#include "active_matching_slam/filter/scale_from_distances.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "active_matching_slam/filter/state_error.h"

namespace active_matching_slam {

std::optional<ScaleEstimate> estimateScale(const Ekf& filter,
                                           const std::vector<KnownDistance>& distances) {
  const auto count = static_cast<Eigen::Index>(distances.size());
  if (count < 2) return std::nullopt;
  Eigen::MatrixXd G = Eigen::MatrixXd::Zero(count, filter.stateSize());
  Eigen::VectorXd log_ratio(count), noise(count);
  for (Eigen::Index k = 0; k < count; ++k) {
    const KnownDistance& known = distances[static_cast<std::size_t>(k)];
    const FeatureState* a = filter.find(known.first);
    const FeatureState* b = filter.find(known.second);
    if (!a || !b || a->kind != FeatureKind::kPoint || b->kind != FeatureKind::kPoint)
      return std::nullopt;
    const Eigen::Vector3d offset = a->point_world - b->point_world;
    const double distance = offset.norm();
    if (!(distance > 0.0) || !(known.metres > 0.0)) return std::nullopt;
    // d log |a - b|
    G.block<1, 3>(k, a->offset) += offset.transpose() / (distance * distance);
    G.block<1, 3>(k, b->offset) -= offset.transpose() / (distance * distance);
    log_ratio(k) = std::log(known.metres / distance);
    noise(k) = std::pow(known.sigma_m / known.metres, 2);
  }
  Eigen::MatrixXd S = G * filter.covariance() * G.transpose();
  S.diagonal() += noise;
  const Eigen::LLT<Eigen::MatrixXd> factor(S);
  if (factor.info() != Eigen::Success) return std::nullopt;
  const Eigen::VectorXd ones = Eigen::VectorXd::Ones(count);
  const Eigen::VectorXd unscaled = factor.solve(ones);
  const double variance = 1.0 / ones.dot(unscaled);
  const Eigen::VectorXd weights = variance * unscaled;
  const double log_factor = weights.dot(log_ratio);
  if (!std::isfinite(log_factor) || !(variance > 0.0)) return std::nullopt;
  const Eigen::VectorXd rest = log_ratio.array() - log_factor;
  ScaleEstimate estimate;
  estimate.factor = std::exp(log_factor);
  estimate.sigma = std::sqrt(variance);
  estimate.chi2 = rest.dot(factor.solve(rest));
  estimate.degrees = static_cast<int>(count) - 1;
  estimate.functional = G.transpose() * weights;
  estimate.distance_variance = weights.cwiseAbs2().dot(noise);
  return estimate;
}

void takeScale(const ScaleEstimate& estimate, Ekf* filter) {
  filter->rescale(estimate.factor);
  // The functional of the rescaled state: rows of lengths answer to errors that have grown.
  std::vector<FeatureState> features = filter->features();
  Eigen::VectorXd functional = estimate.functional / estimate.factor;
  const Eigen::VectorXd generator =
      gaugeGenerators(filter->camera(), features, filter->stateSize()).col(3);
  Eigen::MatrixXd P = filter->covariance();
  const Eigen::VectorXd Pg = P * functional;
  const double variance = functional.dot(Pg) + estimate.distance_variance;
  P.noalias() -= generator * Pg.transpose();
  P.noalias() -= Pg * generator.transpose();
  P.noalias() += variance * generator * generator.transpose();
  P = 0.5 * (P + P.transpose()).eval();
  filter->restore(filter->camera(), features, P, filter->nextId());
}

}  // namespace active_matching_slam
