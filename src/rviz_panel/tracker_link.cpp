#include "active_matching_slam/rviz_panel/tracker_link.h"

#include <dynamic_reconfigure/Reconfigure.h>
#include <ros/master.h>
#include <ros/names.h>
#include <ros/service.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <sstream>

namespace active_matching_slam {
namespace {

/// How often it is asked whether the tracker is there. Cost: a call to the master and a connection
/// each time.
constexpr std::chrono::milliseconds kWatchPeriod(500);

std::string valueText(const TrackerLink::Value& value) {
  std::ostringstream text;
  text << std::boolalpha;
  std::visit([&](const auto& v) { text << v; }, value);
  return text.str();
}

template <class List>
bool findIn(const List& list, const std::string& name, TrackerLink::Value* value) {
  for (const auto& entry : list) {
    if (entry.name != name) continue;
    *value = entry.value;
    return true;
  }
  return false;
}

}  // namespace

bool findValue(const dynamic_reconfigure::Config& config, const std::string& name,
               TrackerLink::Value* value) {
  for (const auto& entry : config.bools) {
    if (entry.name != name) continue;
    *value = static_cast<bool>(entry.value);
    return true;
  }
  return findIn(config.ints, name, value) || findIn(config.doubles, name, value) ||
         findIn(config.strs, name, value);
}

TrackerLink::TrackerLink() : spinner_(1, &queue_) {
  node_.setCallbackQueue(&queue_);
  spinner_.start();
  watcher_ = std::thread([this] { watch(); });
  caller_ = std::thread([this] { runCalls(); });
}

TrackerLink::~TrackerLink() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_ending_ = true;
    client_.shutdown();  // whoever waits for an answer gets none
  }
  changed_.notify_all();
  watcher_.join();
  caller_.join();
  spinner_.stop();
}

void TrackerLink::setTracker(const std::string& name) {
  std::string resolved, error;
  if (!name.empty() && ros::names::validate(name, error)) resolved = ros::names::resolve(name);
  const std::lock_guard<std::mutex> lock(mutex_);
  if (generation_ > 0 && resolved == report_.tracker) return;
  ++generation_;
  TrackerReport fresh;
  fresh.tracker = resolved;
  fresh.others = report_.others;
  fresh.has_master = report_.has_master;
  report_ = fresh;
  calls_.clear();
  client_.shutdown();
  changed_.notify_all();
}

void TrackerLink::setWantsSubmaps(bool wants) {
  const std::lock_guard<std::mutex> lock(mutex_);
  wants_submaps_ = wants;
  if (!wants) report_.submaps.reset();
  changed_.notify_all();
}

TrackerReport TrackerLink::report() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  TrackerReport report = report_;
  const auto now = Clock::now();
  report.silence_s = std::chrono::duration<double>(now - last_state_).count();
  report.pending_s = std::chrono::duration<double>(now - call_began_).count();
  return report;
}

/// The watcher's thread: the only one that subscribes, as that asks the master.
void TrackerLink::watch() {
  std::uint64_t subscribed = 0;
  bool listens = false;
  std::unique_lock<std::mutex> lock(mutex_);
  while (!is_ending_) {
    const std::uint64_t generation = generation_;
    const std::string tracker = report_.tracker;
    const bool wants = wants_submaps_;
    lock.unlock();
    std::vector<std::string> others;
    const bool has_master = askMaster(&others);
    bool is_there = false;
    if (has_master && subscribed != generation) {
      subscribe(tracker, generation);
      submaps_subscriber_.shutdown();
      subscribed = generation;
      listens = false;
    }
    if (has_master && !tracker.empty()) {
      if (listens != wants) subscribeSubmaps(tracker, generation, wants);
      listens = wants;
      is_there = ros::service::exists(tracker + "/reset", false);
    }
    lock.lock();
    report_.has_master = has_master;
    report_.others = others;
    if (generation != generation_ || wants != wants_submaps_) continue;
    report_.is_there = is_there;
    report_.is_asked_for = true;
    changed_.wait_for(lock, kWatchPeriod, [&] {
      return is_ending_ || generation != generation_ || wants != wants_submaps_;
    });
  }
  lock.unlock();
  subscribers_.clear();
  submaps_subscriber_.shutdown();
}

/// Who publishes a TrackingState. False where there is no answer: nothing waits for a master here.
bool TrackerLink::askMaster(std::vector<std::string>* trackers) const {
  XmlRpc::XmlRpcValue request, response, topics;
  request[0] = ros::this_node::getName();
  request[1] = std::string();
  if (!ros::master::execute("getPublishedTopics", request, response, topics, false)) return false;
  const std::string ending = "/state";
  for (int i = 0; i < topics.size(); ++i) {
    const std::string topic = topics[i][0];
    const std::string type = topics[i][1];
    if (type != ros::message_traits::datatype<ams_msgs::TrackingState>()) continue;
    if (topic.size() <= ending.size()) continue;
    trackers->push_back(topic.substr(0, topic.size() - ending.size()));
  }
  std::sort(trackers->begin(), trackers->end());
  return true;
}

void TrackerLink::subscribe(const std::string& tracker, std::uint64_t generation) {
  subscribers_.clear();
  if (tracker.empty()) return;
  // Messages on their way when another tracker is chosen are no news of that one.
  const auto listen = [&](const std::string& topic, auto member) {
    using Pointer = std::decay_t<decltype(std::declval<TrackerReport&>().*member)>;
    using Message = std::remove_const_t<typename Pointer::element_type>;
    subscribers_.push_back(node_.subscribe<Message>(
        tracker + topic, 1,
        boost::function<void(const Pointer&)>([this, generation, member](const Pointer& message) {
          const std::lock_guard<std::mutex> lock(mutex_);
          if (generation != generation_) return;
          report_.*member = message;
          if constexpr (std::is_same_v<Message, ams_msgs::TrackingState>)
            last_state_ = Clock::now();
        })));
  };
  listen("/state", &TrackerReport::state);
  listen("/statistics", &TrackerReport::statistics);
  listen("/parameter_descriptions", &TrackerReport::description);
  listen("/parameter_updates", &TrackerReport::values);
}

void TrackerLink::subscribeSubmaps(const std::string& tracker, std::uint64_t generation,
                                   bool wants) {
  submaps_subscriber_.shutdown();
  if (!wants) return;
  submaps_subscriber_ = node_.subscribe<ams_msgs::SubmapHierarchy>(
      tracker + "/submaps", 1,
      boost::function<void(const ams_msgs::SubmapHierarchyConstPtr&)>(
          [this, generation](const ams_msgs::SubmapHierarchyConstPtr& message) {
            const std::lock_guard<std::mutex> lock(mutex_);
            if (generation == generation_ && wants_submaps_) report_.submaps = message;
          }));
}

void TrackerLink::enqueue(Call call) {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (report_.tracker.empty()) return;
  calls_.push_back(std::move(call));
  changed_.notify_all();
}

/// The caller's thread: one call after another.
void TrackerLink::runCalls() {
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return is_ending_ || !calls_.empty(); });
    if (is_ending_) return;
    const Call call = calls_.front();
    calls_.pop_front();
    const std::uint64_t generation = generation_;
    const std::string tracker = report_.tracker;
    report_.pending = call.what;
    call_began_ = Clock::now();
    lock.unlock();
    call.run(tracker);
    lock.lock();
    if (generation == generation_) report_.pending.clear();
  }
}

void TrackerLink::setAnswer(const std::string& text, bool is_refused) {
  const std::lock_guard<std::mutex> lock(mutex_);
  report_.answer = text;
  report_.is_refused = is_refused;
}

template <class Service>
bool TrackerLink::callService(const std::string& name, Service* service) {
  // A persistent client's wait ends when it is shut down, in another thread.
  ros::ServiceClient client = node_.serviceClient<Service>(name, true);
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (is_ending_ || name.rfind(report_.tracker + "/", 0) != 0) return false;
    client_ = client;
  }
  return client.call(*service);
}

template <class Service>
void TrackerLink::callAndTell(const std::string& what, const std::string& name, Service* service) {
  if (!callService(name, service)) {
    const std::lock_guard<std::mutex> lock(mutex_);
    if (name.rfind(report_.tracker + "/", 0) != 0) return;  // of the tracker before
    report_.answer = what + ": " + name + " did not answer";
    report_.is_refused = true;
    return;
  }
  const auto& response = service->response;
  setAnswer(what + (response.success ? ": " : " refused: ") + response.message, !response.success);
}

void TrackerLink::reset() {
  enqueue({"reset", [this](const std::string& tracker) {
             std_srvs::Trigger service;
             callAndTell("reset", tracker + "/reset", &service);
           }});
}

void TrackerLink::saveMap(const std::string& file) {
  enqueue({"save map", [this, file](const std::string& tracker) {
             ams_msgs::SaveMap service;
             service.request.name = file;
             callAndTell("save map", tracker + "/save_map", &service);
           }});
}

void TrackerLink::loadMap(const std::string& file) {
  enqueue({"load map", [this, file](const std::string& tracker) {
             ams_msgs::LoadMap service;
             service.request.name = file;
             callAndTell("load map", tracker + "/load_map", &service);
           }});
}

void TrackerLink::setScale(double factor) {
  enqueue({"set scale", [this, factor](const std::string& tracker) {
             ams_msgs::SetScale service;
             service.request.factor = factor;
             callAndTell("set scale", tracker + "/set_scale", &service);
           }});
}

void TrackerLink::setParameter(const std::string& name, const Value& value) {
  enqueue({name, [this, name, value](const std::string& tracker) {
             dynamic_reconfigure::Reconfigure service;
             const auto add = [&](auto* list, const auto& v) {
               auto& entry = list->emplace_back();
               entry.name = name;
               entry.value = v;
             };
             dynamic_reconfigure::Config& config = service.request.config;
             if (const auto* b = std::get_if<bool>(&value)) add(&config.bools, *b);
             if (const auto* i = std::get_if<int>(&value)) add(&config.ints, *i);
             if (const auto* d = std::get_if<double>(&value)) add(&config.doubles, *d);
             if (const auto* s = std::get_if<std::string>(&value)) add(&config.strs, *s);
             if (!callService(tracker + "/set_parameters", &service)) {
               setAnswer(name + ": " + tracker + "/set_parameters did not answer", true);
               return;
             }
             Value now;
             const bool is_known = findValue(service.response.config, name, &now);
             const bool is_taken = is_known && now == value;
             setAnswer(!is_known  ? name + " is no parameter of " + tracker
                       : is_taken ? name + " is " + valueText(now)
                                  : name + " stays " + valueText(now) + ": " + valueText(value) +
                                        " was refused (see the tracker's log)",
                       !is_taken);
             // Widgets that ask for what was refused go back.
             const std::lock_guard<std::mutex> lock(mutex_);
             if (tracker == report_.tracker)
               report_.values =
                   boost::make_shared<const dynamic_reconfigure::Config>(service.response.config);
           }});
}

}  // namespace active_matching_slam
