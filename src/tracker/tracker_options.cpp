#include "active_matching_slam/tracker/tracker_options.h"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <sstream>
#include <stdexcept>

#include "active_matching_slam/image/template.h"
#include "active_matching_slam/matching/matcher.h"

namespace active_matching_slam {
namespace {

constexpr std::size_t kFewestKnownPoints = 4;
constexpr int kSmallestTemplate = 5;  ///< side [px], as of image/template_size_px

/// Takes what a yaml tree says and remembers which keys are known.
struct YamlReader {
  const YAML::Node& root;
  std::set<std::string>& known;

  YAML::Node find(const std::string& name) const {
    const auto slash = name.find('/');
    if (slash == std::string::npos) return root[name];
    const YAML::Node group = root[name.substr(0, slash)];
    return group && group.IsMap() ? group[name.substr(slash + 1)]
                                  : YAML::Node(YAML::NodeType::Undefined);
  }
  template <class T>
  void operator()(const OptionField& field, T& value, T, T) const {
    (*this)(field, value);
  }
  template <class T>
  void operator()(const OptionField& field, T& value) const {
    known.insert(field.name);
    const YAML::Node node = find(field.name);
    if (!node.IsDefined()) return;
    try {
      value = node.as<T>();
    } catch (const YAML::Exception&) {
      refuseOption(std::string(field.name) + " = " + YAML::Dump(node) + " is not " + kindOf<T>());
    }
  }
  void operator()(const OptionField& field, UpdateRule& value) const {
    std::string name = updateRuleName(value);
    (*this)(field, name);
    value = updateRuleFromName(name);
  }
};

void refuseUnknownKeys(const YAML::Node& node, const std::string& prefix,
                       const std::set<std::string>& known) {
  for (const auto& entry : node) {
    const std::string name = prefix + entry.first.as<std::string>();
    if (known.count(name)) continue;
    const bool is_group = std::any_of(known.begin(), known.end(), [&](const std::string& k) {
      return k.rfind(name + "/", 0) == 0;
    });
    if (!is_group || !entry.second.IsMap())
      throw std::invalid_argument("unknown setting '" + name + "'");
    refuseUnknownKeys(entry.second, name + "/", known);
  }
}

YAML::Node loadYaml(const std::string& path) {
  try {
    return YAML::LoadFile(path);
  } catch (const YAML::BadFile&) {
    throw std::runtime_error("can't read '" + path + "'");
  } catch (const YAML::Exception& e) {
    throw std::runtime_error("'" + path + "' is not valid yaml: " + e.what());
  }
}

}  // namespace

void checkTrackerOptions(const TrackerOptions& options) {
  checkFields(options);
  checkChoice("matcher", options.matcher, matcherNames());
  checkImageOptions(options.image);
  checkMapOptions(options.map);
  checkMotionOptions(options.motion);
  checkTarget(options.target);
  checkSubmapOptions(options.submaps);
  if (!options.known_points.empty() && options.known_points.size() < kFewestKnownPoints)
    throw std::invalid_argument("known points: " + std::to_string(options.known_points.size()) +
                                " given, a start needs at least " +
                                std::to_string(kFewestKnownPoints));
}

namespace {

/// Of the fields of a target; throws std::runtime_error naming one that is missing, of another
/// type, or unknown.
TargetDescription targetFromYaml(const YAML::Node& root, const std::string& kind) {
  TargetDescription target;
  std::set<std::string> known = {"kind"};
  const auto read = [&](const char* name, auto* value) {
    known.insert(name);
    if (!root[name]) throw std::runtime_error(std::string(name) + " is missing");
    try {
      *value = root[name].as<std::decay_t<decltype(*value)>>();
    } catch (const YAML::Exception&) {
      throw std::runtime_error(std::string(name) + " is of the wrong type");
    }
  };
  if (kind == "tag") {
    target.kind = TargetDescription::Kind::kTag;
    read("dictionary", &target.dictionary);
    read("id", &target.id);
    read("size_m", &target.size_m);
  } else if (kind == "chessboard") {
    target.kind = TargetDescription::Kind::kChessboard;
    read("columns", &target.columns);
    read("rows", &target.rows);
    read("square_m", &target.square_m);
  } else {
    throw std::runtime_error("kind is '" + kind + "', must be points, tag or chessboard");
  }
  refuseUnknownKeys(root, "", known);
  checkTarget(target);
  return target;
}

}  // namespace

void readKnownTargetYaml(const std::string& path, TrackerOptions* options) {
  const YAML::Node root = loadYaml(path);
  const bool has_kind = root.IsMap() && root["kind"];
  try {
    const std::string kind = has_kind ? root["kind"].as<std::string>() : "points";
    if (kind != "points") {
      options->target = targetFromYaml(root, kind);
      return;
    }
  } catch (const YAML::Exception&) {
    throw std::runtime_error("'" + path + "': kind is not a word");
  } catch (const std::exception& fault) {
    throw std::runtime_error("'" + path + "': " + fault.what());
  }
  options->known_points = readKnownPointsYaml(path);
}

std::vector<KnownPoint> readKnownPointsYaml(const std::string& path) {
  const YAML::Node root = loadYaml(path);
  const auto fail = [&](const std::string& what) {
    throw std::runtime_error("'" + path + "': " + what);
  };
  if (!root.IsMap() || !root["points"] || !root["points"].IsSequence())
    fail("has no list named points");
  const std::filesystem::path folder = std::filesystem::path(path).parent_path();
  std::vector<KnownPoint> points;
  for (const auto& node : root["points"]) {
    const std::string where = "points[" + std::to_string(points.size()) + "]";
    KnownPoint point;
    try {
      const auto position = node["position_m"].as<std::vector<double>>();
      const auto pixel = node["image_px"].as<std::vector<double>>();
      if (position.size() != 3) fail(where + ".position_m needs 3 numbers");
      if (pixel.size() != 2) fail(where + ".image_px needs 2 numbers");
      point.position_m = Eigen::Vector3d(position[0], position[1], position[2]);
      point.image_px = Eigen::Vector2d(pixel[0], pixel[1]);
    } catch (const YAML::Exception&) {
      fail(where + " needs position_m: [x, y, z] and image_px: [u, v]");
    }
    if (!point.position_m.allFinite() || !point.image_px.allFinite())
      fail(where + " has a number that is not finite");
    if (node["template"]) {
      if (!node["template"].IsScalar()) fail(where + ".template is not the name of a file");
      const std::string file = (folder / node["template"].as<std::string>()).string();
      point.template_image = cv::imread(file, cv::IMREAD_GRAYSCALE);
      if (point.template_image.empty()) fail(where + ".template: can't read image '" + file + "'");
      const auto patch = makeTemplate(point.template_image);
      if (!patch || patch->size < kSmallestTemplate)
        fail(where + ".template: '" + file + "' is " + std::to_string(point.template_image.cols) +
             " x " + std::to_string(point.template_image.rows) +
             " pixels; it must be square, of an odd side from " +
             std::to_string(kSmallestTemplate) + " to " + std::to_string(Template::kMaximumSize));
      if (patch->energy == 0) fail(where + ".template: '" + file + "' shows nothing but one grey");
    }
    points.push_back(point);
  }
  if (points.size() < kFewestKnownPoints)
    fail("points has " + std::to_string(points.size()) + " entries, a start needs at least " +
         std::to_string(kFewestKnownPoints));
  return points;
}

namespace {

TrackerOptions optionsFromYaml(const YAML::Node& root, const TrackerOptions& defaults) {
  TrackerOptions options = defaults;
  std::set<std::string> known;
  visitOptions(options, YamlReader{root, known});
  refuseUnknownKeys(root, "", known);
  checkTrackerOptions(options);
  return options;
}

}  // namespace

TrackerOptions readTrackerOptionsYaml(const std::string& path, const TrackerOptions& defaults) {
  const YAML::Node root = loadYaml(path);
  if (root.IsNull()) return defaults;
  if (!root.IsMap()) throw std::runtime_error("'" + path + "' is not a map of settings");
  try {
    return optionsFromYaml(root, defaults);
  } catch (const std::invalid_argument& e) {
    throw std::invalid_argument("'" + path + "': " + e.what());
  }
}

void setTrackerOption(const std::string& assignment, TrackerOptions* options) {
  const auto equals = assignment.find('=');
  if (equals == std::string::npos)
    throw std::invalid_argument("'" + assignment + "' is not of the form name=value");
  const std::string name = assignment.substr(0, equals), value = assignment.substr(equals + 1);
  const auto slash = name.find('/');
  YAML::Node root;
  if (slash == std::string::npos)
    root[name] = value;
  else
    root[name.substr(0, slash)][name.substr(slash + 1)] = value;
  *options = optionsFromYaml(root, *options);
}

}  // namespace active_matching_slam
