#include "active_matching_slam/tracker/tracker_options.h"

#include <gtest/gtest.h>

#include <fstream>
#include <iomanip>
#include <limits>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <type_traits>

namespace active_matching_slam {
namespace {

template <class T>
std::string textOf(const T& value) {
  std::ostringstream text;
  text << std::boolalpha << std::setprecision(17) << value;
  return text.str();
}
std::string textOf(UpdateRule rule) { return updateRuleName(rule); }

/// All settings as text, by name.
using Table = std::map<std::string, std::string>;
Table tableOf(TrackerOptions options) {
  Table table;
  visitOptions(options, [&](const OptionField& field, const auto& value, const auto&...) {
    EXPECT_TRUE(table.emplace(field.name, textOf(value)).second) << field.name << " comes twice";
  });
  return table;
}

/// Another legal value of every setting.
struct OtherValue {
  Table* table;
  void operator()(const OptionField& f, bool value) { (*table)[f.name] = textOf(!value); }
  void operator()(const OptionField& f, UpdateRule) { (*table)[f.name] = "thesis"; }
  void operator()(const OptionField& f, const std::string&) {
    (*table)[f.name] = f.name == std::string("motion_prior") ? "gyro" : "jcbb";
  }
  template <class T>
  void operator()(const OptionField& f, T value, T minimum, T maximum) {
    T other;
    if (std::is_integral_v<T>)  // keeps odd what is odd
      other = value + 2 <= maximum ? value + 2 : value - 2;
    else
      other = value < maximum ? value + (maximum - value) / 16 : minimum;
    (*table)[f.name] = textOf(other);
  }
};

Table otherValues() {
  Table table;
  TrackerOptions options;
  visitOptions(options, OtherValue{&table});
  return table;
}

/// As many of them as may be set at once.
Table otherValuesTogether() {
  Table table = otherValues();
  for (const char* other : {"submaps/preserve", "submaps/max_features"})
    table[other] = tableOf({}).at(other);  // of the three requests one at most may be made
  return table;
}

/// Text of values that every number refuses.
struct RefusedValues {
  std::vector<std::pair<std::string, std::string>>* list;
  void operator()(const OptionField&, bool) {}
  void operator()(const OptionField&, UpdateRule) {}
  void operator()(const OptionField&, const std::string&) {}
  template <class T>
  void operator()(const OptionField& f, T, T minimum, T maximum) {
    if constexpr (std::is_integral_v<T>) {
      list->emplace_back(f.name, minimum == 0 ? "-1" : textOf(minimum - 1));
      list->emplace_back(f.name, textOf(maximum + 1));
      list->emplace_back(f.name, "2.5");
    } else {
      list->emplace_back(f.name, textOf(std::nextafter(minimum, -1e300)));
      list->emplace_back(f.name, textOf(std::nextafter(maximum, 1e300)));
      list->emplace_back(f.name, ".inf");
      list->emplace_back(f.name, "-.inf");
      list->emplace_back(f.name, ".nan");
      list->emplace_back(f.name, "nan");
    }
  }
};

std::string writeFile(const std::string& name, const std::string& text) {
  const std::string path = testing::TempDir() + "/tracker_options_" + name;
  std::ofstream(path) << text;
  return path;
}

std::string asYaml(const std::string& name, const std::string& value) {
  const auto slash = name.find('/');
  if (slash == std::string::npos) return name + ": " + value + "\n";
  return name.substr(0, slash) + ":\n  " + name.substr(slash + 1) + ": " + value + "\n";
}

/// The message of what `f` throws as E; empty (and a failure) when it does not.
template <class E, class F>
std::string messageOf(F f) {
  try {
    f();
  } catch (const E& e) {
    return e.what();
  } catch (const std::exception& e) {
    ADD_FAILURE() << "thrown as another type: " << e.what();
    return e.what();
  }
  ADD_FAILURE() << "nothing was thrown";
  return "";
}

void expectNames(const std::string& message, const std::string& what) {
  EXPECT_NE(message.find(what), std::string::npos) << "'" << message << "' names '" << what << "'";
}

TEST(TrackerOptions, DefaultsAreLegal) { EXPECT_NO_THROW(checkTrackerOptions({})); }

TEST(TrackerOptions, EverySettingCanBeSetFromText) {
  const Table defaults = tableOf({});
  for (const auto& [name, value] : otherValues()) {
    TrackerOptions options;
    ASSERT_NO_THROW(setTrackerOption(name + "=" + value, &options)) << name << "=" << value;
    Table expected = defaults;
    EXPECT_NE(expected.at(name), value) << name;
    expected[name] = value;
    EXPECT_EQ(tableOf(options), expected) << name;
  }
}

TEST(TrackerOptions, EverySettingCanBeSetFromYaml) {
  const Table defaults = tableOf({});
  for (const auto& [name, value] : otherValues()) {
    const std::string path = writeFile("one.yaml", asYaml(name, value));
    TrackerOptions options;
    ASSERT_NO_THROW(options = readTrackerOptionsYaml(path)) << name << ": " << value;
    Table expected = defaults;
    expected[name] = value;
    EXPECT_EQ(tableOf(options), expected) << name;
  }
}

TEST(TrackerOptions, ValuesOutOfRangeAreRefusedByName) {
  std::vector<std::pair<std::string, std::string>> refused;
  TrackerOptions defaults;
  visitOptions(defaults, RefusedValues{&refused});
  EXPECT_GT(refused.size(), 100u);
  for (const auto& [name, value] : refused) {
    TrackerOptions options;
    SCOPED_TRACE(name + "=" + value);
    expectNames(messageOf<std::invalid_argument>(
                    [&, n = name, v = value] { setTrackerOption(n + "=" + v, &options); }),
                name);
    EXPECT_EQ(tableOf(options), tableOf({})) << "nothing is changed";
    const std::string path = writeFile("refused.yaml", asYaml(name, value));
    const std::string message =
        messageOf<std::invalid_argument>([&] { readTrackerOptionsYaml(path); });
    expectNames(message, name);
    expectNames(message, path);
  }
}

/// Puts NaN into the n-th setting that can hold it.
struct PutNan {
  int* n;
  std::string* name;
  template <class... Limits>
  void operator()(const OptionField& field, double& value, Limits...) {
    if ((*n)-- != 0) return;
    value = std::numeric_limits<double>::quiet_NaN();
    *name = field.name;
  }
  template <class T, class... Limits>
  void operator()(const OptionField&, T&, Limits...) {}
};

TEST(TrackerOptions, NanIsRefusedByName) {
  for (int i = 0;; ++i) {
    TrackerOptions options;
    int n = i;
    std::string name;
    visitOptions(options, PutNan{&n, &name});
    if (name.empty()) {
      EXPECT_GT(i, 20);
      break;
    }
    expectNames(messageOf<std::invalid_argument>([&] { checkTrackerOptions(options); }), name);
  }
}

/// What the end of a name says of the unit.
TEST(TrackerOptions, UnitsAreThoseOfTheNames) {
  const std::pair<const char*, const char*> kEnds[] = {
      {"_px", "px"},          {"_m", "m"},        {"_s", "s"},
      {"_deg", "deg"},        {"_bits", "bit"},   {"_mps", "m/s"},
      {"_rps", "rad/s"},      {"_mps2", "m/s^2"}, {"_rps2", "rad/s^2"},
      {"milliseconds", "ms"}, {"_pixels", "px"}};
  const TrackerOptions options;
  int with_unit = 0;
  const auto end_of = [](const std::string& name, const std::string& end) {
    return name.size() > end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0;
  };
  visitOptions(options, [&](const OptionField& field, const auto&...) {
    EXPECT_NE(std::string(field.meaning), "") << field.name;
    for (const auto& [end, unit] : kEnds)
      if (end_of(field.name, end)) {
        EXPECT_STREQ(field.unit, unit) << field.name;
        ++with_unit;
      }
  });
  EXPECT_GT(with_unit, 20);
}

TEST(TrackerOptions, AdvancedOnesAreKeptApartFromFewThatManyNeed) {
  const TrackerOptions options;
  int basic = 0, advanced = 0;
  visitOptions(options, [&](const OptionField& field, const auto&...) {
    ++(field.is_advanced ? advanced : basic);
  });
  EXPECT_LT(basic, advanced);
}

TEST(TrackerOptions, UnknownSettingsAreNamed) {
  for (const std::string name :
       {"matching/prune_wieght", "nonsense", "filters/sigma_px", "matcher/deep"}) {
    TrackerOptions options;
    const std::string root = name.substr(0, name.find('/'));
    expectNames(messageOf<std::invalid_argument>([&] { setTrackerOption(name + "=1", &options); }),
                root);
    const std::string path = writeFile("unknown.yaml", asYaml(name, "1"));
    expectNames(messageOf<std::invalid_argument>([&] { readTrackerOptionsYaml(path); }), root);
  }
  TrackerOptions options;
  expectNames(messageOf<std::invalid_argument>(
                  [&] { setTrackerOption("matching/prune_wieght=1", &options); }),
              "matching/prune_wieght");
}

TEST(TrackerOptions, ValuesOfTheWrongTypeAreNamed) {
  TrackerOptions options;
  for (const std::string assignment :
       {"map/maximum_features=many", "structure=7", "filter/sigma_px=wide",
        "filter/sigma_px=", "matching/seed=first", "map/maximum_features=1e99"})
    expectNames(messageOf<std::invalid_argument>([&] { setTrackerOption(assignment, &options); }),
                assignment.substr(0, assignment.find('=')));
  for (const std::string text : {"filter:\n  sigma_px: [1, 2]\n", "filter:\n  sigma_px: {a: 1}\n"})
    expectNames(messageOf<std::invalid_argument>(
                    [&] { readTrackerOptionsYaml(writeFile("type.yaml", text)); }),
                "filter/sigma_px");
  expectNames(messageOf<std::invalid_argument>(
                  [&] { readTrackerOptionsYaml(writeFile("group.yaml", "filter: 3\n")); }),
              "filter");
}

TEST(TrackerOptions, UnknownNamesOfAChoiceAreNamedWithTheChoices) {
  TrackerOptions options;
  const std::string matcher =
      messageOf<std::invalid_argument>([&] { setTrackerOption("matcher=best", &options); });
  expectNames(matcher, "best");
  expectNames(matcher, "one_point_ransac");
  const std::string rule = messageOf<std::invalid_argument>(
      [&] { setTrackerOption("matching/update_rule=mine", &options); });
  expectNames(rule, "mine");
  expectNames(rule, "thesis");
}

TEST(TrackerOptions, TextWithoutAnEqualsSignIsRefused) {
  TrackerOptions options;
  expectNames(messageOf<std::invalid_argument>([&] { setTrackerOption("matcher", &options); }),
              "name=value");
}

TEST(TrackerOptions, SettingsThatContradictEachOtherAreNamed) {
  TrackerOptions options;
  expectNames(messageOf<std::invalid_argument>(
                  [&] { setTrackerOption("map/maximum_features=10", &options); }),
              "map/features_per_frame");
  expectNames(messageOf<std::invalid_argument>(
                  [&] { setTrackerOption("image/template_size_px=12", &options); }),
              "template_size_px");
}

TEST(TrackerOptions, TheShippedFileHoldsTheDefaults) {
  // It names every setting, so that what it says is what is read.
  TrackerOptions others;
  const Table other_values = otherValuesTogether();
  for (const auto& [name, value] : other_values) setTrackerOption(name + "=" + value, &others);
  const TrackerOptions shipped;
  EXPECT_EQ(tableOf(readTrackerOptionsYaml("../config/tracker.yaml", others)), tableOf(shipped))
      << "write it anew: parameter_table --tracker-yaml";
}

TEST(TrackerOptions, AnEmptyFileLeavesTheDefaults) {
  TrackerOptions defaults;
  defaults.filter.sigma_px = 1.25;
  EXPECT_EQ(tableOf(readTrackerOptionsYaml(writeFile("empty.yaml", "# nothing\n"), defaults)),
            tableOf(defaults));
}

TEST(TrackerOptions, FilesThatCanNotBeReadAreNamed) {
  expectNames(messageOf<std::runtime_error>([] { readTrackerOptionsYaml("/nowhere/at.yaml"); }),
              "/nowhere/at.yaml");
  for (const std::string text : {"- 1\n- 2\n", "matcher: [unclosed\n", "just text"}) {
    const std::string path = writeFile("broken.yaml", text);
    expectNames(messageOf<std::runtime_error>([&] { readTrackerOptionsYaml(path); }), path);
  }
}

std::string knownPointsText(const std::string& last_point) {
  return "points:\n"
         "  - {position_m: [0, 0, 0], image_px: [10, 20]}\n"
         "  - {position_m: [0.2, 0, 0], image_px: [110, 20]}\n"
         "  - {position_m: [0.2, 0.1, 0.01], image_px: [110.5, 80]}\n"
         "  - " +
         last_point + "\n";
}

TEST(KnownPoints, AreReadWithTheirTemplates) {
  cv::Mat patch(11, 11, CV_8UC1);
  cv::randu(patch, 0, 256);
  cv::imwrite(testing::TempDir() + "/tracker_options_patch.png", patch);
  const auto points = readKnownPointsYaml(writeFile(
      "points.yaml", knownPointsText("{position_m: [0, 0.1, -1.5e-2], image_px: [10, 80], "
                                     "template: tracker_options_patch.png}")));
  ASSERT_EQ(points.size(), 4u);
  EXPECT_EQ(points[2].position_m, Eigen::Vector3d(0.2, 0.1, 0.01));
  EXPECT_EQ(points[2].image_px, Eigen::Vector2d(110.5, 80));
  EXPECT_TRUE(points[2].template_image.empty());
  EXPECT_EQ(points[3].position_m.z(), -1.5e-2);
  ASSERT_EQ(points[3].template_image.size(), patch.size());
  EXPECT_EQ(cv::norm(points[3].template_image, patch, cv::NORM_INF), 0.0);
}

TEST(KnownPoints, FaultsAreNamed) {
  expectNames(messageOf<std::runtime_error>([] { readKnownPointsYaml("/nowhere/points.yaml"); }),
              "/nowhere/points.yaml");
  const struct {
    const char* last_point;
    const char* named;
  } cases[] = {
      {"{position_m: [0, 0.1], image_px: [10, 80]}", "points[3].position_m"},
      {"{position_m: [0, 0.1, 0], image_px: [10, 80, 1]}", "points[3].image_px"},
      {"{position_m: [0, 0.1, 0]}", "points[3]"},
      {"{image_px: [10, 80]}", "points[3]"},
      {"{position_m: here, image_px: [10, 80]}", "points[3]"},
      {"{position_m: [0, a, 0], image_px: [10, 80]}", "points[3]"},
      {"{position_m: [0, .nan, 0], image_px: [10, 80]}", "points[3]"},
      {"{position_m: [0, 0, 0], image_px: [10, .inf]}", "points[3]"},
      {"{position_m: [0, 0, 0], image_px: [10, 80], template: none.png}", "points[3].template"},
      {"{position_m: [0, 0, 0], image_px: [10, 80], template: [1]}", "points[3].template"},
      {"7", "points[3]"}};
  for (const auto& fault : cases) {
    SCOPED_TRACE(fault.last_point);
    const std::string path = writeFile("fault.yaml", knownPointsText(fault.last_point));
    const std::string message = messageOf<std::runtime_error>([&] { readKnownPointsYaml(path); });
    expectNames(message, path);
    expectNames(message, fault.named);
  }
  for (const std::string text :
       {"corners: []\n", "points: 3\n", "- 1\n", "points: [{\n", "points: []\n",
        "points: [{position_m: [0, 0, 0], image_px: [10, 20]}]\n"}) {
    const std::string path = writeFile("fault.yaml", text);
    expectNames(messageOf<std::runtime_error>([&] { readKnownPointsYaml(path); }), path);
  }
}

TEST(KnownPoints, AnEmptyListIsAFaultAndNotAFreeScale) {
  const std::string path = writeFile("empty.yaml", "points: []\n");
  const std::string message = messageOf<std::runtime_error>([&] { readKnownPointsYaml(path); });
  expectNames(message, "0 entries");
  expectNames(message, "at least 4");
}

TEST(KnownPoints, TemplatesThatCanNotBeMatchedAreRefusedWithTheirSize) {
  cv::Mat noise(64, 64, CV_8UC1);
  cv::randu(noise, 0, 256);
  const struct {
    cv::Mat image;
    const char* named;
  } cases[] = {{noise(cv::Rect(0, 0, 10, 10)), "10 x 10"},
               {noise(cv::Rect(0, 0, 11, 13)), "11 x 13"},
               {noise(cv::Rect(0, 0, 3, 3)), "3 x 3"},
               {noise(cv::Rect(0, 0, 33, 33)), "33 x 33"},
               {cv::Mat(11, 11, CV_8UC1, cv::Scalar(80)), "one grey"}};
  for (const auto& fault : cases) {
    cv::imwrite(testing::TempDir() + "/odd_template.png", fault.image);
    const std::string path = writeFile(
        "odd.yaml",
        knownPointsText("{position_m: [0, 1, 0], image_px: [10, 80], template: odd_template.png}"));
    const std::string message = messageOf<std::runtime_error>([&] { readKnownPointsYaml(path); });
    expectNames(message, "points[3].template");
    expectNames(message, fault.named);
  }
}

TEST(KnownPoints, FewerThanFourAreRefused) {
  TrackerOptions options;
  options.known_points.resize(3);
  const std::string message =
      messageOf<std::invalid_argument>([&] { checkTrackerOptions(options); });
  expectNames(message, "known points");
  expectNames(message, "4");
}

TEST(KnownTarget, IsPointsATagOrAChessboard) {
  TrackerOptions options;
  readKnownTargetYaml(writeFile("points.yaml", knownPointsText("{position_m: [0, 1, 0], image_px: "
                                                               "[10, 80]}")),
                      &options);
  EXPECT_EQ(options.known_points.size(), 4u);
  EXPECT_EQ(options.target.kind, TargetDescription::Kind::kNone);

  options = {};
  readKnownTargetYaml(
      writeFile("board.yaml", "kind: chessboard\ncolumns: 8\nrows: 6\nsquare_m: 0.025\n"),
      &options);
  EXPECT_TRUE(options.known_points.empty());
  EXPECT_EQ(options.target.kind, TargetDescription::Kind::kChessboard);
  EXPECT_EQ(options.target.columns, 8);
  EXPECT_EQ(options.target.rows, 6);
  EXPECT_EQ(options.target.square_m, 0.025);

  if (tagDictionaries().empty()) GTEST_SKIP() << "OpenCV came without aruco";
  readKnownTargetYaml(
      writeFile("tag.yaml", "kind: tag\ndictionary: tag36h11\nid: 3\nsize_m: 0.16\n"), &options);
  EXPECT_EQ(options.target.kind, TargetDescription::Kind::kTag);
  EXPECT_EQ(options.target.dictionary, "tag36h11");
  EXPECT_EQ(options.target.id, 3);
  EXPECT_EQ(options.target.size_m, 0.16);
}

TEST(KnownTarget, FaultsAreNamed) {
  const struct {
    const char *text, *named;
  } faults[] = {{"kind: cube\n", "kind is 'cube'"},
                {"kind: [tag]\n", "kind"},
                {"kind: chessboard\ncolumns: 8\nrows: 6\n", "square_m is missing"},
                {"kind: chessboard\ncolumns: 8\nrows: six\nsquare_m: 1\n", "rows"},
                {"kind: chessboard\ncolumns: 8\nrows: 6\nsquare_m: -1\n", "square_m = -1"},
                {"kind: chessboard\ncolumns: 8\nrows: 6\nsquare_m: 1\nsize_m: 1\n", "size_m"},
                {"columns: 8\n", "points"}};
  for (const auto& fault : faults) {
    const std::string path = writeFile("fault.yaml", fault.text);
    TrackerOptions options;
    const std::string message =
        messageOf<std::runtime_error>([&] { readKnownTargetYaml(path, &options); });
    expectNames(message, path);
    expectNames(message, fault.named);
  }
}

}  // namespace
}  // namespace active_matching_slam
