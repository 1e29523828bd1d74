#pragma once

#include <memory>
#include <string>

#include "active_matching_slam/tracker/motion_history.h"
#include "bag_image_source.h"

namespace active_matching_slam {

/// frame_id of the first image on a topic; empty when it has none.
std::string readBagImageFrame(const Bags& bags, const std::string& image_topic);

/// All that a bag has on `topic` of what `options` ask for, and the camera's place on the robot by
/// its /tf_static (or /tf, as it is first). Null when they ask for nothing. Throws
/// std::runtime_error that names the topic, or the frames that nothing connects.
std::shared_ptr<const MotionHistory> readBagMotion(const Bags& bags, const std::string& topic,
                                                   const std::string& camera_frame,
                                                   const MotionOptions& options);

}  // namespace active_matching_slam
