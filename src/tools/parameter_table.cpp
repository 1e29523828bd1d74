// Prints every parameter with its default, range and meaning, from their single description: as the
// table of the README, or as config/tracker.yaml and config/ros.yaml.

#include <cstring>
#include <iostream>
#include <sstream>
#include <string>

#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/tracker/option_fields.h"

namespace active_matching_slam {
namespace {

std::string plain(const std::string& value) { return value; }
std::string plain(bool value) { return value ? "true" : "false"; }
std::string plain(UpdateRule value) { return updateRuleName(value); }
/// Fractions keep a point and no exponent: yaml 1.1 reads 1e-4 as text and 1 as a whole number.
std::string plain(double value) {
  std::ostringstream stream;
  stream << value;
  std::string text = stream.str();
  if (text.find('e') != std::string::npos) {
    stream.str("");
    stream << std::fixed << value;
    text = stream.str();
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text += '0';
  }
  return text.find('.') == std::string::npos ? text + ".0" : text;
}
template <class Integer>
std::string plain(Integer value) {
  return std::to_string(value);
}

template <class Value>
std::string brief(const Value& value) {
  std::ostringstream stream;
  stream << value;
  return stream.str();
}

struct TableRow {
  template <class Value>
  void operator()(const OptionField& field, const Value& value) const {
    const std::string text = plain(value);
    print(field, text.empty() ? text : "`" + text + "`", "");
  }
  template <class Number>
  void operator()(const OptionField& field, const Number& value, Number minimum,
                  Number maximum) const {
    print(field, brief(value), brief(minimum) + " to " + brief(maximum));
  }
  static void print(const OptionField& field, const std::string& value, const std::string& range) {
    std::cout << "| `" << field.name << "` | " << value << " | " << range << " | "
              << (field.at_run_time ? "yes" : "") << " | " << field.description << " |\n";
  }
};

/// Opens a group where the path of a setting enters one; settings come sorted by group.
struct YamlLine {
  std::string* group;

  template <class Number>
  void operator()(const OptionField& field, const Number& value, Number minimum,
                  Number maximum) const {
    print(field, plain(value), "; " + brief(minimum) + " to " + brief(maximum));
  }
  template <class Value>
  void operator()(const OptionField& field, const Value& value) const {
    const std::string text = plain(value);
    print(field, text.empty() ? "\"\"" : text, "");
  }
  void print(const OptionField& field, const std::string& value, const std::string& range) const {
    const char* slash = std::strchr(field.name, '/');
    const std::string entered = slash ? std::string(field.name, slash) : "";
    if (entered != *group) std::cout << "\n" << entered << ":\n";
    *group = entered;
    const std::string indent = slash ? "  " : "";
    std::cout << indent << "# " << field.description << range
              << (field.at_run_time ? "" : " (read at start only)") << "\n"
              << indent << (slash ? slash + 1 : field.name) << ": " << value << "\n";
  }
};

void printTables() {
  const std::string head =
      "| parameter | default | range | live | meaning |\n|---|---|---|---|---|\n";
  std::cout << "The tracker, in the node and in `track_bag`:\n\n" << head;
  const TrackerOptions tracker;
  visitOptions(tracker, TableRow());
  std::cout << "\nThe node alone:\n\n" << head;
  const NodeOptions node;
  visitNodeOptions(node, TableRow());
}

void printTrackerYaml() {
  std::cout
      << "# Settings of the tracker with their defaults, for the node (rosparam load) and for\n"
         "# track_bag --config. A file need only hold what differs. m stands for the map unit\n"
         "# while the scale is free.\n\n";
  std::string group;
  const TrackerOptions options;
  visitOptions(options, YamlLine{&group});
}

void printRosYaml() {
  std::cout
      << "# Settings of the node alone, with their defaults.\n#\n"
         "# Frames (REP 105): map_frame (z up) -> world_frame (the map of features; first camera,\n"
         "# or the known target) -> camera frame (optical axes: x right, y down, z forward).\n"
         "# tf_mode camera sends the last of these, or world_frame -> base_frame when the robot's\n"
         "# own chain holds the camera. tf_mode map_to_odom corrects the robot's odometry.\n\n";
  std::string group;
  const NodeOptions options;
  visitNodeOptions(options, YamlLine{&group});
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  using namespace active_matching_slam;
  const std::string what = argc > 1 ? argv[1] : "";
  if (what.empty()) {
    printTables();
  } else if (what == "--tracker-yaml") {
    printTrackerYaml();
  } else if (what == "--ros-yaml") {
    printRosYaml();
  } else {
    const bool asked = what == "--help" || what == "-h";
    (asked ? std::cout : std::cerr)
        << "parameter_table [--tracker-yaml | --ros-yaml]: every parameter with its default, range "
           "and meaning,\nas the tables of the README, or as the files of config/\n";
    return asked ? 0 : 2;
  }
  return 0;
}
