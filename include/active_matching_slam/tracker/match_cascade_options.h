#pragma once

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// When a fallback is tried and when its result counts. `expected`: the sum of the features' match
/// probabilities.
struct MatchCascadeOptions {
  /// A result with at most this fraction of the expected matches is poor. Cost: a higher one tries
  /// fallbacks more often, in vain mostly, since their results must be better to count.
  double poor_fraction = 0.6;
  double poor_fraction_ambiguous = 0.8;  ///< the same where the matcher calls its result ambiguous
  /// Derivation: two disjoint consensus sets can't both have more than half.
  double majority_fraction = 0.5;
  /// Expected matches below which nothing is tried: a fraction of so few is mostly rounding.
  double minimum_expected = 8.0;
  /// Ratio to the matches so far that the guided retry and RANSAC must reach: with about as many,
  /// either may be the wrong one.
  double replacing_ratio = 1.25;
  /// Fraction of the expected matches below which RANSAC's consensus, and any result while depths
  /// are vague, is taken for chance.
  double minimum_fraction = 0.1;
  /// Normalised joint innovation (Mahalanobis distance squared over its degrees of freedom) up to
  /// which RANSAC's set counts. Derivation: its expectation for the true set is 1.
  double ransac_nis = 1.0;
  /// The same of JCBB, which takes what its gate (1.2 to 1.5) lets pass: chance fills the gate, and
  /// true sets stay below 1, since the predicted noise is the upper bound of the matches' noise.
  double jcbb_nis = 0.5;
  /// JCBB and RANSAC step in after at most so many poor frames in a row: the gates grow with each,
  /// until chance alone makes a consensus.
  int maximum_poor_frames = 2;
  /// A result that was cut short answers only for the features searched, unless those met more than
  /// so many matches each: then it has chosen among candidates without the others' evidence.
  double crowded_matches = 1.5;
  /// Fractions of the budget, of what is left of it for all but the first. Cost: what one attempt
  /// has the next has not.
  double first_budget_fraction = 0.6, fallback_budget_fraction = 0.5;
  /// Area of all 3-sigma gates together from which on the image's motion guides the first attempt
  /// already [px^2 of an image 640 wide]. Cost: whether an attempt without it comes first.
  double wide_gates_px2 = 2e5;
  /// Largest decimal logarithm of the number of false alarms. Standard: epsilon-meaningful with
  /// epsilon = 0.1, one accident in ten frames at most (Desolneux, Moisan & Morel 2000).
  double maximum_log_false_alarms = -1.0;
  /// Standard: chi-square, 99.9 % of 2 degrees of freedom.
  double innovation_gate_chi2 = 13.8;
  /// Rate that MatchOptions::max_milliseconds is meant for [Hz]: a longer interval between frames
  /// leaves more time, in proportion.
  double budget_rate_hz = 30.0;

  /// Of those that users set.
  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void MatchCascadeOptions::visitFields(Self& o, Visitor&& visit) {
  visit(advancedOption("cascade/poor_fraction", "",
                       "fallback_matchers are tried when at most this fraction of the expected "
                       "matches is found"),
        o.poor_fraction, 0.0, 1.0);
  visit(
      advancedOption("cascade/maximum_poor_frames", "",
                     "jcbb and one_point_ransac are tried in at most so many such frames in a row"),
      o.maximum_poor_frames, 0, 1000);
  visit(advancedOption("cascade/maximum_log_false_alarms", "",
                       "few matches are dropped when chance makes as many in more than 10^this of "
                       "images"),
        o.maximum_log_false_alarms, -100.0, 10.0);
  visit(advancedOption("cascade/innovation_gate_chi2", "",
                       "a match is dropped when its squared distance from what all others predict, "
                       "in units of its variance, is larger"),
        o.innovation_gate_chi2, 4.0, 1e3);
}

}  // namespace active_matching_slam
