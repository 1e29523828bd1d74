#include "matching_trial.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "active_matching_slam/experiments/experiment.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/tracker/tracker_options.h"

namespace active_matching_slam {
namespace {

constexpr double kRightPx = 3.0;  ///< of the reference: farther is another place

/// The thesis has no stop rule and met at most 10 Gaussians; the cap bounds the worst frame.
MatchOptions thesisOptions() {
  MatchOptions options;
  options.update_rule = UpdateRule::kThesis;
  options.max_gaussians = 25;
  options.default_rates.true_positive = 0.8;
  options.clock_s = threadSeconds;
  return options;
}

MatchOptions packageOptions() {
  MatchOptions options = liveMatchOptions();
  options.ambiguous_below_weight = 0.0;  // as the others, scored on their best hypothesis
  options.clock_s = threadSeconds;
  return options;
}

}  // namespace

const std::vector<MatcherVariant>& matcherVariants() {
  static const std::vector<MatcherVariant> variants = {
      {"active_search", "active_search", thesisOptions()},
      {"jcbb", "jcbb", thesisOptions()},
      {"one_point_ransac", "one_point_ransac", thesisOptions()},
      {"active", "active", thesisOptions()},
      {"fast_active", "fast_active", thesisOptions()},
      {"chow_liu", "chow_liu", thesisOptions()},
      {"active_live", "active", packageOptions()},
      {"chow_liu_live", "chow_liu", packageOptions()},
  };
  return variants;
}

const MatcherVariant& matcherVariant(const std::string& label) {
  for (const MatcherVariant& variant : matcherVariants())
    if (variant.label == label) return variant;
  throw std::invalid_argument("no matcher '" + label + "'");
}

RecordedProblem selectFeatures(const RecordedProblem& problem, const std::vector<int>& kept) {
  const auto count = static_cast<int>(kept.size());
  RecordedProblem part;
  part.image = problem.image;
  part.other_ms = problem.other_ms;
  part.prior.noise_variance_px2 = problem.prior.noise_variance_px2;
  part.prior.z.resize(2 * count);
  part.prior.S = selectFeatures(problem.prior.S, kept);
  for (int i = 0; i < count; ++i) {
    const int from = kept[static_cast<std::size_t>(i)];
    const auto slot = static_cast<std::size_t>(from);
    part.prior.ids.push_back(problem.prior.ids[slot]);
    part.templates.push_back(problem.templates[slot]);
    part.reference_px.push_back(problem.reference_px[slot]);
    if (!problem.prior.noise_variances_px2.empty())
      part.prior.noise_variances_px2.push_back(problem.prior.noise_variances_px2[slot]);
    part.prior.z.segment<2>(2 * i) = problem.prior.mean(from);
  }
  return part;
}

RecordedProblem spreadFeatures(const RecordedProblem& problem, int features) {
  const int all = problem.prior.size();
  if (features >= all) return problem;
  std::vector<int> kept;
  for (int i = 0; i < features; ++i)
    kept.push_back(static_cast<int>(static_cast<long>(i) * all / features));
  return selectFeatures(problem, kept);
}

MatchingTrial tryMatcher(const Sequence& sequence, const RecordedProblem& problem,
                         const MatcherVariant& variant, bool keep_trace) {
  ImageOptions image_options;
  int template_size = 0;
  for (const Template& patch : problem.templates)
    template_size = std::max(template_size, patch.size);
  image_options.border_px = std::max(image_options.border_px, template_size / 2 + 2);
  ImageFeatureSearch search(image_options);
  search.beginFrame(sequence.images[static_cast<std::size_t>(problem.image)], problem.templates);
  MatchOptions options = variant.options;
  options.keep_trace = keep_trace;

  MatchingTrial trial;
  trial.result = createMatcher(variant.matcher)->match(problem.prior, search, options);
  const int features = problem.prior.size();
  for (int f = 0; f < features; ++f) {
    const auto slot = static_cast<std::size_t>(f);
    const int match = trial.result.match_of_feature[slot];
    const Eigen::Vector2d& reference = problem.reference_px[slot];
    trial.spurious += static_cast<int>(search.matches(f).size()) - (match >= 0);
    if (keep_trace) trial.matches.push_back(search.matches(f));
    trial.accepted_px.push_back(
        match >= 0 ? search.matches(f)[static_cast<std::size_t>(match)].pixel : unknownPixel());
    if (!reference.allFinite()) continue;
    if (match >= 0) {
      trial.error_px.push_back((trial.accepted_px.back() - reference).norm());
      ++(trial.error_px.back() <= kRightPx ? trial.right : trial.wrong);
    } else if (mahalanobisSquared({problem.prior.mean(f), problem.prior.covariance(f)},
                                  reference) <= kEllipseRadius2) {
      ++trial.missed;
    }
  }
  return trial;
}

bool sameAssociations(const MatchingTrial& a, const MatchingTrial& b) {
  constexpr double kSamePx = 0.5;  // maxima of a score map lie farther apart
  for (std::size_t f = 0; f < a.accepted_px.size(); ++f) {
    const bool is_matched = a.accepted_px[f].allFinite();
    if (is_matched != b.accepted_px[f].allFinite()) return false;
    if (is_matched && (a.accepted_px[f] - b.accepted_px[f]).norm() > kSamePx) return false;
  }
  return true;
}

TrialSummary summariseTrials(const std::vector<MatchingTrial>& trials,
                             const std::vector<MatchingTrial>& jcbb,
                             const std::vector<RecordedProblem>& problems) {
  TrialSummary sum;
  sum.frames = static_cast<int>(trials.size());
  double errors = 0.0;
  int error_count = 0;
  for (std::size_t i = 0; i < trials.size(); ++i) {
    const MatchingTrial& trial = trials[i];
    const MatchStatistics& s = trial.result.statistics;
    sum.candidates += s.candidates;
    sum.matched += s.matched;
    sum.pixels += static_cast<double>(s.pixels_searched);
    sum.gate_pixels += static_cast<double>(s.pixels_full_gates);
    sum.spurious += trial.spurious;
    sum.right += trial.right;
    sum.wrong += trial.wrong;
    sum.missed += trial.missed;
    for (const double error : trial.error_px) errors += error, ++error_count;
    sum.most_gaussians = std::max(sum.most_gaussians, s.max_gaussians);
    sum.mean_most_gaussians += s.max_gaussians;
    sum.steps += s.searches;
    sum.cut_short += s.cut_short;
    sum.same_as_jcbb += sameAssociations(trial, jcbb[i]);
    sum.information_ms += s.information_ms;
    sum.correlation_ms += s.correlation_ms;
    sum.tree_ms += s.tree_ms;
    sum.update_ms += s.total_ms - s.information_ms - s.correlation_ms - s.tree_ms;
    sum.total_ms += s.total_ms;
    sum.other_ms += problems[i].other_ms;
  }
  sum.error_px = error_count > 0 ? errors / error_count : std::nan("");
  const double frames = std::max(1, sum.frames);
  for (double* value :
       {&sum.candidates, &sum.matched, &sum.pixels, &sum.gate_pixels, &sum.spurious, &sum.right,
        &sum.wrong, &sum.missed, &sum.mean_most_gaussians, &sum.steps, &sum.information_ms,
        &sum.correlation_ms, &sum.update_ms, &sum.tree_ms, &sum.total_ms, &sum.other_ms})
    *value /= frames;
  return sum;
}

}  // namespace active_matching_slam
