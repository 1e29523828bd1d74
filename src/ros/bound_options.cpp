#include "active_matching_slam/ros/bound_options.h"

#include <XmlRpcValue.h>

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <type_traits>

namespace active_matching_slam {
namespace {

struct Binder {
  std::vector<BoundOption>* options;
  template <class T>
  void operator()(const OptionField& field, T& value, T minimum, T maximum) const {
    options->emplace_back(field, &value, minimum, maximum);
  }
  template <class T>
  void operator()(const OptionField& field, T& value) const {
    options->emplace_back(field, &value);
  }
};

[[noreturn]] void failType(const std::string& name, const char* wanted, const OptionValue& value) {
  throw std::invalid_argument(name + " = " + toText(value) + " is not " + wanted);
}

/// Text that is a number as a whole, such as 1e-4, which yaml 1.1 takes for text.
bool parseNumber(const std::string& text, double* number) {
  char* end = nullptr;
  *number = std::strtod(text.c_str(), &end);
  return !text.empty() && end == text.c_str() + text.size();
}

double toNumber(const std::string& name, const OptionValue& value) {
  double number = 0.0;
  if (const auto* d = std::get_if<double>(&value)) return *d;
  if (const auto* i = std::get_if<std::int64_t>(&value)) return static_cast<double>(*i);
  if (const auto* s = std::get_if<std::string>(&value); s && parseNumber(*s, &number))
    return number;
  failType(name, kindOf<double>(), value);
}

std::int64_t toInteger(const std::string& name, const OptionValue& value) {
  if (const auto* i = std::get_if<std::int64_t>(&value)) return *i;
  const double number = toNumber(name, value);
  if (std::nearbyint(number) != number || std::abs(number) > 4.7e18)
    failType(name, kindOf<std::int64_t>(), value);
  return static_cast<std::int64_t>(number);
}

OptionValue fromXmlRpc(const std::string& name, XmlRpc::XmlRpcValue& value) {
  switch (value.getType()) {
    case XmlRpc::XmlRpcValue::TypeBoolean:
      return static_cast<bool>(value);
    case XmlRpc::XmlRpcValue::TypeInt:
      return static_cast<std::int64_t>(static_cast<int>(value));
    case XmlRpc::XmlRpcValue::TypeDouble:
      return static_cast<double>(value);
    case XmlRpc::XmlRpcValue::TypeString:
      return static_cast<std::string>(value);
    default:
      throw std::invalid_argument(name + " is neither a truth value, a number nor text");
  }
}

/// Parameters that libraries look for in the private namespace of every node.
bool isForeign(const std::string& name) {
  return name == "diagnostic_period" || name == "num_worker_threads";
}

bool isInRange(const BoundOption& option, double number) {
  return number >= option.minimum() && number <= option.maximum();
}

}  // namespace

void checkNodeOptions(const NodeOptions& options) {
  checkFields(options);
  checkChoice("tf_mode", options.tf_mode, {"camera", "map_to_odom", "none"});
  if (options.world_frame.empty()) throw std::invalid_argument("world_frame is empty");
  const std::string child = options.base_frame.empty() ? options.camera_frame : options.base_frame;
  for (const std::string& frame : {child, options.map_frame, options.camera_frame})
    if (frame == options.world_frame)
      throw std::invalid_argument("world_frame = '" + frame +
                                  "' is also the name of another frame");
  if (options.tf_mode == "map_to_odom") {
    if (options.map_frame.empty())
      throw std::invalid_argument("map_frame is empty, tf_mode map_to_odom needs it");
    if (options.odom_frame.empty() || options.odom_frame == options.map_frame ||
        options.odom_frame == options.world_frame)
      throw std::invalid_argument("odom_frame = '" + options.odom_frame +
                                  "' is empty or the name of another frame");
  }
}

bool BoundOption::isNumber() const {
  return !std::holds_alternative<bool*>(target_) &&
         !std::holds_alternative<std::string*>(target_) &&
         !std::holds_alternative<UpdateRule*>(target_);
}

OptionValue BoundOption::get() const {
  return std::visit(
      [](auto* target) -> OptionValue {
        using T = std::decay_t<decltype(*target)>;
        if constexpr (std::is_same_v<T, UpdateRule>)
          return updateRuleName(*target);
        else if constexpr (std::is_integral_v<T> && !std::is_same_v<T, bool>)
          return static_cast<std::int64_t>(*target);
        else
          return *target;
      },
      target_);
}

void BoundOption::set(const OptionValue& value) const {
  std::visit(
      [&](auto* target) {
        using T = std::decay_t<decltype(*target)>;
        if constexpr (std::is_same_v<T, bool>) {
          const auto* b = std::get_if<bool>(&value);
          if (!b) failType(name(), kindOf<T>(), value);
          *target = *b;
        } else if constexpr (std::is_same_v<T, std::string> || std::is_same_v<T, UpdateRule>) {
          const auto* text = std::get_if<std::string>(&value);
          if (!text) failType(name(), kindOf<T>(), value);
          if constexpr (std::is_same_v<T, UpdateRule>)
            *target = updateRuleFromName(*text);
          else
            *target = *text;
        } else if constexpr (std::is_same_v<T, double>) {
          *target = toNumber(name(), value);
        } else {
          const std::int64_t number = toInteger(name(), value);
          if (number < 0 && std::is_unsigned_v<T>) failType(name(), "at least 0", value);
          if (static_cast<std::int64_t>(static_cast<T>(number)) != number)
            failType(name(), "small enough", value);
          *target = static_cast<T>(number);
        }
      },
      target_);
}

std::vector<BoundOption> bindOptions(TrackerOptions* tracker, NodeOptions* node) {
  std::vector<BoundOption> options;
  if (tracker) visitOptions(*tracker, Binder{&options});
  if (node) visitOptions(*node, Binder{&options});
  return options;
}

void readParameterTree(const std::vector<BoundOption>& options, XmlRpc::XmlRpcValue& tree,
                       const std::string& prefix) {
  if (tree.getType() != XmlRpc::XmlRpcValue::TypeStruct) return;
  const auto read = [&](const std::string& name, XmlRpc::XmlRpcValue& value) {
    const auto option = std::find_if(options.begin(), options.end(),
                                     [&](const BoundOption& o) { return o.name() == name; });
    if (option == options.end()) throw std::invalid_argument("unknown parameter " + prefix + name);
    try {
      option->set(fromXmlRpc(name, value));
    } catch (const std::invalid_argument& error) {
      throw std::invalid_argument(prefix + error.what());
    }
    if (!option->isNumber()) return;
    const OptionValue taken = option->get();
    if (!isInRange(*option, toNumber(name, taken)))
      refuseOption(outOfRange(prefix + name, toText(taken), option->minimum(), option->maximum()));
  };
  for (auto& [group, value] : tree) {
    if (value.getType() != XmlRpc::XmlRpcValue::TypeStruct) {
      if (!isForeign(group)) read(group, value);
      continue;
    }
    const std::string start = group + "/";
    const bool ours = std::any_of(options.begin(), options.end(), [&](const BoundOption& o) {
      return o.name().rfind(start, 0) == 0;
    });
    if (!ours) continue;
    for (auto& [key, member] : value) read(start + key, member);
  }
}

OptionValue clipToRange(const BoundOption& option, const OptionValue& value,
                        std::vector<std::string>* warnings) {
  if (!option.isNumber()) return value;
  const double number = toNumber(option.name(), value);
  if (isInRange(option, number)) return value;
  const bool whole = std::holds_alternative<std::int64_t>(option.get());
  // Not a number compares false with everything: keep what is set.
  OptionValue clipped = option.get();
  if (!std::isnan(number)) {
    const double edge = std::clamp(number, option.minimum(), option.maximum());
    clipped = whole ? OptionValue(static_cast<std::int64_t>(edge)) : OptionValue(edge);
  }
  warnings->push_back(outOfRange(option.name(), toText(value), option.minimum(), option.maximum()) +
                      ": set to " + toText(clipped));
  return clipped;
}

std::string toText(const OptionValue& value) {
  std::ostringstream text;
  std::visit(
      [&](const auto& v) {
        if constexpr (std::is_same_v<std::decay_t<decltype(v)>, bool>)
          text << (v ? "true" : "false");
        else if constexpr (std::is_same_v<std::decay_t<decltype(v)>, std::string>)
          text << "'" << v << "'";
        else
          text << v;
      },
      value);
  return text.str();
}

}  // namespace active_matching_slam
