// Prints every parameter with its default, range and meaning, from their single description: as the
// table of the README, or as config/tracker.yaml and config/ros.yaml.

#include <algorithm>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include "active_matching_slam/ros/node_options.h"
#include "active_matching_slam/tracker/tracker_options.h"

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

/// A field as text.
struct Line {
  std::string group, name;  ///< the name within its group
  std::string path, meaning, text, unit;
  std::string value;  ///< as yaml writes it
  std::string shown;  ///< as a table shows it
  std::string range;  ///< "" where there is none
  bool is_advanced, at_run_time;
};

struct LineOf {
  std::vector<Line>* lines;

  template <class Number>
  void operator()(const OptionField& field, const Number& value, Number minimum,
                  Number maximum) const {
    add(field, plain(value), brief(value), brief(minimum) + " to " + brief(maximum));
  }
  template <class Value>
  void operator()(const OptionField& field, const Value& value) const {
    const std::string text = plain(value);
    add(field, text.empty() ? "\"\"" : text, text.empty() ? "" : "`" + text + "`", "");
  }
  void add(const OptionField& field, const std::string& value, const std::string& shown,
           const std::string& range) const {
    const std::string path = field.name;
    const auto slash = path.find('/');
    const std::string group = slash == std::string::npos ? "" : path.substr(0, slash);
    lines->push_back({group, group.empty() ? path : path.substr(slash + 1), path, field.meaning,
                      field.text(), field.unit, value, shown, range, field.is_advanced,
                      field.at_run_time});
  }
};

template <class Options>
std::vector<Line> linesOf(const Options& options) {
  std::vector<Line> lines;
  visitOptions(options, LineOf{&lines});
  return lines;
}

void printTable(const std::string& title, const std::vector<Line>& lines, bool advanced) {
  std::cout << title << ":\n\n| parameter | default | unit | range | live | meaning |\n"
            << "|---|---|---|---|---|---|\n";
  for (const Line& line : lines)
    if (line.is_advanced == advanced)
      std::cout << "| `" << line.path << "` | " << line.shown << " | " << line.unit << " | "
                << line.range << " | " << (line.at_run_time ? "yes" : "") << " | " << line.meaning
                << " |\n";
}

void printTables() {
  const auto tracker = linesOf(TrackerOptions()), node = linesOf(NodeOptions());
  printTable("The tracker, in the node and in `track_bag`", tracker, false);
  std::cout << "\n";
  printTable("The node alone", node, false);
  std::cout << "\n";
  printTable("Advanced ones of the tracker, whose defaults suit nearly everybody", tracker, true);
  std::cout << "\n";
  printTable("Advanced ones of the node alone", node, true);
}

/// Groups in their order, in each the advanced ones last, under a heading.
void printYaml(const std::vector<Line>& lines) {
  std::vector<std::string> groups;
  for (const Line& line : lines)
    if (std::find(groups.begin(), groups.end(), line.group) == groups.end())
      groups.push_back(line.group);
  for (const std::string& group : groups) {
    const std::string indent = group.empty() ? "" : "  ";
    if (!group.empty()) std::cout << "\n" << group << ":\n";
    for (const bool advanced : {false, true}) {
      bool is_first = true;
      for (const Line& line : lines) {
        if (line.group != group || line.is_advanced != advanced) continue;
        if (advanced && is_first) std::cout << indent << "# --- advanced ---\n";
        is_first = false;
        std::cout << indent << "# " << line.text << (line.range.empty() ? "" : "; ") << line.range
                  << (line.at_run_time ? "" : " (read at start only)") << "\n"
                  << indent << line.name << ": " << line.value << "\n";
      }
    }
  }
}

void printTrackerYaml() {
  std::cout
      << "# Settings of the tracker with their defaults, for the node (rosparam load) and for\n"
         "# track_bag --config. A file need only hold what differs. m stands for the map unit\n"
         "# while the scale is free. The defaults of advanced ones suit nearly everybody.\n\n";
  printYaml(linesOf(TrackerOptions()));
}

void printRosYaml() {
  std::cout
      << "# Settings of the node alone, with their defaults.\n#\n"
         "# Frames (REP 105): map_frame (z up) -> world_frame (the map of features; first camera,\n"
         "# or the known target) -> camera frame (optical axes: x right, y down, z forward).\n"
         "# tf_mode camera sends the last of these, or world_frame -> base_frame when the robot's\n"
         "# own chain holds the camera. tf_mode map_to_odom corrects the robot's odometry.\n\n";
  printYaml(linesOf(NodeOptions()));
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  using namespace active_matching_slam;
  const std::string what = argc > 2 ? "two words" : argc > 1 ? argv[1] : "";
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
