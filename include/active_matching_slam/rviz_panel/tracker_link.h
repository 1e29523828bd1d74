#pragma once

#include <dynamic_reconfigure/Config.h>
#include <dynamic_reconfigure/ConfigDescription.h>
#include <ros/callback_queue.h>
#include <ros/node_handle.h>
#include <ros/spinner.h>

#include <chrono>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "active_matching_slam/ros/messages.h"

namespace active_matching_slam {

/// All that is known of a tracker elsewhere, at one moment. Pointers are null until a message came.
struct TrackerReport {
  std::string tracker;              ///< its name, resolved; empty: none was set
  bool has_master = true;           ///< the ROS master answers
  bool is_asked_for = false;        ///< it is known whether the tracker is there
  bool is_there = false;            ///< it takes calls
  std::vector<std::string> others;  ///< the trackers that the master knows
  ams_msgs::TrackingStateConstPtr state;
  double silence_s = 0.0;  ///< since the last state
  ams_msgs::MatchingStatisticsConstPtr statistics;
  ams_msgs::SubmapHierarchyConstPtr submaps;
  dynamic_reconfigure::ConfigDescriptionConstPtr description;
  dynamic_reconfigure::ConfigConstPtr values;
  std::string pending;  ///< the call that has not been answered yet; empty: none
  double pending_s = 0.0;
  std::string answer;  ///< to the last call that was
  bool is_refused = false;
};

/// Listens to a tracker of any name and calls its services, from threads of its own: no function
/// waits for a tracker or for the master, which may be dead, stopped, or not there yet.
class TrackerLink {
 public:
  using Value = std::variant<bool, int, double, std::string>;

  TrackerLink();
  ~TrackerLink();

  /// Forgets the tracker of before, its unanswered calls too. The name is resolved, remapped as a
  /// topic's would be; an invalid one is as none.
  void setTracker(const std::string& name);
  /// The tracker works the structure of the map out for whoever listens.
  void setWantsSubmaps(bool wants);
  TrackerReport report() const;

  /// Calls; the answer stands in report().
  void reset();
  void saveMap(const std::string& file);
  void loadMap(const std::string& file);
  void setScale(double factor);
  void setParameter(const std::string& name, const Value& value);

 private:
  using Clock = std::chrono::steady_clock;
  struct Call {
    std::string what;
    std::function<void(const std::string& tracker)> run;
  };

  void watch();
  bool askMaster(std::vector<std::string>* trackers) const;
  void subscribe(const std::string& tracker, std::uint64_t generation);
  void subscribeSubmaps(const std::string& tracker, std::uint64_t generation, bool wants);
  void runCalls();
  void enqueue(Call call);
  void setAnswer(const std::string& text, bool is_refused);
  /// False when the connection broke, or was given up by setTracker() or the end.
  template <class Service>
  bool callService(const std::string& name, Service* service);
  template <class Service>
  void callAndTell(const std::string& what, const std::string& name, Service* service);

  mutable std::mutex mutex_;
  std::condition_variable changed_;
  TrackerReport report_;
  Clock::time_point last_state_, call_began_;
  std::uint64_t generation_ = 0;  ///< counts the trackers that were set
  bool wants_submaps_ = false;
  bool is_ending_ = false;
  std::deque<Call> calls_;
  ros::ServiceClient client_;  ///< of the call that runs

  ros::CallbackQueue queue_;
  ros::NodeHandle node_;
  ros::AsyncSpinner spinner_;
  std::vector<ros::Subscriber> subscribers_;
  ros::Subscriber submaps_subscriber_;
  std::thread watcher_, caller_;
};

/// The value of a parameter in a message of dynamic_reconfigure; none where it isn't there.
bool findValue(const dynamic_reconfigure::Config& config, const std::string& name,
               TrackerLink::Value* value);

}  // namespace active_matching_slam
