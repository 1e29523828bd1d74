#include "feature_choice.h"

#include <cstddef>

#include "active_matching_slam/filter/camera_information.h"
#include "active_matching_slam/information/greedy_information.h"
#include "active_matching_slam/matching/match_options.h"

namespace active_matching_slam {

FeatureChoice chooseFeatures(const Ekf& filter, const CameraModel& camera, const FeatureMap& map,
                             const FrameNoise& noise, const std::vector<VisibleFeature>& visible,
                             const FeatureChoiceOptions& options) {
  FeatureChoice choice;
  std::vector<FeatureId> ids;
  std::vector<double> sigmas_px;
  for (const VisibleFeature& feature : visible) {
    ids.push_back(feature.id);
    sigmas_px.push_back(noise.gateSigma_px(*map.find(feature.id)));
  }
  const auto measurements = measurementsOfCamera(filter, camera, ids, sigmas_px);
  std::vector<InformativeMeasurement> worth;
  std::vector<std::size_t> index_of;  // in `visible`, of each entry of `worth`
  choice.bits_of_visible.assign(visible.size(), 0.0);
  choice.state_bits_of_visible.assign(visible.size(), 0.0);
  for (std::size_t i = 0; i < visible.size(); ++i) {
    if (!measurements[i]) continue;
    const double probability = map.find(ids[i])->recent_rate;
    worth.push_back({measurements[i]->W, measurements[i]->own_bits, probability,
                     modelledSearch_ms(measurements[i]->gate_area_px2)});
    index_of.push_back(i);
    const double bits = informationBits(worth.back());
    choice.bits_of_visible[i] = probability * bits;
    choice.state_bits_of_visible[i] = probability * (bits + measurements[i]->own_bits);
  }
  const bool is_all = static_cast<int>(visible.size()) <= options.most;
  if (!options.by_information || (is_all && !(options.stop_bits > 0.0)) || worth.empty()) {
    choice.chosen = map.choose(visible, camera, options.most);
    return choice;
  }

  std::vector<char> is_chosen(visible.size(), 0);
  for (std::size_t i = 0; i < visible.size(); ++i) is_chosen[i] = map.find(ids[i])->known ? 1 : 0;
  const GreedyChoice most_informative =
      chooseByInformation(worth, {options.most, kFloorSearches, options.stop_bits});
  choice.bits_left = most_informative.bits_left;
  for (const int k : most_informative.order) is_chosen[index_of[static_cast<std::size_t>(k)]] = 1;
  for (std::size_t i = 0; i < visible.size(); ++i)
    if (is_chosen[i]) choice.chosen.push_back(visible[i]);
  return choice;
}

}  // namespace active_matching_slam
