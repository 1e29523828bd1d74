#pragma once

#include <vector>

#include "active_matching_slam/initialisation/bundle_adjustment.h"

namespace active_matching_slam {

/// Starting points for adjusting a bundle of which only the image points are known. With little
/// parallax its cost has several minima, and an adjustment finds the nearest.
///
/// For each direction of the last camera's translation the small rotation that goes with it
/// minimises the epipolar errors, without depths (Heeger and Jepson 1992). The few deepest minima
/// over the sphere of directions are candidates, the lowest first, with the cameras on a line and
/// depths by the image motion; and the depth reversal of each (makeBasReliefCounterpart()).
/// `rotation_only`: all cameras at the origin, with the rotations that fit best.
std::vector<Bundle> motionCandidates(const CameraModel& model, const BundleOptions& options,
                                     const Bundle& rotation_only);

/// The bas-relief counterpart, which a narrow view or little parallax can hardly tell from the
/// first (Belhumeur et al. 1999): inverse depths mirrored at their mean, the path reversed, rotated
/// to fit.
void makeBasReliefCounterpart(const CameraModel& model, Bundle* bundle);

/// Whether two adjusted candidates have come to the same minimum.
bool isSameMotion(const Bundle& a, const Bundle& b);

}  // namespace active_matching_slam
