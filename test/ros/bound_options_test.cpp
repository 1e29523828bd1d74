#include "active_matching_slam/ros/bound_options.h"

#include <XmlRpcValue.h>
#include <gtest/gtest.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "active_matching_slam/ros/reconfigure_server.h"
#include "support/fault.h"

namespace active_matching_slam {
namespace {

struct Settings {
  TrackerOptions tracker;
  NodeOptions node;
  std::vector<BoundOption> bound = bindOptions(&tracker, &node);

  const BoundOption& option(const std::string& name) const {
    for (const BoundOption& o : bound)
      if (o.name() == name) return o;
    throw std::out_of_range(name);
  }
};

TEST(Parameters, AreTakenFromTheTree) {
  Settings settings;
  XmlRpc::XmlRpcValue tree;
  tree["matcher"] = "jcbb";
  tree["filter"]["sigma_px"] = 2;  // a whole number for a fraction
  tree["map"]["maximum_features"] = 99;
  tree["matching"]["update_rule"] = "thesis";
  tree["matching"]["false_positive_rate"] = "1e-5";  // yaml 1.1 takes it for text
  tree["draw"]["tree"] = true;
  readParameterTree(settings.bound, tree, "/tracker/");
  EXPECT_EQ("jcbb", settings.tracker.matcher);
  EXPECT_EQ(2.0, settings.tracker.filter.sigma_px);
  EXPECT_EQ(99, settings.tracker.map.maximum_features);
  EXPECT_EQ(UpdateRule::kThesis, settings.tracker.matching.update_rule);
  EXPECT_EQ(1e-5, settings.tracker.matching.default_rates.false_positive);
  EXPECT_TRUE(settings.node.draw.tree);
}

TEST(Parameters, UnknownOnesAreRefusedByName) {
  Settings settings;
  XmlRpc::XmlRpcValue tree;
  tree["filter"]["sigma_pixel"] = 2.0;
  EXPECT_NE(std::string::npos, faultOf([&] {
                                 readParameterTree(settings.bound, tree, "/tracker/");
                               }).find("/tracker/filter/sigma_pixel"));
  XmlRpc::XmlRpcValue top;
  top["matchr"] = "jcbb";
  EXPECT_NE(std::string::npos, faultOf([&] {
                                 readParameterTree(settings.bound, top, "/tracker/");
                               }).find("/tracker/matchr"));
}

TEST(Parameters, OutOfRangeOnesAreRefusedByNameWithTheRange) {
  Settings settings;
  XmlRpc::XmlRpcValue tree;
  tree["map"]["maximum_features"] = -3;
  const std::string fault = faultOf([&] { readParameterTree(settings.bound, tree, "/tracker/"); });
  EXPECT_NE(std::string::npos, fault.find("/tracker/map/maximum_features = -3")) << fault;
  EXPECT_NE(std::string::npos, fault.find("[4, 5000]")) << fault;
}

TEST(Parameters, WrongTypesAreRefusedByName) {
  for (const char* name : {"map/maximum_features", "draw/tree", "filter/sigma_px", "matcher"}) {
    Settings settings;
    XmlRpc::XmlRpcValue tree;
    const std::string path = name;
    const auto slash = path.find('/');
    XmlRpc::XmlRpcValue& value = slash == std::string::npos
                                     ? tree[path]
                                     : tree[path.substr(0, slash)][path.substr(slash + 1)];
    if (path == "matcher")
      value = 3;
    else if (path == "map/maximum_features")
      value = 20.5;
    else
      value = "much";
    EXPECT_NE(std::string::npos,
              faultOf([&] { readParameterTree(settings.bound, tree, "/t/"); }).find("/t/" + path));
  }
}

TEST(Parameters, NamespacesOfOthersArePassedOver) {
  Settings settings;
  XmlRpc::XmlRpcValue tree;
  tree["debug_image"]["compressed"]["jpeg_quality"] = 80;
  tree["diagnostic_period"] = 2.0;
  EXPECT_NO_THROW(readParameterTree(settings.bound, tree, "/tracker/"));
}

TEST(RunTimeChanges, AreClippedToTheirRangeWithAWarningThatNamesThem) {
  Settings settings;
  std::vector<std::string> warnings;
  const BoundOption& threshold = settings.option("image/match_threshold");
  EXPECT_EQ(OptionValue(0.9), clipToRange(threshold, 0.9, &warnings));
  EXPECT_TRUE(warnings.empty());
  EXPECT_EQ(OptionValue(0.999), clipToRange(threshold, 7.0, &warnings));
  ASSERT_EQ(1u, warnings.size());
  EXPECT_NE(std::string::npos, warnings[0].find("image/match_threshold"));
  EXPECT_EQ(threshold.get(), clipToRange(threshold, std::nan(""), &warnings));
  EXPECT_EQ(OptionValue(std::int64_t{4}),
            clipToRange(settings.option("map/maximum_features"), std::int64_t{-10}, &warnings));
}

TEST(RunTimeChanges, DescriptionHoldsTheLiveSettingsWithTheirRanges) {
  Settings settings;
  const auto description = toConfigDescriptionMsg(settings.bound);
  bool has_matcher = false;
  std::size_t described = 0;
  for (const auto& group : description.groups)
    for (const auto& parameter : group.parameters) {
      ++described;
      has_matcher |= parameter.name == "matcher" && parameter.type == "str";
      const OptionField& field = settings.option(parameter.name).field();
      EXPECT_TRUE(field.at_run_time) << parameter.name;
      EXPECT_EQ(group.name == "Advanced", field.is_advanced) << parameter.name;
      EXPECT_EQ(parameter.description, field.text());
    }
  EXPECT_TRUE(has_matcher);
  const auto live = [](const BoundOption& option) { return option.field().at_run_time; };
  EXPECT_EQ(described, static_cast<std::size_t>(
                           std::count_if(settings.bound.begin(), settings.bound.end(), live)));
  for (const auto& entry : description.max.doubles)
    EXPECT_EQ(settings.option(entry.name).maximum(), entry.value) << entry.name;
  for (const auto& entry : description.dflt.doubles)
    EXPECT_EQ(settings.option(entry.name).get(), OptionValue(entry.value)) << entry.name;
}

TEST(NodeOptions, FramesThatWouldMakeALoopAreRefused) {
  NodeOptions options;
  EXPECT_NO_THROW(checkNodeOptions(options));
  options.camera_frame = "world";
  EXPECT_THROW(checkNodeOptions(options), std::invalid_argument);
  options = NodeOptions();
  options.tf_mode = "map_to_odom";
  EXPECT_NE(std::string::npos, faultOf([&] { checkNodeOptions(options); }).find("map_frame"));
  options.map_frame = "map";
  EXPECT_NO_THROW(checkNodeOptions(options));
  options.odom_frame = "map";
  EXPECT_THROW(checkNodeOptions(options), std::invalid_argument);
  options = NodeOptions();
  options.tf_mode = "both";
  EXPECT_NE(std::string::npos, faultOf([&] { checkNodeOptions(options); }).find("'both'"));
}

/// The value in a shipped file, in the type of the setting.
OptionValue yamlValue(const YAML::Node& node, const OptionValue& like) {
  if (std::holds_alternative<bool>(like)) return node.as<bool>();
  if (std::holds_alternative<std::int64_t>(like)) return node.as<std::int64_t>();
  if (std::holds_alternative<double>(like)) return node.as<double>();
  return node.as<std::string>();
}

void expectDefaults(const std::vector<BoundOption>& options, const std::string& file,
                    const std::string& how) {
  const YAML::Node root = YAML::LoadFile(file);
  for (const BoundOption& option : options) {
    const std::string name = option.name();
    const auto slash = name.find('/');
    const YAML::Node node = slash == std::string::npos
                                ? root[name]
                                : root[name.substr(0, slash)][name.substr(slash + 1)];
    ASSERT_TRUE(node.IsDefined()) << file << " lacks " << name << "; " << how;
    EXPECT_EQ(option.get(), yamlValue(node, option.get()))
        << file << ": " << name << " is not the default; " << how;
  }
}

TEST(ShippedSettings, HoldEveryKeyWithItsDefault) {
  Settings settings;
  expectDefaults(bindOptions(&settings.tracker, nullptr), "../config/tracker.yaml",
                 "write it anew: parameter_table --tracker-yaml");
  expectDefaults(bindOptions(nullptr, &settings.node), "../config/ros.yaml",
                 "write it anew: parameter_table --ros-yaml");
}

TEST(ShippedSettings, OfTheTrackerAreReadByTheOfflineToolToo) {
  EXPECT_NO_THROW(readTrackerOptionsYaml("../config/tracker.yaml"));
}

}  // namespace
}  // namespace active_matching_slam
