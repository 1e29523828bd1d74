#include "joint.h"

#include <Eigen/LU>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {

Joint::Joint(Eigen::VectorXd noise_variances, Eigen::VectorXd precision_determinant)
    : noise_variances_(std::move(noise_variances)),
      precision_determinant_(std::move(precision_determinant)) {}

std::shared_ptr<const ConditionalJoint> Joint::measure(
    const std::shared_ptr<const ConditionalJoint>& given, int feature) const {
  for (const auto& [measured, known] : given->derived_)
    if (measured == feature)
      if (auto alive = known.lock()) return alive;
  std::shared_ptr<ConditionalJoint> derived = derive(given, feature);
  derived->measured_precision_ = given->marginal(feature).covariance.inverse();
  given->derived_.emplace_back(feature, derived);
  return derived;
}

void Joint::setMarginal(ConditionalJoint& conditional, int feature,
                        const Eigen::Matrix2d& covariance) const {
  Marginal& marginal = conditional.marginals_[static_cast<std::size_t>(feature)];
  marginal.covariance = covariance;
  const bool proper = isProperCovariance(covariance);
  marginal.determinant = proper ? covariance.determinant() : 0.0;
  marginal.information_bits =
      proper ? informationBits(marginal.determinant, precision_determinant_(feature)) : 0.0;
}

void Joint::inherit(ConditionalJoint& conditional, const ConditionalJoint& given,
                    int feature) const {
  const auto slot = static_cast<std::size_t>(feature);
  conditional.marginals_ = given.marginals_;
  conditional.measured_ = given.measured_;
  conditional.measured_[slot] = 1;
  const double variance = noise_variances_(feature);
  conditional.marginals_[slot] = {variance * Eigen::Matrix2d::Identity(), variance * variance, 0.0};
}

}  // namespace active_matching_slam
