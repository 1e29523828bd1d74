#pragma once

#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/map/feature_map.h"
#include "frame_noise.h"

namespace active_matching_slam {

struct FeatureChoiceOptions {
  int most = 0;                ///< features that are measured
  bool by_information = true;  ///< false: spread over the image
  double stop_bits = 0.0;      ///< MatchOptions::stop_bits
};

struct FeatureChoice {
  std::vector<VisibleFeature> chosen;  ///< ascending id
  /// Of each visible feature, what its search should tell of the camera by itself.
  std::vector<double> bits_of_visible;
  std::vector<double> state_bits_of_visible;  ///< ... and of the whole state
  double bits_left = 0.0;  ///< what the best one that was left would tell, given the chosen
};

/// Which of the visible features are measured in a frame: those that tell most of the state (camera
/// and features; Chli 2009, eq. 4.28) for the time that their searches take, one by one given those
/// before (chooseByInformation()), until the next would tell too little. Known features always come
/// along.
FeatureChoice chooseFeatures(const Ekf& filter, const CameraModel& camera, const FeatureMap& map,
                             const FrameNoise& noise, const std::vector<VisibleFeature>& visible,
                             const FeatureChoiceOptions& options);

}  // namespace active_matching_slam
