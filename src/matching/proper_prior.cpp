#include "proper_prior.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

/// A conditional block this much smaller than the marginal is rounding, not information.
constexpr double kSingular = 1e-11;

/// Left-looking Cholesky, one feature at a time, that skips the features that depend on those
/// before.
std::vector<int> independentFeatures(const Eigen::MatrixXd& S) {
  const int size = static_cast<int>(S.rows() / 2);
  Eigen::MatrixXd L = Eigen::MatrixXd::Zero(S.rows(), S.rows());
  std::vector<int> kept;
  for (int f = 0; f < size; ++f) {
    const int n = 2 * static_cast<int>(kept.size());
    bool proper = true;
    for (int r = 0; r < 2 && proper; ++r) {
      const int row = n + r;
      for (int c = 0; c <= row; ++c) {
        const int feature = c < n ? kept[static_cast<std::size_t>(c / 2)] : f;
        double value = S(2 * f + r, 2 * feature + c % 2);
        value -= L.row(row).head(c).dot(L.row(c).head(c));
        if (c < row) {
          L(row, c) = value / L(c, c);
        } else {
          proper = value > kSingular * S(2 * f + r, 2 * f + r);
          L(row, row) = std::sqrt(std::max(value, 0.0));
        }
      }
    }
    if (proper) kept.push_back(f);
  }
  return kept;
}

}  // namespace

ProperPrior::ProperPrior(const MeasurementPrior& prior)
    : prior_(prior), total_(prior.size()), z_(&prior.z), S_(&prior.S) {
  std::vector<int> kept;
  for (int f = 0; f < total_; ++f)
    if (prior.mean(f).allFinite() && isProperCovariance(prior.covariance(f))) kept.push_back(f);
  for (int f = 0; f < total_; ++f) original_.push_back(f);
  if (static_cast<int>(kept.size()) < total_) take(kept);
  // What is left must be finite throughout.
  kept.clear();
  for (int f = 0; f < size(); ++f)
    if (S_->middleCols<2>(2 * f).allFinite()) kept.push_back(f);
  if (static_cast<int>(kept.size()) < size()) take(kept);
}

Eigen::MatrixXd ProperPrior::wideS() const {
  if (!(prior_.wide_probability > 0.0) || prior_.wide_S.rows() != prior_.z.size() ||
      !prior_.wide_S.allFinite())
    return {};
  return selectFeatures(prior_.wide_S, original_);
}

Eigen::VectorXd ProperPrior::noiseVariances() const {
  Eigen::VectorXd variances(size());
  for (int f = 0; f < size(); ++f) variances[f] = prior_.noiseVariance_px2(original(f));
  return variances;
}

void ProperPrior::leaveOutDependent() { take(independentFeatures(*S_)); }

void ProperPrior::leaveOut(int feature) {
  std::vector<int> kept;
  for (int f = 0; f < size(); ++f)
    if (f != feature) kept.push_back(f);
  take(kept);
}

void ProperPrior::take(const std::vector<int>& kept) {
  std::vector<int> original;
  for (const int f : kept) original.push_back(this->original(f));
  original_ = original;
  own_z_.resize(2 * size());
  own_S_ = selectFeatures(prior_.S, original_);
  for (int i = 0; i < size(); ++i)
    own_z_.segment<2>(2 * i) = prior_.z.segment<2>(2 * this->original(i));
  z_ = &own_z_;
  S_ = &own_S_;
}

}  // namespace active_matching_slam
