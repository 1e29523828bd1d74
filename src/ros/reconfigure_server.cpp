#include "active_matching_slam/ros/reconfigure_server.h"

#include <algorithm>
#include <limits>

namespace active_matching_slam {
namespace {

/// The protocol's whole numbers have 32 bits.
int toInt32(double value) {
  return static_cast<int>(std::clamp(value, double{std::numeric_limits<int>::min()},
                                     double{std::numeric_limits<int>::max()}));
}

template <class Message>
void append(std::vector<Message>* list, const std::string& name,
            const decltype(Message::value)& value) {
  Message& entry = list->emplace_back();
  entry.name = name;
  entry.value = value;
}

void append(dynamic_reconfigure::Config* config, const std::string& name,
            const OptionValue& value) {
  if (const auto* b = std::get_if<bool>(&value))
    append(&config->bools, name, *b);
  else if (const auto* i = std::get_if<std::int64_t>(&value))
    append(&config->ints, name, toInt32(static_cast<double>(*i)));
  else if (const auto* d = std::get_if<double>(&value))
    append(&config->doubles, name, *d);
  else
    append(&config->strs, name, std::get<std::string>(value));
}

/// By its index, which is its id: the one that holds all others is the protocol's own.
const char* const kGroupNames[] = {"Default", "Advanced"};

void addGroups(dynamic_reconfigure::Config* config) {
  for (const char* name : kGroupNames) {
    const auto id = static_cast<int>(config->groups.size());
    dynamic_reconfigure::GroupState& group = config->groups.emplace_back();
    group.name = name;
    group.id = id;
    group.state = id == 0;  // advanced ones are folded
  }
}

/// An end of the range in the type of the setting; for text and truth values what they are.
OptionValue rangeEnd(const BoundOption& option, double end) {
  const OptionValue value = option.get();
  if (std::holds_alternative<double>(value)) return end;
  if (std::holds_alternative<std::int64_t>(value)) return static_cast<std::int64_t>(toInt32(end));
  return value;
}

std::string typeName(const OptionValue& value) {
  static const char* const kNames[] = {"bool", "int", "double", "str"};
  return kNames[value.index()];
}

std::vector<ReconfigureServer::Change> toChanges(const dynamic_reconfigure::Config& config) {
  std::vector<ReconfigureServer::Change> changes;
  for (const auto& entry : config.bools) changes.push_back({entry.name, bool(entry.value)});
  for (const auto& entry : config.ints)
    changes.push_back({entry.name, static_cast<std::int64_t>(entry.value)});
  for (const auto& entry : config.doubles) changes.push_back({entry.name, entry.value});
  for (const auto& entry : config.strs) changes.push_back({entry.name, entry.value});
  return changes;
}

void writeParameter(const ros::NodeHandle& node, const std::string& name,
                    const OptionValue& value) {
  if (const auto* i = std::get_if<std::int64_t>(&value))
    node.setParam(name, toInt32(static_cast<double>(*i)));
  else
    std::visit(
        [&](const auto& v) {
          if constexpr (!std::is_same_v<std::decay_t<decltype(v)>, std::int64_t>)
            node.setParam(name, v);
        },
        value);
}

}  // namespace

ReconfigureServer::ReconfigureServer(const ros::NodeHandle& private_node, Current current,
                                     Apply apply)
    : node_(private_node), current_(std::move(current)), apply_(std::move(apply)) {
  descriptions_ =
      node_.advertise<dynamic_reconfigure::ConfigDescription>("parameter_descriptions", 1, true);
  updates_ = node_.advertise<dynamic_reconfigure::Config>("parameter_updates", 1, true);
  descriptions_.publish(toConfigDescriptionMsg(current_()));
  publishUpdate();
  service_ = node_.advertiseService("set_parameters", &ReconfigureServer::setParameters, this);
}

void ReconfigureServer::publishUpdate() { updates_.publish(toConfigMsg(current_())); }

bool ReconfigureServer::setParameters(dynamic_reconfigure::Reconfigure::Request& request,
                                      dynamic_reconfigure::Reconfigure::Response& response) {
  const std::vector<BoundOption> options = current_();
  std::vector<std::string> warnings;
  std::vector<Change> changes;
  for (Change& change : toChanges(request.config)) {
    const auto option = std::find_if(options.begin(), options.end(), [&](const BoundOption& o) {
      return o.name() == change.name && o.field().at_run_time;
    });
    if (option == options.end()) {
      warnings.push_back(change.name + " is unknown or can't change at run time");
      continue;
    }
    try {
      change.value = clipToRange(*option, change.value, &warnings);
      changes.push_back(change);
    } catch (const std::invalid_argument& error) {
      warnings.push_back(error.what());
    }
  }
  const std::string error = apply_(changes);
  if (!error.empty()) warnings.push_back(error + ": nothing was changed");
  for (const std::string& warning : warnings) ROS_WARN_STREAM("Reconfigure: " << warning);

  const std::vector<BoundOption> now = current_();
  for (const Change& change : changes)
    for (const BoundOption& option : now)
      if (option.name() == change.name) writeParameter(node_, change.name, option.get());
  response.config = toConfigMsg(now);
  updates_.publish(response.config);
  return true;
}

dynamic_reconfigure::Config toConfigMsg(const std::vector<BoundOption>& options) {
  dynamic_reconfigure::Config config;
  for (const BoundOption& option : options)
    if (option.field().at_run_time) append(&config, option.name(), option.get());
  addGroups(&config);
  return config;
}

dynamic_reconfigure::ConfigDescription toConfigDescriptionMsg(
    const std::vector<BoundOption>& options) {
  dynamic_reconfigure::ConfigDescription description;
  for (const char* name : kGroupNames) {
    dynamic_reconfigure::Group group;
    group.name = name;
    group.id = static_cast<int>(description.groups.size());
    if (group.id > 0) group.type = "collapse";
    description.groups.push_back(group);
  }
  for (const BoundOption& option : options) {
    if (!option.field().at_run_time) continue;
    dynamic_reconfigure::ParamDescription& parameter =
        description.groups[option.field().is_advanced ? 1 : 0].parameters.emplace_back();
    parameter.name = option.name();
    parameter.type = typeName(option.get());
    parameter.description = option.field().text();
    append(&description.dflt, option.name(), option.get());
    append(&description.min, option.name(), rangeEnd(option, option.minimum()));
    append(&description.max, option.name(), rangeEnd(option, option.maximum()));
  }
  addGroups(&description.dflt);
  addGroups(&description.min);
  addGroups(&description.max);
  return description;
}

}  // namespace active_matching_slam
