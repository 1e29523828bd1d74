#pragma once

#include <cstdint>
#include <functional>
#include <string>

#include "active_matching_slam/matching/measurement_prior.h"
#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// How a mixture is re-weighted after a search.
enum class UpdateRule {
  kIncremental,  ///< every pixel counted once; weights are probabilities
  kThesis        ///< Chli 2009, eq. 5.10
};

std::string updateRuleName(UpdateRule rule);
/// Throws std::invalid_argument for a name other than incremental and thesis.
UpdateRule updateRuleFromName(const std::string& name);

/// Settings of the matchers. Each states which matchers read it.
struct MatchOptions {
  FeatureRates default_rates;  ///< mixture matchers: for a prior without rates

  // Mixture of Gaussians: active, fast_active, chow_liu.
  UpdateRule update_rule = UpdateRule::kIncremental;
  double prune_weight = 0.001;  ///< Gaussians below are dropped, [0, 1)
  /// Rule incremental: at the end all hypotheses, and some of the pruned ones, are re-scored by the
  /// joint evidence of all matches, and the most probable one is accepted; else the heaviest
  /// Gaussian is.
  bool joint_rescoring = true;
  /// Deferred pruning: a Gaussian that once reached this weight is not pruned before it has been
  /// searched itself (confirmed or refuted by its own measurements); once its weight has fallen to
  /// a fifth of its maximum that search is done next; 0: never.
  double deferred_pruning_weight = 0.01;
  /// With joint_rescoring: when the accepted hypothesis has more missed detections than the
  /// features' rates explain, as many of its strongest alternatives are searched to completion too
  /// and re-scored with it.
  int k_best = 2;
  int max_gaussians = 0;  ///< cap on the live mixture; the lightest go first; 0: no cap
  /// Siblings, Gaussians born of one search, are merged where their predictions of every other
  /// feature differ by less than this many sigma; 0: never. The better one stays, with the weight
  /// of both.
  double merge_sigmas = 0.0;
  /// Of merged matches the better one is accepted only if its probability among them, by position
  /// and similarity, is at least this; else the feature is left unmatched.
  double merge_probability = 0.9;
  double latch_information_bits = 0.0;  ///< stop rule (a): below, no more MI is computed; 0: never
  /// Stop rule of the reference traces (golden vectors, am_finish): done when the heaviest Gaussian
  /// weighs at least this and has no feature left to search; 0: never.
  double finish_weight = 0.0;
  double ambiguous_below_weight = 0.0;  ///< a result of less weight is marked ambiguous; 0: never
  int fast_candidates = 15;             ///< fast_active: candidates evaluated a step
  double fast_latch_bits = 0.5;         ///< fast_active: largest MI under which it latches
  double fast_accept_weight = 0.7;  ///< fast_active: weight at which a Gaussian is taken after that
  std::uint64_t seed = 1;           ///< fast_active, one_point_ransac

  /// Features that would tell less than this of the state, given those that are searched, are not
  /// searched; 0: all are. With MapOptions::choose_by_information.
  double stop_bits = 0.0;

  // Budget of a frame, which ends with the search that uses it up.
  std::int64_t max_pixels = 0;    ///< pixels correlated; 0: no limit
  double max_milliseconds = 0.0;  ///< 0: no limit
  /// The budget's milliseconds come from a model of the work done and not from the clock: the same
  /// result on every machine, every time.
  bool modelled_time = false;
  /// Monotonic clock of the budget, unless that is modelled, and of the reported durations, in
  /// seconds; empty: steady_clock.
  std::function<double()> clock_s;

  // jcbb
  std::int64_t jcbb_max_nodes = 100000;  ///< 0: no limit
  double jcbb_confidence = 0.95;         ///< chi-square level of joint compatibility

  // one_point_ransac
  double ransac_inlier_chi2 = 5.9915;  ///< low innovation: |residual|^2 < chi2 * R
  double ransac_rescue_chi2 = 9.2103;  ///< high innovation: gate of the conditional
  int ransac_max_hypotheses = 0;       ///< 0: every feature in turn (exhaustive, deterministic)

  bool keep_trace = false;  ///< record every step in MatchResult::trace

  /// Of those that users set.
  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void MatchOptions::visitFields(Self& o, Visitor&& visit) {
  visit(basicOption("matching/max_milliseconds", "ms",
                    "time for matching a frame at 30 Hz, more in proportion at lower rates; 0: no "
                    "limit. A node goes by the clock, track_bag by a model of the work, which "
                    "repeats bit for bit"),
        o.max_milliseconds, 0.0, 1e6);
  visit(
      basicOption("matching/max_pixels", "px", "distinct pixels searched in a frame; 0: no limit"),
      o.max_pixels, std::int64_t{0}, std::int64_t{1} << 40);
  visit(basicOption("matching/stop_bits", "bit",
                    "a frame is measured no further when the next feature would tell less than "
                    "this; 0: all are searched. Needs map/choose_by_information"),
        o.stop_bits, 0.0, 100.0);
  visit(advancedOption("matching/true_positive_rate", "",
                       "probability of a match where a feature is (Ptp)"),
        o.default_rates.true_positive, 0.01, 0.9999);
  visit(advancedOption("matching/false_positive_rate", "",
                       "probability of a spurious match per pixel (Pfp)"),
        o.default_rates.false_positive, 1e-9, 0.1);
  visit(advancedOption("matching/update_rule", "",
                       "incremental (weights are probabilities) or thesis"),
        o.update_rule);
  visit(advancedOption("matching/prune_weight", "",
                       "hypotheses (Gaussians) that are less probable are dropped"),
        o.prune_weight, 0.0, 0.5);
  visit(advancedOption("matching/joint_rescoring", "",
                       "at the end re-score all hypotheses by the joint evidence of their matches, "
                       "dropped ones too"),
        o.joint_rescoring);
  visit(advancedOption("matching/deferred_pruning_weight", "",
                       "a hypothesis that was once so probable is not dropped before it was "
                       "searched itself; 0: it is"),
        o.deferred_pruning_weight, 0.0, 1.0);
  visit(advancedOption("matching/k_best", "",
                       "alternatives searched to completion when the accepted hypothesis has too "
                       "many missed detections; needs joint_rescoring"),
        o.k_best, 0, 100);
  visit(advancedOption("matching/max_gaussians", "", "hypotheses kept at most; 0: no cap"),
        o.max_gaussians, 0, 100000);
  visit(advancedOption("matching/merge_sigmas", "sigma",
                       "hypotheses that differ in one match, and in their predictions by less than "
                       "this, merge; 0: never"),
        o.merge_sigmas, 0.0, 10.0);
  visit(advancedOption("matching/merge_probability", "",
                       "a match that such a merge has chosen between is accepted from this "
                       "probability on"),
        o.merge_probability, 0.0, 1.0);
  visit(advancedOption("matching/latch_information_bits", "bit",
                       "when no search promises more, what is left is searched without asking "
                       "again; 0: never"),
        o.latch_information_bits, 0.0, 1e3);
  visit(advancedOption("matching/ambiguous_below_weight", "",
                       "a frame whose best hypothesis is less probable is ambiguous; 0: never"),
        o.ambiguous_below_weight, 0.0, 1.0);
  visit(
      advancedOption("matching/fast_candidates", "", "fast_active: candidates evaluated in a step"),
      o.fast_candidates, 1, 100000);
  visit(advancedOption("matching/fast_latch_bits", "bit",
                       "fast_active: largest gain under which it latches"),
        o.fast_latch_bits, 0.0, 1e3);
  visit(advancedOption("matching/fast_accept_weight", "",
                       "fast_active: probability at which a hypothesis is taken"),
        o.fast_accept_weight, 0.0, 1.0);
  visit(advancedOption("matching/seed", "", "of fast_active and one_point_ransac"), o.seed,
        std::uint64_t{0}, std::uint64_t{1} << 62);
  visit(
      advancedOption("matching/jcbb_max_nodes", "", "jcbb: nodes visited in a frame; 0: no limit"),
      o.jcbb_max_nodes, std::int64_t{0}, std::int64_t{1} << 40);
  visit(advancedOption("matching/jcbb_confidence", "",
                       "jcbb: chi-square level of joint compatibility"),
        o.jcbb_confidence, 0.5, 0.9999);
  visit(advancedOption("matching/ransac_inlier_chi2", "",
                       "one_point_ransac: squared residual of a low-innovation inlier, in units of "
                       "the noise"),
        o.ransac_inlier_chi2, 0.1, 100.0);
  visit(advancedOption("matching/ransac_rescue_chi2", "",
                       "one_point_ransac: gate of a high-innovation inlier"),
        o.ransac_rescue_chi2, 0.1, 100.0);
  visit(advancedOption("matching/ransac_max_hypotheses", "",
                       "one_point_ransac: features that motions are drawn from; 0: each in turn"),
        o.ransac_max_hypotheses, 0, 100000);
}

/// Modelled time [ms] of a search in which a template is correlated at so many pixels, on one core
/// of about 3 GHz.
double modelledSearch_ms(double pixels);

/// Searches that a frame gets in any case. Derivation: of 13 features that match with probability
/// 0.8, at least 8 do in 97 % of frames; a pose takes 3.
constexpr int kFloorSearches = 13;

/// Fraction of the frame's tightest budget that this cost uses up; 0 without a budget.
double fractionOfBudget(const MatchOptions& options, std::int64_t pixels, double milliseconds);

}  // namespace active_matching_slam
