#pragma once

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/ConfigDescription.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/ros.h>

#include <functional>
#include <string>
#include <vector>

#include "active_matching_slam/ros/bound_options.h"

namespace active_matching_slam {

/// The dynamic_reconfigure protocol (as rqt_reconfigure and dynparam speak it) for the settings
/// that may change at run time, described by the option fields alone; advanced ones are a group of
/// their own.
///
/// Publishes ~parameter_descriptions and ~parameter_updates (latched); serves ~set_parameters.
class ReconfigureServer {
 public:
  struct Change {
    std::string name;
    OptionValue value;
  };
  /// Applies changes already clipped to their ranges; returns an error, empty when all went well.
  /// Called from the thread that serves callbacks; must leave the options bound by `options`
  /// changed.
  using Apply = std::function<std::string(const std::vector<Change>&)>;
  /// The present settings; the result is read at once.
  using Current = std::function<std::vector<BoundOption>()>;

  ReconfigureServer(const ros::NodeHandle& private_node, Current current, Apply apply);

  /// Publishes the present values; call after a change that came by another way.
  void publishUpdate();

 private:
  bool setParameters(dynamic_reconfigure::Reconfigure::Request& request,
                     dynamic_reconfigure::Reconfigure::Response& response);

  ros::NodeHandle node_;
  Current current_;
  Apply apply_;
  ros::Publisher descriptions_, updates_;
  ros::ServiceServer service_;
};

/// Values, lower and upper ends of the settings that may change at run time, as messages.
dynamic_reconfigure::Config toConfigMsg(const std::vector<BoundOption>& options);
dynamic_reconfigure::ConfigDescription toConfigDescriptionMsg(
    const std::vector<BoundOption>& options);

}  // namespace active_matching_slam
