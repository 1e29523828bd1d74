#pragma once

#include <string>

#include "active_matching_slam/tracker/tracker_options.h"

namespace active_matching_slam {

/// One line of documentation for a setting.
struct OptionField {
  const char* name;         ///< path with slashes, as in the yaml file and on the parameter server
  const char* description;  ///< with its unit
  bool at_run_time;         ///< may change without losing the map
};

/// Calls `visit(field, value, minimum, maximum)` for each number (int, double, std::int64_t,
/// std::uint64_t), and `visit(field, value)` for each bool, std::string and UpdateRule. The single
/// description of all settings: yaml, parameters, run-time reconfiguration and the documented table
/// are made from it. The range is closed.
template <class Options, class Visitor>
void visitOptions(Options& o, Visitor&& visit) {
  using F = OptionField;
  visit(F{"matcher", "active_search, jcbb, one_point_ransac, active, fast_active, chow_liu or auto",
          true},
        o.matcher);
  visit(F{"learn_rates", "learn how often each feature is matched rightly and wrongly", true},
        o.learn_rates);
  visit(F{"fallback_matchers",
          "when far fewer match than should, match again by the motion of the whole image, jcbb, "
          "one_point_ransac",
          true},
        o.fallback_matchers);
  visit(F{"structure", "maintain the graph of mutual information and the submaps", true},
        o.structure);
  visit(
      F{"structure_acceleration_mps2",
        "what that expects of the camera: linear acceleration, standard deviation per axis [m/s^2]",
        true},
      o.structure_accelerations.linear_mps2, 0.0, 1e3);
  visit(F{"structure_angular_acceleration_rps2",
          "the same, angular; the less, the more near and far come apart [rad/s^2]", true},
        o.structure_accelerations.angular_rps2, 0.0, 1e3);
  visit(F{"known_points_search_px", "how far a known point may lie from its image_px [px]", false},
        o.known_points_search_px, 1.0, 200.0);
  visit(F{"known_points_sigma_m",
          "accuracy of the known points' positions, standard deviation per axis [m]", false},
        o.known_points_sigma_m, 1e-6, 1.0);
  visit(F{"max_frame_interval_s",
          "after a longer gap between stamps the whole image is searched for the map first [s]",
          true},
        o.max_frame_interval_s, 0.01, 3600.0);
  visit(
      F{"lost_after_frames", "frames with too few matches in a row until the camera is lost", true},
      o.lost_after_frames, 1, 10000);
  visit(F{"minimum_matches", "fewer matches in a frame are too few", true}, o.minimum_matches, 1,
        1000);
  visit(F{"reset_when_lost_after_s", "start anew when lost for so long [s]; 0: keep looking", true},
        o.reset_when_lost_after_s, 0.0, 1e6);

  visit(F{"filter/sigma_acceleration_mps2",
          "linear acceleration, standard deviation per axis [m/s^2]", true},
        o.filter.sigma_acceleration_mps2, 1e-3, 1e3);
  visit(F{"filter/sigma_angular_acceleration_rps2",
          "angular acceleration, standard deviation per axis [rad/s^2]", true},
        o.filter.sigma_angular_acceleration_rps2, 1e-3, 1e3);
  visit(F{"filter/sigma_px",
          "noise of a match before any is learnt, and where its template's fit does not converge, "
          "per axis [px]",
          true},
        o.filter.sigma_px, 0.05, 20.0);
  visit(F{"filter/minimum_sigma_px",
          "least noise that a match is taken to have, whatever residuals show [px]", true},
        o.filter.minimum_sigma_px, 0.01, 20.0);
  visit(F{"filter/noise_memory_s", "time within which the noise of matches may change [s]", true},
        o.filter.noise_memory_s, 1e-3, 1e3);
  visit(F{"filter/landmark_noise_px",
          "process noise of a landmark as the view of it turns, per axis and root of a radian [px]",
          true},
        o.filter.landmark_noise_px, 0.0, 20.0);
  visit(F{"filter/initial_sigma_velocity_mps", "at start, per axis [m/s]", true},
        o.filter.initial_sigma_velocity_mps, 1e-3, 100.0);
  visit(F{"filter/initial_sigma_angular_velocity_rps", "at start, per axis [rad/s]", true},
        o.filter.initial_sigma_angular_velocity_rps, 1e-3, 100.0);
  visit(F{"filter/initial_sigma_readout_s",
          "trust in a global shutter: of the time from first row to last [s]", true},
        o.filter.initial_sigma_readout_s, 0.0, 0.1);
  visit(F{"filter/initial_sigma_focal", "trust in the calibration: of the focal length, relative",
          true},
        o.filter.initial_sigma_focal, 0.0, 0.2);
  visit(F{"filter/initial_sigma_radial",
          "trust in the calibration: of radial distortion at 45 degrees, relative", true},
        o.filter.initial_sigma_radial, 0.0, 0.2);
  visit(F{"filter/initial_sigma_centre",
          "trust in the calibration: of the image centre, per axis, relative to the focal length",
          true},
        o.filter.initial_sigma_centre, 0.0, 0.2);
  visit(F{"filter/uncalibrated_factor",
          "of the three before this, where camera_info has no distortion; 1 for rectified images",
          true},
        o.filter.uncalibrated_factor, 1.0, 100.0);
  visit(F{"filter/initial_inverse_depth",
          "prior of a new feature; fixes the map unit when scale is "
          "free [1/m]",
          true},
        o.filter.initial_inverse_depth, 1e-3, 1e3);
  visit(F{"filter/initial_sigma_inverse_depth",
          "its standard deviation; half the mean puts infinity at 2 sigma [1/m]", true},
        o.filter.initial_sigma_inverse_depth, 1e-3, 1e3);
  visit(F{"filter/linearity_threshold", "an inverse-depth feature below becomes a point", true},
        o.filter.linearity_threshold, 0.0, 10.0);
  visit(F{"filter/minimum_inverse_depth", "the mean is kept above [1/m]", true},
        o.filter.minimum_inverse_depth, 1e-9, 1.0);
  visit(F{"filter/update_iterations", "Gauss-Newton steps of an update", true},
        o.filter.update_iterations, 1, 10);

  visit(F{"image/template_size_px", "side of the correlated template, odd [px]", false},
        o.image.template_size_px, 5, 31);
  visit(F{"image/source_patch_size_px", "side of the patch stored at first sight, odd [px]", false},
        o.image.source_patch_size_px, 7, 101);
  visit(F{"image/match_threshold", "least zero-mean normalised cross-correlation of a match", true},
        o.image.match_threshold, 0.1, 0.999);
  visit(F{"image/corner_quality", "least fraction of the strongest corner's response", true},
        o.image.corner_quality, 1e-6, 1.0);
  visit(F{"image/minimum_contrast", "least standard deviation of a template [grey levels]", true},
        o.image.minimum_contrast, 0.0, 128.0);
  visit(F{"image/border_px", "features are not searched closer to the image border [px]", true},
        o.image.border_px, 0, 200);
  visit(F{"image/working_width",
          "images of more pixels than one of 4:3 of this width are tracked reduced to as many [px]",
          false},
        o.image.working_width, 160, 10000);

  visit(F{"map/features_per_frame", "features measured in a frame", true}, o.map.features_per_frame,
        4, 1000);
  visit(F{"map/maximum_features", "the map never holds more", true}, o.map.maximum_features, 4,
        5000);
  visit(F{"map/minimum_distance_px",
          "between a new feature and every other in the image [px of an image of 640 x 480]", true},
        o.map.minimum_distance_px, 2.0, 500.0);
  visit(F{"map/maximum_view_angle_deg", "since first sight [deg]", true},
        o.map.maximum_view_angle_deg, 1.0, 89.0);
  visit(F{"map/minimum_scale", "least change of apparent size since first sight", true},
        o.map.minimum_scale, 0.05, 1.0);
  visit(F{"map/maximum_scale", "largest change of apparent size since first sight", true},
        o.map.maximum_scale, 1.0, 20.0);
  visit(F{"map/retire_after_attempts", "a feature searched this often may be retired", true},
        o.map.retire_after_attempts, 1, 100000);
  visit(F{"map/retire_success_ratio", "... when it was matched in less than this fraction", true},
        o.map.retire_success_ratio, 0.0, 1.0);

  visit(F{"matching/true_positive_rate", "probability of a match where a feature is (Ptp)", true},
        o.matching.default_rates.true_positive, 0.01, 0.9999);
  visit(F{"matching/false_positive_rate", "probability of a spurious match per pixel (Pfp)", true},
        o.matching.default_rates.false_positive, 1e-9, 0.1);
  visit(F{"matching/update_rule", "incremental (weights are probabilities) or thesis", true},
        o.matching.update_rule);
  visit(F{"matching/prune_weight", "Gaussians below this weight are dropped", true},
        o.matching.prune_weight, 0.0, 0.5);
  visit(F{"matching/joint_rescoring",
          "re-score all hypotheses by their joint evidence at the end, pruned ones too", true},
        o.matching.joint_rescoring);
  visit(F{"matching/deferred_pruning_weight",
          "a Gaussian that once had this weight is not pruned before it was searched itself; 0: it "
          "is",
          true},
        o.matching.deferred_pruning_weight, 0.0, 1.0);
  visit(F{"matching/k_best",
          "alternatives searched to completion when the accepted hypothesis has too many missed "
          "detections; needs joint_rescoring",
          true},
        o.matching.k_best, 0, 100);
  visit(F{"matching/max_gaussians", "cap on the mixture; 0: none", true}, o.matching.max_gaussians,
        0, 100000);
  visit(F{"matching/merge_sigmas",
          "Gaussians that differ in one match, and in their predictions by less than this, merge "
          "[sigma]; 0: never",
          true},
        o.matching.merge_sigmas, 0.0, 10.0);
  visit(F{"matching/merge_probability",
          "least probability, among merged matches, of one that is accepted", true},
        o.matching.merge_probability, 0.0, 1.0);
  visit(F{"matching/latch_information_bits",
          "below, no more mutual information is computed [bit]; "
          "0: never",
          true},
        o.matching.latch_information_bits, 0.0, 1e3);
  visit(F{"matching/ambiguous_below_weight",
          "a frame whose best hypothesis weighs less is ambiguous; 0: never", true},
        o.matching.ambiguous_below_weight, 0.0, 1.0);
  visit(F{"matching/fast_candidates", "fast_active: candidates evaluated in a step", true},
        o.matching.fast_candidates, 1, 100000);
  visit(
      F{"matching/fast_latch_bits", "fast_active: largest gain under which it latches [bit]", true},
      o.matching.fast_latch_bits, 0.0, 1e3);
  visit(F{"matching/fast_accept_weight", "fast_active: weight at which a Gaussian is taken", true},
        o.matching.fast_accept_weight, 0.0, 1.0);
  visit(F{"matching/seed", "of fast_active and one_point_ransac", true}, o.matching.seed,
        std::uint64_t{0}, std::uint64_t{1} << 62);
  visit(F{"matching/max_pixels", "distinct pixels searched in a frame; 0: no limit", true},
        o.matching.max_pixels, std::int64_t{0}, std::int64_t{1} << 40);
  visit(
      F{"matching/max_milliseconds",
        "time for matching a frame at 30 Hz, more in proportion at lower rates [ms]; 0: no "
        "limit. A node goes by the clock, track_bag by a model of the work, which repeats bit for "
        "bit",
        true},
      o.matching.max_milliseconds, 0.0, 1e6);
  visit(F{"matching/jcbb_max_nodes", "jcbb: nodes visited in a frame; 0: no limit", true},
        o.matching.jcbb_max_nodes, std::int64_t{0}, std::int64_t{1} << 40);
  visit(F{"matching/jcbb_confidence", "jcbb: chi-square level of joint compatibility", true},
        o.matching.jcbb_confidence, 0.5, 0.9999);
  visit(F{"matching/ransac_inlier_chi2", "one_point_ransac: low innovation, in units of the noise",
          true},
        o.matching.ransac_inlier_chi2, 0.1, 100.0);
  visit(
      F{"matching/ransac_rescue_chi2", "one_point_ransac: gate of a high-innovation inlier", true},
      o.matching.ransac_rescue_chi2, 0.1, 100.0);
  visit(F{"matching/ransac_max_hypotheses", "one_point_ransac: 0: every feature in turn", true},
        o.matching.ransac_max_hypotheses, 0, 100000);
}

std::string updateRuleName(UpdateRule rule);
/// Throws std::invalid_argument for a name other than incremental and thesis.
UpdateRule updateRuleFromName(const std::string& name);

}  // namespace active_matching_slam
