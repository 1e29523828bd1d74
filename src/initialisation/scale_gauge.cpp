#include "active_matching_slam/initialisation/scale_gauge.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "active_matching_slam/math/quantile.h"

namespace active_matching_slam {
namespace {

/// Features below which all hold the scale. Derivation: as many as hold a motion.
constexpr std::size_t kFewFeatures = 10;

/// By which the median depth is what it is in the filter.
double medianFactor(const Ekf& filter, const MotionHypothesis& hypothesis) {
  std::vector<double> before, now;
  for (std::size_t i = 0; i < hypothesis.ids.size(); ++i) {
    const FeatureState* feature = filter.find(hypothesis.ids[i]);
    if (feature == nullptr) continue;
    const Eigen::Vector4d point = homogeneousPosition(*feature);
    before.push_back(point.w() / point.head<3>().norm());
    now.push_back(hypothesis.bundle.features[i].inverse_depth);
  }
  return medianOf(std::move(now)) / medianOf(std::move(before));
}

}  // namespace

Eigen::VectorXd ScaleGauge::apply(const Ekf& filter, const Eigen::VectorXd& information,
                                  MotionHypothesis* hypothesis) {
  const auto& ids = hypothesis->ids;
  auto& features = hypothesis->bundle.features;
  std::vector<Reference> kept;
  std::vector<std::size_t> places;
  double change = 0.0, sum = 0.0;
  for (const Reference& reference : references_) {
    const auto it = std::lower_bound(ids.begin(), ids.end(), reference.id);
    if (it == ids.end() || *it != reference.id) continue;
    kept.push_back(reference);
    places.push_back(static_cast<std::size_t>(it - ids.begin()));
    change += reference.weight * features[places.back()].inverse_depth / reference.inverse_depth;
    sum += reference.weight;
  }
  const double factor = references_.empty() ? medianFactor(filter, *hypothesis) : change / sum;
  if (std::isfinite(factor) && factor > 0.0) rescaleBundle(factor, &hypothesis->bundle);
  if (kept.size() < kFewFeatures) {
    kept.clear();
    places.clear();
    for (std::size_t i = 0; i < ids.size(); ++i) {
      kept.push_back({ids[i], information[static_cast<Eigen::Index>(i)], 0.0});
      places.push_back(i);
    }
  }
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(ids.size()));
  for (std::size_t r = 0; r < kept.size(); ++r) {
    kept[r].inverse_depth = features[places[r]].inverse_depth;
    weights[static_cast<Eigen::Index>(places[r])] = kept[r].weight;
  }
  references_ = std::move(kept);
  return weights / weights.sum();
}

void ScaleGauge::rescale(double factor) {
  for (Reference& reference : references_) reference.inverse_depth /= factor;
}

}  // namespace active_matching_slam
