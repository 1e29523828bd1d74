#include "active_matching_slam/math/option_field.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "support/fault.h"

namespace active_matching_slam {
namespace {

struct Garden {
  double length_m = 3.0;
  int trees = 2;
  bool fenced = true;
  std::string gate = "wood";

  template <class Self, class Visitor>
  static void visitFields(Self& o, Visitor&& visit) {
    visit(basicOption("garden/length_m", "m", "from wall to wall"), o.length_m, 1.0, 10.0);
    visit(advancedOption("garden/trees", "", "how many trees").atStartOnly(), o.trees, 0, 4);
    visit(basicOption("garden/fenced", "", "nobody gets in"), o.fenced);
    visit(basicOption("garden/gate", "", "of what it is made"), o.gate);
  }
};

std::string faultIn(const Garden& garden) {
  return faultOf([&] { checkFields(garden); });
}

TEST(OptionFields, AreVisitedInTheirOrderAndCanBeWritten) {
  Garden garden;
  std::string names;
  visitOptions(garden, [&](const OptionField& field, auto& value, const auto&... limits) {
    names += std::string(field.name) + (sizeof...(limits) ? "; " : ", ");
    if constexpr (std::is_same_v<std::decay_t<decltype(value)>, int>) value = 4;
  });
  EXPECT_EQ(names, "garden/length_m; garden/trees; garden/fenced, garden/gate, ");
  EXPECT_EQ(garden.trees, 4);
}

TEST(OptionFields, WithinTheirClosedRangeAreAccepted) {
  for (const double length_m : {1.0, 3.0, 10.0})
    for (const int trees : {0, 4}) EXPECT_EQ(faultIn({length_m, trees}), "");
}

TEST(OptionFields, OutOfItAreRefusedByNameValueAndRange) {
  EXPECT_EQ(faultIn({0.5}), "garden/length_m = 0.5 is out of range [1, 10]");
  EXPECT_EQ(faultIn({3.0, 5}), "garden/trees = 5 is out of range [0, 4]");
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double bad :
       {std::nextafter(1.0, 0.0), std::nextafter(10.0, 11.0), std::nan(""), infinity, -infinity})
    EXPECT_NE(faultIn({bad}).find("garden/length_m"), std::string::npos) << bad;
}

TEST(OptionFields, SayTheirUnit) {
  EXPECT_EQ(basicOption("a", "m/s", "how fast").text(), "how fast [m/s]");
  EXPECT_EQ(basicOption("a", "", "how many").text(), "how many");
}

TEST(OptionFields, AChoiceThatThereIsNotIsRefusedWithThoseThatThereAre) {
  const std::vector<std::string> choices = {"wood", "iron"};
  EXPECT_EQ(faultOf([&] { checkChoice("garden/gate", "iron", choices); }), "");
  EXPECT_EQ(faultOf([&] { checkChoice("garden/gate", "paper", choices); }),
            "garden/gate = 'paper' is not one of wood, iron");
}

}  // namespace
}  // namespace active_matching_slam
