#include <nlohmann/json.hpp>

#include "active_matching_slam/evaluation/run_summary.h"

namespace active_matching_slam {
namespace {

// Keys in the order below, where the library can (3.9); else by the alphabet.
#if NLOHMANN_JSON_VERSION_MAJOR > 3 || NLOHMANN_JSON_VERSION_MINOR >= 9
using Json = nlohmann::ordered_json;
#else
using Json = nlohmann::json;
#endif

Json orNull(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

}  // namespace

std::string summaryJson(const RunSummary& s) {
  Json json;
  json["frames"] = s.frames;
  json["frames_tracked"] = s.frames_tracked;
  json["times_lost"] = s.times_lost;
  json["resets"] = s.resets;
  json["maps"] = s.maps;
  json["main_map"] = s.main_map;
  json["frames_in_main_map"] = s.frames_in_main_map;
  json["quality"] = s.quality;
  json["image_fixed"] = s.image_fixed;
  json["quality_reason"] = s.quality_reason;
  json["late_images"] = s.late_images;
  json["untracked_reason"] = s.untracked_reason;
  json["duration_s"] = s.duration_s;
  json["matcher"] = s.matcher.empty() ? Json(nullptr) : Json(s.matcher);
  json["scale_source"] = scaleSourceName(s.scale_source);
  json["scale_sigma"] = s.scale_sigma > 0.0 ? Json(s.scale_sigma) : Json(nullptr);
  json["frames_with_motion"] = s.frames_with_motion;
  json["frames_slipped"] = s.frames_slipped;
  json["frames_without_motion"] = s.frames_without_motion;
  json["motion_fault"] = s.motion_fault;
  json["ate_sim3_m"] = orNull(s.ate_sim3_m);
  json["ate_se3_m"] = orNull(s.ate_se3_m);
  json["sim3_scale"] = orNull(s.sim3_scale);
  json["ate_final_sim3_m"] = orNull(s.ate_final_sim3_m);
  json["rpe_m"] = s.rpe ? Json(s.rpe->translation_rmse) : Json(nullptr);
  json["rpe_rad"] = s.rpe ? Json(s.rpe->rotation_rmse_rad) : Json(nullptr);
  json["nees_mean"] = orNull(s.nees_mean);
  json["nees_fraction_within_95"] = orNull(s.nees_fraction_within);
  json["truth_pairs"] = s.truth_pairs;
  json["displacement"] = s.excursion.displacement;
  json["excursion"] = s.excursion.excursion;
  json["path_length"] = s.excursion.path_length;
  json["matched_mean"] = s.matched_mean;
  json["candidates_mean"] = s.candidates_mean;
  json["pixels_searched"] = s.pixels_searched;
  json["pixels_full_gates"] = s.pixels_full_gates;
  json["pixels_ratio"] =
      s.pixels_searched > 0
          ? Json(static_cast<double>(s.pixels_full_gates) / static_cast<double>(s.pixels_searched))
          : Json(nullptr);
  json["max_gaussians"] = s.max_gaussians;
  json["cut_short_frames"] = s.cut_short_frames;
  json["ambiguous_frames"] = s.ambiguous_frames;
  json["map"] = {{"features_end", s.map_features_end},
                 {"features_most", s.map_features_most},
                 {"started", s.started},
                 {"retired", s.retired},
                 {"converted", s.converted}};
  json["submaps"] = {{"end", s.submaps_end},
                     {"frozen_features_end", s.frozen_features_end},
                     {"trunk_features_most", s.trunk_features_most},
                     {"lost_bits_end", s.lost_bits_end},
                     {"frozen", s.submaps_frozen},
                     {"found", s.submaps_found},
                     {"loops", s.loops}};
  json["ms"] = Json::object();
  for (const DurationSummary& duration : s.durations)
    json["ms"][duration.stage] = {{"median", duration.median_ms}, {"p99", duration.p99_ms}};
  return json.dump(2) + "\n";
}

}  // namespace active_matching_slam
