#pragma once

#include <memory>
#include <optional>
#include <string>

#include "active_matching_slam/matching/match_options.h"
#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/tracker/frame_state.h"

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
};

/// Matches a frame: the chosen matcher, and where it finds far fewer matches than expected, other
/// ways to the same end. What is tried and when, from first to last:
///
/// | stage                   | steps in                            | its result counts |
/// |-------------------------|-------------------------------------|-------------------------------|
/// | chosen matcher          | always; by the guided prior if all  | at first | | | gates together
/// are wide             |                               | | the same in a search of | result poor,
/// prior not guided yet,  | >= 1.25 x the matches so far  | | its own, guided prior   | image
/// motion known                  | and half of the expected      | | JCBB                    |
/// result poor, at most 2 poor frames  | >= the matches so far and half| | | before this | of the
/// expected; NIS <= 0.5   | | 1-point RANSAC          | the same, at most 0.6 of the        |
/// >= 1.25 x the matches so far, | |                         | expected matched, JCBB didn't count
/// | 0.1 of the expected; NIS <= 1 | | a-contrario test        | less than half of the expected |
/// all matches dropped if the    | |                         | matched in the end | number of false
/// alarms > 0.1  | | innovation gate         | always                              | a match whose
/// leave-one-out   | |                         |                                     | chi-square
/// is > 13.8 is out   |
///
/// Guided prior: given how the image as a whole moved since the reference image, for a camera that
/// was jerked. JCBB: where structure repeats in wide gates, sequential matchers can lose the true
/// hypothesis among many equals; it finds the longest one. RANSAC: a sequential matcher that
/// follows something that moves by itself first can end up with that and little else. A-contrario:
/// in a blurred image a few matches agree by chance; none lets the camera wait for the next image.
/// All between the first and the last only with the fallbacks and with at least 8 expected matches.
class MatchCascade {
 public:
  /// `matcher` as for createMatcher(), which see.
  explicit MatchCascade(const std::string& matcher, const MatchCascadeOptions& options = {});

  /// Keeps the matcher if it is the same.
  void setMatcher(const std::string& matcher);

  /// Fills `frame`'s matching and inliers. `matching`: options of the matchers, with the budget of
  /// the whole cascade. `fallbacks` false: only the chosen matcher and the innovation gate.
  void match(const MatchOptions& matching, bool fallbacks, FrameState* frame);

 private:
  struct Fallback;

  void matchWithFallbacks(const MatchOptions& matching, FrameState* frame);
  bool retry(const MatchOptions& matching, const MeasurementPrior& prior, FrameState* frame) const;
  bool tryConsensusMatchers(const MatchOptions& matching, const MeasurementPrior& prior,
                            FrameState* frame) const;
  bool tryFallback(const Fallback& fallback, const MatchOptions& matching, FrameState* frame) const;
  MatchOptions withBudget(const MatchOptions& matching, double fraction,
                          const FrameState& frame) const;
  double expectedOfResult(const FrameState& frame) const;
  bool isPoor(const FrameState& frame) const;
  bool isFalseAlarm(const FrameState& frame) const;
  std::vector<int> gate(const FrameState& frame) const;

  MatchCascadeOptions options_;
  std::string matcher_name_;
  std::unique_ptr<Matcher> matcher_, jcbb_, ransac_;
};

}  // namespace active_matching_slam
