#pragma once

#include <cstddef>

#include "active_matching_slam/math/option_field.h"

namespace active_matching_slam {

/// Settings of the Initialiser. Angles are of rays, so that none depends on the image's size;
/// sigmas are FilterOptions::sigma_px.
struct InitialiserOptions {
  /// Parallax from which motion candidates are tested [sigma]. Cost: below, none could win.
  double first_parallax_sigmas = 0.3;
  /// (!) Parallax with which the initialisation ends [deg]: from it on depths are known to a few
  /// per cent and the filter's linearisation holds (Civera et al. 2008, section III.C).
  double last_parallax_deg = 2.0;
  /// Parallax or number of images, relative to those of the adjustment before, that is worth
  /// another. Cost: 2^(1/2) halves the variance from one to the next.
  double growth = 1.4;
  /// Rotation or parallax between keyframes, of three quarters of the points [deg]; doubled
  /// whenever there are too many.
  double keyframe_motion_deg = 0.1;
  std::size_t maximum_keyframes = 28;   ///< Cost: of memory, and of an adjustment by the cube
  std::size_t candidate_keyframes = 8;  ///< Cost: of those by which candidates are tested
  std::size_t minimum_keyframes = 4;  ///< two give no check of the motion, the last two a velocity
  /// Points that two keyframes share at least: five determine a motion, and as many again that
  /// they may be checked.
  std::size_t minimum_points = 10;
  int minimum_sightings = 3;  ///< of a feature: two determine its depth, the third checks it
  /// (!) Wald's sequential test: log odds with which one motion candidate is accepted; e^5 errs
  /// once in 150.
  double log_odds = 5.0;
  /// (!) Variance inflation of image points' errors, which are correlated from image to image: of
  /// the log-likelihood ratio and of the covariance. (1 + r) / (1 - r) for an autocorrelation r of
  /// 0.45 from one keyframe to the next (first-order autoregression). Measured on rendered films
  /// against the truth r is 0.5, and 0.2 beside what is adjusted for each feature.
  double correlation_inflation = 2.6;
  /// Cost by image point over that expected, by the noise assumed, beyond which no candidate fits:
  /// things move, or matches lie.
  double maximum_reduced_chi2 = 2.0;
  /// Matches of the second image, of the first one's points that were looked for in it, below which
  /// the first has nothing to do with it; of points looked for, below which that is not known.
  double unrelated_fraction = 0.5;
  /// Cost: Levenberg-Marquardt iterations an image, times keyframes, and images that one adjustment
  /// may take.
  int keyframe_iterations = 80, images_per_adjustment = 3;

  /// Of those that users set.
  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit);
};

template <class Self, class Visitor>
void InitialiserOptions::visitFields(Self& o, Visitor&& visit) {
  visit(advancedOption("initialisation/last_parallax_deg", "deg",
                       "how far the camera must have moved, as an angle seen from the scene, until "
                       "the map is adjusted no more as a whole; from the next start on"),
        o.last_parallax_deg, 0.5, 20.0);
  visit(advancedOption("initialisation/log_odds", "nat",
                       "how sure it must be which motion of the camera explains the first images: "
                       "log odds against every other; from the next start on"),
        o.log_odds, 1.0, 50.0);
  visit(advancedOption("initialisation/correlation_inflation", "",
                       "how much larger variances are, as errors of a point in the image persist "
                       "from one to the next; 1: they are independent; from the next start on"),
        o.correlation_inflation, 1.0, 100.0);
}

}  // namespace active_matching_slam
