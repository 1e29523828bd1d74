#include "golden_comparison.h"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace active_matching_slam::golden {
namespace {

std::string listed(const std::vector<int>& values) {
  std::string text;
  for (const int v : values) text += (text.empty() ? "[" : ", ") + std::to_string(v);
  return text.empty() ? "[]" : text + "]";
}

}  // namespace

Problem readProblem(const YAML::Node& input) {
  Problem problem;
  const int size = input["F"].as<int>();
  problem.prior.z.resize(2 * size);
  problem.prior.S.resize(2 * size, 2 * size);
  problem.prior.noise_variance_px2 = input["R"].as<double>();
  for (int i = 0; i < 2 * size; ++i) {
    problem.prior.z(i) = input["z"][i].as<double>();
    const YAML::Node row = input["S"][i];
    for (int j = 0; j < 2 * size; ++j) problem.prior.S(i, j) = row[j].as<double>();
  }
  for (int f = 0; f < size; ++f) {
    problem.prior.ids.push_back(f);
    problem.prior.rates.push_back({input["Ptp"][f].as<double>(), input["Pfp"][f].as<double>()});
    problem.points.emplace_back();
    for (const YAML::Node& p : input["candidates"][f])
      problem.points.back().emplace_back(p[0].as<double>(), p[1].as<double>());
    problem.scores.push_back(input["scores"][f].as<std::vector<double>>());
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

void Comparison::number(const std::string& what, const YAML::Node& expected, double actual,
                        double absolute, double relative) {
  ++report_.compared;
  const double wanted = expected.as<double>();
  if (std::abs(actual - wanted) <= std::max(absolute, relative * std::abs(wanted))) return;
  std::ostringstream text;
  text.precision(12);
  text << what << " is " << actual << ", must be " << wanted;
  fail(text.str());
}

void Comparison::integer(const std::string& what, const YAML::Node& expected, std::int64_t actual) {
  ++report_.compared;
  const auto wanted = expected.as<std::int64_t>();
  if (actual != wanted)
    fail(what + " is " + std::to_string(actual) + ", must be " + std::to_string(wanted));
}

void Comparison::integers(const std::string& what, const YAML::Node& expected,
                          const std::vector<int>& actual) {
  ++report_.compared;
  const auto wanted = expected.as<std::vector<int>>();
  if (actual != wanted) fail(what + " is " + listed(actual) + ", must be " + listed(wanted));
}

}  // namespace active_matching_slam::golden
