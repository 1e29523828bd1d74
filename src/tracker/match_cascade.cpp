#include "active_matching_slam/tracker/match_cascade.h"

#include <Eigen/LU>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <utility>
#include <vector>

#include "active_matching_slam/image/feature_flow.h"
#include "active_matching_slam/image/image_motion.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/false_alarm.h"
#include "active_matching_slam/matching/innovation_gate.h"
#include "active_matching_slam/math/pixel_scale.h"
#include "active_matching_slam/tracker/image_motion_prior.h"

namespace active_matching_slam {
namespace {

/// Of all 3-sigma ellipses together [px^2].
double gateArea(const MeasurementPrior& prior) {
  double area_px2 = 0.0;
  for (int i = 0; i < prior.size(); ++i)
    area_px2 += 9.0 * M_PI * std::sqrt(std::max(prior.covariance(i).determinant(), 0.0));
  return area_px2;
}

double expectedMatches(const FrameState& frame) {
  return std::accumulate(frame.match_probabilities.begin(), frame.match_probabilities.end(), 0.0);
}

/// Modelled time of following the features from image to image, of an image of a million pixels,
/// and of aligning two images [ms]. Cost: medians on one core of about 3 GHz.
constexpr double kFlowMs = 6.0, kAlignmentMs = 3.0;

/// How the image moved since the reference image, which is the same whatever the prior.
class ImageGuide {
 public:
  ImageGuide(const FrameState& frame, const MatchOptions& matching)
      : frame_(frame), matching_(matching) {}

  /// `prior` given how the features moved in the image, or else how it moved as a whole. Empty when
  /// both are unknown.
  std::optional<MeasurementPrior> condition(const MeasurementPrior& prior) {
    if (frame_.reference_image.size() != frame_.image.size()) return std::nullopt;
    const double start_s = now();
    auto guided = conditionOnFlow(prior, flowPx(), flowSigma_px(frame_.image.cols));
    if (!guided) guided = conditionOnMotion(prior);
    if (!matching_.modelled_time) spent_ms_ += 1e3 * (now() - start_s);
    return guided;
  }

  /// What of the frame's budget was spent since this was last asked.
  double takeSpentMilliseconds() { return std::exchange(spent_ms_, 0.0); }

 private:
  using Points = std::vector<std::optional<Eigen::Vector2d>>;

  double now() const {
    if (matching_.clock_s) return matching_.clock_s();
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch())
        .count();
  }

  void charge(double milliseconds) {
    if (matching_.modelled_time) spent_ms_ += milliseconds;
  }

  std::optional<MeasurementPrior> conditionOnMotion(const MeasurementPrior& prior) {
    charge(kAlignmentMs);
    const auto motion = estimateImageMotion(frame_.reference_image, frame_.image,
                                            predictedImageMotion(prior, frame_.reference_px));
    if (!motion) return std::nullopt;
    return conditionOnImageMotion(prior, frame_.reference_px, *motion);
  }

  const Points& flowPx() {
    if (flow_px_) return *flow_px_;
    charge(1e-6 * kFlowMs * static_cast<double>(frame_.image.total()));
    Points seen = frame_.reference_px;
    for (std::size_t i = 0; i < seen.size(); ++i)
      if (!frame_.in_reference[i]) seen[i].reset();
    flow_px_ = trackPoints(frame_.reference_image, frame_.image, seen);
    return *flow_px_;
  }

  const FrameState& frame_;
  const MatchOptions& matching_;
  std::optional<Points> flow_px_;
  double spent_ms_ = 0.0;
};

/// Of the budget, what the first attempt has the fraction of, whatever its guide took. Cost: of a
/// budget so small that the guide alone uses it up.
constexpr double kLeastLeft = 0.1;

/// The prior of a frame in which the camera jerks.
MeasurementPrior jerkPrior(const FrameState& frame) {
  MeasurementPrior prior = frame.prior;
  if (frame.jerk_px.cols() > 0) prior.S += frame.jerk_px * frame.jerk_px.transpose();
  return prior;
}

}  // namespace

/// One more attempt, and when its result replaces the present one.
struct MatchCascade::Fallback {
  Matcher& matcher;
  const MeasurementPrior& prior;
  ImageFeatureSearch& search;    ///< a new one, or that of the attempts before, which goes on
  double budget_fraction = 1.0;  ///< of what is left
  double minimum_matches = 0.0;
  double maximum_nis = std::numeric_limits<double>::infinity();  ///< of its joint distance
};

MatchCascade::MatchCascade(const std::string& matcher, const MatchCascadeOptions& options)
    : options_(options),
      matcher_name_(matcher),
      matcher_(createMatcher(matcher)),
      jcbb_(createMatcher("jcbb")),
      ransac_(createMatcher("one_point_ransac")) {}

void MatchCascade::setOptions(const std::string& matcher, const MatchCascadeOptions& options) {
  if (matcher != matcher_name_) matcher_ = createMatcher(matcher);
  matcher_name_ = matcher;
  options_ = options;
}

void MatchCascade::match(const MatchOptions& matching, bool fallbacks, FrameState* frame) {
  if (fallbacks) {
    matchWithFallbacks(matching, frame);
  } else {
    frame->matching =
        matcher_->match(frame->prior, frame->search, withBudget(matching, 1.0, *frame));
  }
  frame->inliers = gate(*frame);
}

void MatchCascade::matchWithFallbacks(const MatchOptions& matching, FrameState* frame) {
  const double scale = pixelScale(frame->image.cols, frame->image.rows);
  const bool is_wide = gateArea(frame->prior) > options_.wide_gates_px2 * scale * scale;
  const bool can_jerk = frame->jerk_px.size() > 0 && !frame->jerk_px.isZero();
  const MeasurementPrior jerk = jerkPrior(*frame);
  ImageGuide guide(*frame, matching);
  const auto guided = is_wide ? guide.condition(frame->prior) : std::nullopt;
  if (can_jerk && !guided) {
    frame->prior.wide_S = jerk.S;
    frame->prior.wide_probability = frame->jerk_probability;
  }
  const double guided_ms = guide.takeSpentMilliseconds();
  const double left =
      std::max(kLeastLeft, 1.0 - fractionOfBudget(withBudget(matching, 1.0, *frame), 0, guided_ms));
  frame->matching =
      matcher_->match(guided ? *guided : frame->prior, frame->search,
                      withBudget(matching, left * options_.first_budget_fraction, *frame));
  frame->matching.statistics.budget_ms += guided_ms;
  bool is_jerk = frame->matching.is_wide;
  if (expectedMatches(*frame) >= options_.minimum_expected && isPoor(*frame)) {
    const bool is_tried = is_wide && !can_jerk;
    const auto guided_jerk = is_tried ? guided : guide.condition(jerk);
    frame->matching.statistics.budget_ms += guide.takeSpentMilliseconds();
    const MeasurementPrior& wide = guided_jerk ? *guided_jerk : jerk;
    if (!is_tried && (guided_jerk || can_jerk)) is_jerk |= retry(matching, wide, frame);
    if (frame->poor_frames <= options_.maximum_poor_frames)
      is_jerk |= tryConsensusMatchers(matching, wide, frame);
  }
  if (is_jerk && can_jerk) {
    frame->is_jerk = true;
    frame->prior = jerk;
  }
  if (expectedMatches(*frame) < options_.minimum_expected) return;
  if (!isFalseAlarm(*frame)) return;
  MatchResult& result = frame->matching;
  std::fill(result.match_of_feature.begin(), result.match_of_feature.end(), -1);
  result.statistics.matched = 0;
}

bool MatchCascade::retry(const MatchOptions& matching, const MeasurementPrior& prior,
                         FrameState* frame) const {
  ImageFeatureSearch search = frame->search;
  search.beginFrame(frame->image, frame->templates, frame->sources, frame->mask.templateCentres());
  const double minimum_matches =
      std::max(options_.replacing_ratio * frame->matching.statistics.matched,
               options_.majority_fraction * expectedMatches(*frame));
  if (!tryFallback({*matcher_, prior, search, options_.fallback_budget_fraction, minimum_matches},
                   matching, frame))
    return false;
  frame->search = std::move(search);
  return true;
}

/// Both search the gates of `prior`: what has been searched there need not be again.
bool MatchCascade::tryConsensusMatchers(const MatchOptions& matching, const MeasurementPrior& prior,
                                        FrameState* frame) const {
  const double expected = expectedMatches(*frame);
  const auto matched = [frame] { return double(frame->matching.statistics.matched); };
  if (isPoor(*frame) &&
      tryFallback({*jcbb_, prior, frame->search, options_.fallback_budget_fraction,
                   std::max(matched(), options_.majority_fraction * expected), options_.jcbb_nis},
                  matching, frame))
    return true;
  if (matched() > options_.poor_fraction * expected) return false;
  return tryFallback(
      {*ransac_, prior, frame->search, 1.0,
       std::max(options_.replacing_ratio * matched(), options_.minimum_fraction * expected),
       options_.ransac_nis},
      matching, frame);
}

/// Whether its result replaced the present one. What it used of the budget is added either way.
bool MatchCascade::tryFallback(const Fallback& fallback, const MatchOptions& matching,
                               FrameState* frame) const {
  MatchStatistics& before = frame->matching.statistics;
  const double left = 1.0 - fractionOfBudget(withBudget(matching, 1.0, *frame),
                                             before.pixels_searched, before.budget_ms);
  if (!(left > 0.0)) return false;
  MatchResult result =
      fallback.matcher.match(fallback.prior, fallback.search,
                             withBudget(matching, fallback.budget_fraction * left, *frame));
  MatchStatistics& now = result.statistics;
  now.pixels_searched += before.pixels_searched;
  now.total_ms += before.total_ms;
  now.budget_ms += before.budget_ms;
  if (now.matched >= fallback.minimum_matches &&
      now.mahalanobis2 <= 2.0 * now.matched * fallback.maximum_nis) {
    frame->matching = std::move(result);
    return true;
  }
  before.pixels_searched = now.pixels_searched;
  before.total_ms = now.total_ms;
  before.budget_ms = now.budget_ms;
  return false;
}

MatchOptions MatchCascade::withBudget(const MatchOptions& matching, double fraction,
                                      const FrameState& frame) const {
  MatchOptions options = matching;
  options.max_milliseconds *=
      fraction * std::max(1.0, options_.budget_rate_hz * frame.predicted_interval_s);
  if (options.max_pixels > 0)
    options.max_pixels =
        std::max<std::int64_t>(1, std::llround(fraction * static_cast<double>(options.max_pixels)));
  return options;
}

/// Matches that the present result should have.
double MatchCascade::expectedOfResult(const FrameState& frame) const {
  const MatchStatistics& statistics = frame.matching.statistics;
  if (!statistics.cut_short) return expectedMatches(frame);
  double expected = 0.0;
  for (int i = 0; i < frame.prior.size(); ++i)
    if (frame.isLookedFor(i)) expected += frame.match_probabilities[i];
  const bool is_crowded =
      statistics.matches_met > options_.crowded_matches * frame.countLookedFor();
  return is_crowded ? expectedMatches(frame) : expected;
}

bool MatchCascade::isPoor(const FrameState& frame) const {
  const MatchStatistics& statistics = frame.matching.statistics;
  return statistics.matched <=
         (statistics.ambiguous ? options_.poor_fraction_ambiguous : options_.poor_fraction) *
             expectedOfResult(frame);
}

/// Whether as many matches agree by chance, among all that were met. While depths are vague,
/// matches leave each other most of their gates, and the test has no power: only very few fail.
bool MatchCascade::isFalseAlarm(const FrameState& frame) const {
  const MatchResult& result = frame.matching;
  if (frame.depths_vague)
    return result.statistics.matched < options_.minimum_fraction * expectedMatches(frame);
  if (result.statistics.matched >= options_.majority_fraction * expectedOfResult(frame))
    return false;
  std::vector<int> matches, accepted;
  for (int i = 0; i < frame.prior.size(); ++i) {
    matches.push_back(static_cast<int>(frame.search.matches(i).size()));
    if (result.match_of_feature[i] >= 0) accepted.push_back(i);
  }
  // Where the motion was measured, nothing is left that matches could agree on: by chance they lie
  // anywhere in the gates that there would be without.
  if (frame.unmeasured_px.cols() > 0) {
    const Eigen::MatrixXd S = frame.prior.S + frame.unmeasured_px * frame.unmeasured_px.transpose();
    return logFalseAlarms(S, matches, accepted) > options_.maximum_log_false_alarms;
  }
  return logFalseAlarms(frame.prior.S, matches, accepted) > options_.maximum_log_false_alarms;
}

std::vector<int> MatchCascade::gate(const FrameState& frame) const {
  const std::vector<int>& match_of_feature = frame.matching.match_of_feature;
  std::vector<int> matched;
  for (int i = 0; i < frame.prior.size(); ++i)
    if (match_of_feature[i] >= 0) matched.push_back(i);
  const int m = static_cast<int>(matched.size());
  Eigen::VectorXd innovation(2 * m);
  for (int a = 0; a < m; ++a) {
    const int i = matched[a];
    innovation.segment<2>(2 * a) =
        frame.search.matches(i)[match_of_feature[i]].pixel - frame.prior.mean(i);
  }
  std::vector<int> inliers;
  for (const int a : leaveOneOutInliers(innovation, selectFeatures(frame.prior.S, matched),
                                        options_.innovation_gate_chi2))
    inliers.push_back(matched[a]);
  return inliers;
}

}  // namespace active_matching_slam
