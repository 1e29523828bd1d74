#pragma once

#include <memory>
#include <optional>
#include <string>

#include "active_matching_slam/matching/match_options.h"
#include "active_matching_slam/matching/matcher.h"
#include "active_matching_slam/tracker/frame_state.h"
#include "active_matching_slam/tracker/match_cascade_options.h"

namespace active_matching_slam {

// clang-format off
/// Matches a frame: the chosen matcher, and where it finds far fewer matches than expected, other
/// ways to the same end. What is tried, from first to last, with the default options; m: matches so
/// far, e: expected; a result is poor with at most 0.6 e, 0.8 e where the matcher calls it ambiguous:
///
/// | stage            | steps in                              | its result counts                  |
/// |------------------|---------------------------------------|------------------------------------|
/// | chosen matcher   | always; guided if all gates are wide  | at first                           |
/// | the same, guided | result poor, was not guided           | from 1.25 m and 0.5 e on           |
/// | JCBB             | result poor, <= 2 poor frames before  | from m and 0.5 e on, NIS <= 0.5    |
/// | 1-point RANSAC   | the same, and at most 0.6 e matched   | from 1.25 m and 0.1 e on, NIS <= 1 |
/// | a-contrario test | less than 0.5 e matched in the end    | drops all: false alarms > 0.1      |
/// | innovation gate  | always                                | drops a match: chi-square > 13.8   |
///
/// Guided: by the prior given how the image as a whole moved since the reference image, for a camera
/// that was jerked. JCBB: where structure repeats in wide gates, sequential matchers can lose the
/// true hypothesis among many equals; it finds the longest one. RANSAC: a sequential matcher that
/// follows something that moves by itself first can end up with that and little else. A-contrario:
/// in a blurred image a few matches agree by chance; none lets the camera wait for the next image.
/// All between the first and the last only with the fallbacks and with at least 8 expected matches.
// clang-format on
class MatchCascade {
 public:
  /// `matcher` as for createMatcher(), which see.
  explicit MatchCascade(const std::string& matcher, const MatchCascadeOptions& options = {});

  /// Keeps the matcher if it is the same.
  void setOptions(const std::string& matcher, const MatchCascadeOptions& options);

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
