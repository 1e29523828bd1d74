#include "golden_comparison.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

namespace active_matching_slam::golden {
namespace {

std::string listed(const std::vector<int>& values) {
  std::string text;
  for (const int v : values) text += (text.empty() ? "[" : ", ") + std::to_string(v);
  return text.empty() ? "[]" : text + "]";
}

[[noreturn]] void refuse(const std::string& what) { throw std::runtime_error(what); }

/// A list of `size` numbers (any number when negative).
std::vector<double> numbers(const YAML::Node& node, const std::string& what, int size) {
  if (!node || node.IsNull()) refuse(what + " is missing");
  if (!node.IsSequence()) refuse(what + " is not a list");
  if (size >= 0 && static_cast<int>(node.size()) != size)
    refuse(what + " has " + std::to_string(node.size()) + " entries, must have " +
           std::to_string(size));
  try {
    return node.as<std::vector<double>>();
  } catch (const YAML::Exception&) {
    refuse(what + " holds what is not a number");
  }
}

/// A list of one entry for each feature.
const YAML::Node list(const YAML::Node& node, const std::string& what, int size) {
  if (!node || !node.IsSequence()) refuse(what + " is missing");
  if (static_cast<int>(node.size()) != size)
    refuse(what + " has " + std::to_string(node.size()) + " entries, must have " +
           std::to_string(size));
  return node;
}

template <typename Number>
Number single(const YAML::Node& node, const std::string& what) {
  if (!node || !node.IsScalar()) refuse(what + " is missing");
  try {
    return node.as<Number>();
  } catch (const YAML::Exception&) {
    refuse(what + " is '" + node.Scalar() + "', not a number");
  }
}

bool isPresent(const YAML::Node& node) { return node && !node.IsNull(); }

}  // namespace

Problem readProblem(const YAML::Node& input) {
  if (!input || !input.IsMap()) refuse("input is missing");
  Problem problem;
  const int size = single<int>(input["F"], "input.F");
  if (size < 0) refuse("input.F is negative");
  problem.prior.noise_variance_px2 = single<double>(input["R"], "input.R");
  const std::vector<double> z = numbers(input["z"], "input.z", 2 * size);
  const YAML::Node S = list(input["S"], "input.S", 2 * size);
  problem.prior.z = Eigen::Map<const Eigen::VectorXd>(z.data(), 2 * size);
  problem.prior.S.resize(2 * size, 2 * size);
  for (int i = 0; i < 2 * size; ++i) {
    const auto row = numbers(S[i], "input.S[" + std::to_string(i) + "]", 2 * size);
    problem.prior.S.row(i) = Eigen::Map<const Eigen::RowVectorXd>(row.data(), 2 * size);
  }
  const std::vector<double> ptp = numbers(input["Ptp"], "input.Ptp", size);
  const std::vector<double> pfp = numbers(input["Pfp"], "input.Pfp", size);
  const YAML::Node candidates = list(input["candidates"], "input.candidates", size);
  const YAML::Node scores = list(input["scores"], "input.scores", size);
  for (int f = 0; f < size; ++f) {
    const std::string of = "[" + std::to_string(f) + "]";
    problem.prior.ids.push_back(f);
    problem.prior.rates.push_back(
        {ptp[static_cast<std::size_t>(f)], pfp[static_cast<std::size_t>(f)]});
    problem.points.emplace_back();
    for (const YAML::Node& p : candidates[f]) {
      const std::vector<double> point = numbers(p, "input.candidates" + of, 2);
      problem.points.back().emplace_back(point[0], point[1]);
    }
    problem.scores.push_back(
        numbers(scores[f], "input.scores" + of, static_cast<int>(problem.points.back().size())));
  }
  return problem;
}

std::vector<int> candidatesOf(const PointListSearch& search, int feature,
                              const std::vector<int>& matches) {
  std::vector<int> ids;
  for (const int m : matches)
    ids.push_back(m < 0 ? -1 : search.matches(feature)[static_cast<std::size_t>(m)].id);
  return ids;
}

std::vector<int> candidatePerFeature(const PointListSearch& search,
                                     const std::vector<int>& matches) {
  std::vector<int> ids;
  for (std::size_t f = 0; f < matches.size(); ++f)
    ids.push_back(candidatesOf(search, static_cast<int>(f), {matches[f]})[0]);
  return ids;
}

template <typename Value>
bool Comparison::read(const std::string& what, const YAML::Node& expected, Value& value) {
  ++report_.compared;
  if (!isPresent(expected)) {
    fail(what + " is missing in the file");
    return false;
  }
  try {
    value = expected.as<Value>();
    return true;
  } catch (const YAML::Exception&) {
    fail(what + " is not of the right type in the file");
    return false;
  }
}

void Comparison::number(const std::string& what, const YAML::Node& expected, double actual,
                        double absolute, double relative) {
  double wanted = 0.0;
  if (!read(what, expected, wanted)) return;
  if (std::abs(actual - wanted) <= std::max(absolute, relative * std::abs(wanted))) return;
  std::ostringstream text;
  text.precision(12);
  text << what << " is " << actual << ", must be " << wanted;
  fail(text.str());
}

void Comparison::integer(const std::string& what, const YAML::Node& expected, std::int64_t actual) {
  std::int64_t wanted = 0;
  if (read(what, expected, wanted) && actual != wanted)
    fail(what + " is " + std::to_string(actual) + ", must be " + std::to_string(wanted));
}

void Comparison::integers(const std::string& what, const YAML::Node& expected,
                          const std::vector<int>& actual) {
  std::vector<int> wanted;
  if (read(what, expected, wanted) && actual != wanted)
    fail(what + " is " + listed(actual) + ", must be " + listed(wanted));
}

void Comparison::section(const YAML::Node& file, const std::string& name,
                         const std::function<void(const YAML::Node&)>& check) {
  const YAML::Node part = file[name];
  if (!isPresent(part)) return;
  try {
    check(part);
  } catch (const std::exception& error) {
    fail(name + ": " + error.what());
  }
}

}  // namespace active_matching_slam::golden
