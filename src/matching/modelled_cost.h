#pragma once

namespace active_matching_slam {

// Modelled time of the parts of a matching [ms], on one core of about 3 GHz. What takes more than
// one part in a hundred of some frame has one. Cost: fitted to the measured times of some thousand
// matchings of recorded images by their counts (correlation 0.99).

/// Of a row of a searched ellipse, and of a match found in it, next to modelledSearch_ms().
constexpr double kEllipseRowMs = 3.5e-4, kMatchMs = 4.5e-3;
/// Of weighing one Gaussian by a feature's search, of each match, and of each run of pixels.
constexpr double kWeighingMs = 3e-4, kWeighingMatchMs = 2e-5, kRunMs = 3.3e-5;
/// Of a Gaussian's mass in a whole ellipse, and in one that is clipped.
constexpr double kMassMs = 1e-4, kClippedMassMs = 2.5e-3;
/// Of a child, for each feature whose prediction changes.
constexpr double kTouchedMs = 9e-5;
/// Of looking at a search that could be next, and of each term of its expected information.
constexpr double kLookMs = 3e-5, kTermMs = 6e-6;
/// Of a prediction from others in re-scoring, and per square of their number.
constexpr double kPredictionMs = 1.3e-4, kPredictionSquareMs = 1.7e-6;
/// Of a joint's mutual information, per cube of its features.
constexpr double kInformationCubeMs = 8e-7;
/// Of a pairing that JCBB tries, and of its feature's prediction for each that went before.
constexpr double kNodeMs = 1e-5, kConditionedMs = 2e-6;
/// Of a hypothesis of RANSAC, for each feature that votes.
constexpr double kVoteMs = 2e-5;

}  // namespace active_matching_slam
