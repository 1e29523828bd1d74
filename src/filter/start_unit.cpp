#include "active_matching_slam/filter/start_unit.h"

#include <algorithm>
#include <cmath>

namespace active_matching_slam {
namespace {

constexpr double kLeastLeft = 0.5;  ///< that is still seen of what told the unit
/// Of what lengths are uncertain by, what their unit is: logarithms are not linear.
constexpr double kShareOfUnit = 0.01;
constexpr double kShareOfLengths = 0.03;  ///< of what lengths are uncertain by, that makes none

}  // namespace

double relativeLengthSigma(const Eigen::Vector3d& way, const Eigen::Matrix3d& covariance) {
  return std::sqrt(std::max(way.dot(covariance * way), 0.0)) / way.squaredNorm();
}

StartUnit::Choice StartUnit::choose(const Ekf& filter, const std::vector<FeatureId>& ids,
                                    Eigen::VectorXd anew) {
  length_sigma_ =
      std::min(length_sigma_, relativeLengthSigma(filter.camera().position_world,
                                                  filter.cameraCovariance().topLeftCorner<3, 3>()));
  const double sigma = std::min(Ekf::kFreeScaleSigma, kShareOfUnit * length_sigma_);
  if (!isChosen()) return {std::move(anew), sigma};
  Choice kept{Eigen::VectorXd::Zero(anew.size()), sigma, true};
  auto known = shares_.begin();
  for (std::size_t i = 0; i < ids.size(); ++i) {
    const auto row = static_cast<Eigen::Index>(i);
    if (filter.find(ids[i]) == nullptr) {
      anew[row] = 0.0;
      continue;
    }
    while (known != shares_.end() && known->first < ids[i]) ++known;
    if (known != shares_.end() && known->first == ids[i]) kept.shares[row] = known->second;
  }
  anew /= anew.sum();
  const double sigma_anew = filter.sigmaMeanLogDistance(ids, anew);
  if (sigma_anew < kShareOfLengths * length_sigma_) return {std::move(anew), sigma};
  const double left = kept.shares.sum();
  if (left < kLeastLeft) return {std::move(anew), std::hypot(sigma, sigma_anew)};
  kept.shares /= left;
  kept.sigma = std::hypot(sigma, filter.sigmaMeanLogDistance(ids, kept.shares));
  return kept;
}

void StartUnit::adopt(const std::vector<FeatureId>& ids, const Choice& choice) {
  if (choice.is_kept) return;
  shares_.clear();
  for (std::size_t i = 0; i < ids.size(); ++i)
    shares_.emplace_back(ids[i], choice.shares[static_cast<Eigen::Index>(i)]);
}

}  // namespace active_matching_slam
