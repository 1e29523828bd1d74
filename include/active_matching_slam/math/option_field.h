#pragma once

#include <sstream>
#include <string>
#include <type_traits>
#include <vector>

namespace active_matching_slam {

/// What is said of an option, once and beside its struct. Files, parameters, checks, run-time
/// reconfiguration and the documented tables are made from it.
struct OptionField {
  const char* name;         ///< path with slashes, as in the yaml file and on the parameter server
  const char* unit;         ///< empty: none
  const char* meaning;      ///< what a user sees of it
  bool is_advanced;         ///< the default suits nearly everybody
  bool at_run_time = true;  ///< may change without losing the map

  OptionField atStartOnly() const { return {name, unit, meaning, is_advanced, false}; }
  /// Meaning with the unit in brackets.
  std::string text() const;
};

constexpr OptionField basicOption(const char* name, const char* unit, const char* meaning) {
  return {name, unit, meaning, false};
}
constexpr OptionField advancedOption(const char* name, const char* unit, const char* meaning) {
  return {name, unit, meaning, true};
}

/// Calls `visit(field, value, minimum, maximum)` for each number (int, double, std::int64_t,
/// std::uint64_t), the range being closed, and `visit(field, value)` for each bool, std::string and
/// enumeration, as the struct's own visitFields() says.
template <class Options, class Visitor>
void visitOptions(Options& options, Visitor&& visit) {
  std::remove_const_t<Options>::visitFields(options, visit);
}

/// What a value of the type is, for messages.
template <class T>
constexpr const char* kindOf() {
  if (std::is_same_v<T, bool>) return "true or false";
  if (std::is_integral_v<T>) return "a whole number";
  return std::is_floating_point_v<T> ? "a number" : "text";
}

/// "name = value is out of range [minimum, maximum]"
template <class Value, class Limit>
std::string outOfRange(const std::string& name, const Value& value, Limit minimum, Limit maximum) {
  std::ostringstream text;
  text << name << " = " << value << " is out of range [" << minimum << ", " << maximum << "]";
  return text.str();
}

[[noreturn]] void refuseOption(const std::string& message);  ///< throws std::invalid_argument

/// Throws std::invalid_argument with name, value and range. NaN is out of any.
template <class Number>
void checkRange(const std::string& name, Number value, Number minimum, Number maximum) {
  if (!(value >= minimum && value <= maximum))
    refuseOption(outOfRange(name, value, minimum, maximum));
}

/// Throws std::invalid_argument "name = 'value' is not one of a, b, c" unless it is one of them.
void checkChoice(const std::string& name, const std::string& value,
                 const std::vector<std::string>& choices);

/// Throws for the first number that is out of its range.
template <class Options>
void checkFields(const Options& options) {
  visitOptions(options, [](const OptionField& field, const auto& value, const auto&... limits) {
    if constexpr (sizeof...(limits) == 2) checkRange(field.name, value, limits...);
  });
}

}  // namespace active_matching_slam
