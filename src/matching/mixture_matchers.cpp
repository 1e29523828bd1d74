#include "mixture_matchers.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "mixture_run.h"
#include "modelled_cost.h"

namespace active_matching_slam {
namespace {

/// Cost: modelled time up to which `auto` takes `active` [ms], a third of a frame at 30 Hz. Beyond,
/// it does so too where chow_liu would not halve the time, as with less than about 130 features.
constexpr double kAutoMs = 10.0;

void chargeInformation(const ProperPrior& prior, BudgetedSearch& budgeted) {
  budgeted.charge(kInformationCubeMs * std::pow(prior.size(), 3));
}

void addWide(const Joint& joint, const Eigen::MatrixXd& S, double probability,
             std::vector<PriorGaussian>* gaussians) {
  gaussians->front().probability = 1.0 - probability;
  gaussians->push_back({&joint, &S, probability});
}

MatchResult matchDense(const MeasurementPrior& given, FeatureSearch& search,
                       const MatchOptions& options, MixtureRun::Policy policy, const char* name) {
  ProperPrior prior(given);
  BudgetedSearch budgeted(prior, search, options);
  const double start = budgeted.now();
  FeatureInformation information = featureInformation(prior.S());
  chargeInformation(prior, budgeted);
  if (information.regularisation > 0.0) {
    prior.leaveOutDependent();
    information = featureInformation(prior.S());
  }
  MatchResult result = budgeted.begin(name);
  if (prior.size() > 0) {
    const auto joint =
        makeDenseJoint(prior.S(), information.precision_determinant, prior.noiseVariances());
    std::vector<PriorGaussian> gaussians = {{joint.get(), &prior.S(), 1.0}};
    const Eigen::MatrixXd wide_S = prior.wideS();
    std::unique_ptr<Joint> wide;
    if (wide_S.rows() > 0) {
      const FeatureInformation of_wide = featureInformation(wide_S);
      chargeInformation(prior, budgeted);
      if (of_wide.regularisation == 0.0) {
        wide = makeDenseJoint(wide_S, of_wide.precision_determinant, prior.noiseVariances());
        addWide(*wide, wide_S, prior.wideProbability(), &gaussians);
      }
    }
    result.statistics.information_ms = 1e3 * (budgeted.now() - start);
    MixtureRun(given, prior, gaussians, budgeted, options, policy).run(result);
  }
  budgeted.finish(result);
  return result;
}

/// A feature of the tree that a neighbour determines exactly; -1: none.
int dependentFeature(const ChowLiuTree& tree) {
  constexpr double kSingular = 1e-11;
  for (std::size_t e = 0; e < tree.edges.size(); ++e) {
    const auto i = static_cast<std::size_t>(tree.edges[e].first);
    const auto j = static_cast<std::size_t>(tree.edges[e].second);
    const Eigen::Matrix2d& cross = tree.cross_covariances[e];
    const Eigen::Matrix2d conditional =
        tree.marginals[j] - cross.transpose() * tree.marginals[i].inverse() * cross;
    const bool proper =
        isProperCovariance(conditional) &&
        (conditional.diagonal().array() > kSingular * tree.marginals[j].diagonal().array()).all();
    if (!proper) return tree.edges[e].second;
  }
  return -1;
}

/// The tree of the prior, without features that a neighbour determines exactly.
ChowLiuTree properTree(ProperPrior& prior) {
  while (true) {
    ChowLiuTree tree = chowLiuTree(prior.S());
    const int dependent = dependentFeature(tree);
    if (dependent < 0) return tree;
    prior.leaveOut(dependent);
  }
}

/// Milliseconds that `active` and `chow_liu` take on one core of the year 2020, without clutter,
/// which costs both alike: cubic and quadratic in the features.
double activeMilliseconds(double features) {
  const double hundreds = 0.01 * features;
  return 1.5 * hundreds + 1.5 * hundreds * hundreds * hundreds;
}
double chowLiuMilliseconds(double features) {
  const double hundreds = 0.01 * features;
  return 1.7 * hundreds + 0.3 * hundreds * hundreds;
}

/// Factor on these times for the expected clutter in the prior's ellipses.
double clutterFactor(const MeasurementPrior& prior, const MatchOptions& options) {
  double clutter = 0.0;
  for (int f = 0; f < prior.size(); ++f) {
    const FeatureRates& rates =
        prior.rates.empty() ? options.default_rates : prior.rates[static_cast<std::size_t>(f)];
    const double area = ellipseArea(prior.covariance(f));
    if (std::isfinite(area)) clutter += area * rates.false_positive;
  }
  return 1.0 + 2.0 * clutter / std::max(static_cast<double>(prior.size()), 1.0);
}

}  // namespace

MatchResult ActiveMatcher::match(const MeasurementPrior& prior, FeatureSearch& search,
                                 const MatchOptions& options) {
  return matchDense(prior, search, options, MixtureRun::Policy::kFull, "active");
}

MatchResult FastActiveMatcher::match(const MeasurementPrior& prior, FeatureSearch& search,
                                     const MatchOptions& options) {
  return matchDense(prior, search, options, MixtureRun::Policy::kFast, "fast_active");
}

MatchResult ChowLiuMatcher::match(const MeasurementPrior& given, FeatureSearch& search,
                                  const MatchOptions& options) {
  ProperPrior prior(given);
  BudgetedSearch budgeted(prior, search, options);
  const double start = budgeted.now();
  const ChowLiuTree tree = properTree(prior);
  MatchResult result = budgeted.begin("chow_liu");
  for (const WeightedEdge& edge : tree.edges)
    result.tree_edges.emplace_back(prior.original(edge.first), prior.original(edge.second));
  if (prior.size() > 0) {
    const auto joint = makeTreeJoint(tree, prior.noiseVariances());
    std::vector<PriorGaussian> gaussians = {{joint.get(), &prior.S(), 1.0}};
    const Eigen::MatrixXd wide_S = prior.wideS();
    std::unique_ptr<Joint> wide;
    if (wide_S.rows() > 0) {
      const ChowLiuTree wide_tree = chowLiuTree(wide_S);
      if (dependentFeature(wide_tree) < 0) {
        wide = makeTreeJoint(wide_tree, prior.noiseVariances());
        addWide(*wide, wide_S, prior.wideProbability(), &gaussians);
      }
    }
    result.statistics.tree_ms = 1e3 * (budgeted.now() - start);
    MixtureRun(given, prior, gaussians, budgeted, options, MixtureRun::Policy::kFull).run(result);
  }
  budgeted.finish(result);
  return result;
}

MatchResult AutoMatcher::match(const MeasurementPrior& prior, FeatureSearch& search,
                               const MatchOptions& options) {
  double limit = kAutoMs;
  if (options.max_milliseconds > 0.0) limit = std::min(limit, options.max_milliseconds);
  const double active_ms = activeMilliseconds(prior.size());
  const bool fits = active_ms * clutterFactor(prior, options) <= limit;
  // The tree is an approximation, weakest where there is much clutter: not for a small gain.
  const bool pays = chowLiuMilliseconds(prior.size()) < 0.5 * active_ms;
  if (fits || !pays) return active_.match(prior, search, options);
  return chow_liu_.match(prior, search, options);
}

}  // namespace active_matching_slam
