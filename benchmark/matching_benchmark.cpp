// Cost of whole matchings of a frame, image work included, on one core.
//
// Cases `match/<matcher>/<features>/<width>x<height>/<hz>`: templates searched in a textured image
// by correlation, motion of a hand-held camera, clutter as the images give it (its rate is counted
// and printed); `latch` cases have the stop rule on. Counters: median and 90th percentile of a
// frame, time split, pixels, searches, most Gaussians, and the modelled time that budgets count,
// over the measured. Cases `plain/...` and `shortcut/...`: the thesis's formulas against the exact
// identities that replace them. At the end the exponents of cost in the number of features, and
// each shortcut's gain.

#include <benchmark/benchmark.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numeric>
#include <opencv2/imgproc.hpp>
#include <random>
#include <string>
#include <vector>

#include "../src/matching/joint.h"
#include "active_matching_slam/evaluation/simulated_problem.h"
#include "active_matching_slam/image/image_feature_search.h"
#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/matcher.h"
#include "thread_seconds.h"

namespace active_matching_slam {
namespace {

struct ImageProblem {
  MeasurementPrior prior;
  std::vector<Eigen::Vector2d> true_pixel;
  cv::Mat image;
  std::vector<Template> templates;
};

/// A frame whose texture is looked up where the features truly are.
std::vector<ImageProblem> imageProblems(const SimulatedProblemOptions& options, int count) {
  std::vector<ImageProblem> problems;
  ProblemSimulator simulator(options, 1);
  cv::RNG random(7);
  for (int n = 0; n < count; ++n) {
    const SimulatedProblem drawn = simulator.next();
    // Detail of little more than a pixel's size: templates of wider blobs would all look alike.
    cv::Mat texture(options.height, options.width, CV_8UC1);
    random.fill(texture, cv::RNG::UNIFORM, 0, 256);
    cv::GaussianBlur(texture, texture, cv::Size(), 1.25);
    cv::normalize(texture, texture, 0, 255, cv::NORM_MINMAX);
    ImageProblem problem;
    problem.prior = drawn.prior;
    problem.true_pixel = drawn.true_pixel;
    for (const Eigen::Vector2d& p : drawn.true_pixel) {
      const int u = std::clamp(static_cast<int>(std::lround(p.x())), 8, options.width - 9);
      const int v = std::clamp(static_cast<int>(std::lround(p.y())), 8, options.height - 9);
      const auto patch = makeTemplate(texture(cv::Rect(u - 5, v - 5, 11, 11)));
      problem.templates.push_back(patch ? *patch : Template());
    }
    cv::Mat noise(texture.size(), CV_16SC1), noisy;
    random.fill(noise, cv::RNG::NORMAL, 0, 4);
    texture.convertTo(noisy, CV_16SC1);
    noisy += noise;
    noisy.convertTo(problem.image, CV_8UC1);
    problems.push_back(std::move(problem));
  }
  return problems;
}

/// How often the images answer rightly, and spuriously per pixel, counted over all full gates: what
/// a tracker would have learnt.
FeatureRates countedRates(const std::vector<ImageProblem>& problems) {
  double features = 0.0, found = 0.0, pixels = 0.0, spurious = 0.0;
  ImageFeatureSearch search{ImageOptions()};
  for (const ImageProblem& problem : problems) {
    search.beginFrame(problem.image, problem.templates);
    for (int f = 0; f < problem.prior.size(); ++f) {
      search.search(f, {problem.prior.mean(f), problem.prior.covariance(f)});
      if (!search.searchedPixels(f).contains(
              static_cast<int>(std::lround(problem.true_pixel[static_cast<std::size_t>(f)].x())),
              static_cast<int>(std::lround(problem.true_pixel[static_cast<std::size_t>(f)].y()))))
        continue;  // at the border, or among the 1 % that lie outside
      bool is_found = false;
      for (const SearchMatch& match : search.matches(f)) {
        const bool right =
            (match.pixel - problem.true_pixel[static_cast<std::size_t>(f)]).norm() < 1.5;
        is_found |= right;
        spurious += !right;
      }
      features += 1.0;
      found += is_found;
      pixels += static_cast<double>(search.searchedPixels(f).size());
    }
  }
  return {(found + 1.0) / (features + 2.0), (spurious + 1.0) / (pixels + 1e4)};
}

const std::vector<ImageProblem>& cachedProblems(int features, int width, int height, double rate) {
  static std::map<std::string, std::vector<ImageProblem>> cache;
  SimulatedProblemOptions options;
  options.features = features;
  options.width = width;
  options.height = height;
  options.rate_hz = rate;
  const std::string key = std::to_string(features) + "/" + std::to_string(width) + "/" +
                          std::to_string(height) + "/" + std::to_string(rate);
  auto& problems = cache[key];
  if (!problems.empty()) return problems;
  problems = imageProblems(options, 16);
  const FeatureRates rates = countedRates(problems);
  std::fprintf(stderr,
               "%d features, %dx%d, %g Hz: the images answer with Ptp %.3f, Pfp %.1e per pixel\n",
               features, width, height, rate, rates.true_positive, rates.false_positive);
  for (ImageProblem& problem : problems)
    problem.prior.rates.assign(static_cast<std::size_t>(problem.prior.size()), rates);
  return problems;
}

/// Median milliseconds by [matcher][features], for the exponents.
std::map<std::string, std::map<int, double>>& medians() {
  static std::map<std::string, std::map<int, double>> table;
  return table;
}

void matchFrames(benchmark::State& state, const std::string& label, const std::string& matcher,
                 int features, int width, int height, double rate, const MatchOptions& options) {
  const auto& problems = cachedProblems(features, width, height, rate);
  const auto instance = createMatcher(matcher);
  ImageFeatureSearch search{ImageOptions()};
  std::vector<double> milliseconds;
  MatchStatistics sum;
  std::size_t next = 0;
  for (auto _ : state) {
    const ImageProblem& problem = problems[next++ % problems.size()];
    const double start = threadSeconds();
    search.beginFrame(problem.image, problem.templates);
    const MatchResult result = instance->match(problem.prior, search, options);
    milliseconds.push_back(1e3 * (threadSeconds() - start));
    const MatchStatistics& s = result.statistics;
    sum.pixels_searched += s.pixels_searched;
    sum.pixels_full_gates += s.pixels_full_gates;
    sum.searches += s.searches;
    sum.matched += s.matched;
    sum.matches_met += s.matches_met;
    sum.max_gaussians = std::max(sum.max_gaussians, s.max_gaussians);
    sum.information_ms += s.information_ms;
    sum.correlation_ms += s.correlation_ms;
    sum.mixture_ms += s.mixture_ms;
    sum.tree_ms += s.tree_ms;
    sum.budget_ms += s.budget_ms;
  }
  state.counters["modelled"] =
      sum.budget_ms / std::accumulate(milliseconds.begin(), milliseconds.end(), 0.0);
  std::sort(milliseconds.begin(), milliseconds.end());
  const double frames = static_cast<double>(milliseconds.size());
  const double median = milliseconds[milliseconds.size() / 2];
  state.counters["median_ms"] = median;
  state.counters["p90_ms"] = milliseconds[milliseconds.size() * 9 / 10];
  state.counters["information_ms"] = sum.information_ms / frames;
  state.counters["correlation_ms"] = sum.correlation_ms / frames;
  state.counters["mixture_ms"] = sum.mixture_ms / frames;
  state.counters["tree_ms"] = sum.tree_ms / frames;
  state.counters["pixels"] = static_cast<double>(sum.pixels_searched) / frames;
  state.counters["full_gates"] = static_cast<double>(sum.pixels_full_gates) / frames;
  state.counters["searches"] = sum.searches / frames;
  state.counters["matched"] = sum.matched / frames;
  state.counters["met"] = sum.matches_met / frames;
  state.counters["most_gaussians"] = sum.max_gaussians;
  if (width == 1024 && rate == 30.0) medians()[label][features] = median;
}

void registerMatch(const std::string& matcher, int features, int width, int height, int rate,
                   bool latch) {
  MatchOptions options;
  options.max_gaussians = 64;
  options.modelled_time = true;
  if (latch) options.latch_information_bits = 0.1;
  const std::string label = matcher + (latch ? "+latch" : "");
  const std::string name = "match/" + label + "/" + std::to_string(features) + "/" +
                           std::to_string(width) + "x" + std::to_string(height) + "/" +
                           std::to_string(rate);
  benchmark::RegisterBenchmark(name.c_str(),
                               [=](benchmark::State& state) {
                                 matchFrames(state, label, matcher, features, width, height, rate,
                                             options);
                               })
      ->Iterations(features >= 200 ? 16 : 48)
      ->Unit(benchmark::kMillisecond);
}

// Exact shortcuts against the plain formulas.

constexpr int kShortcutFeatures = 50;

Eigen::MatrixXd shortcutCovariance() {
  SimulatedProblemOptions options;
  options.features = kShortcutFeatures;
  return ProblemSimulator(options, 1).next().prior.S;
}

double log2Determinant(const Eigen::MatrixXd& S) {
  return 2.0 * S.llt().matrixLLT().diagonal().array().log().sum() / std::log(2.0);
}

Eigen::MatrixXd without(const Eigen::MatrixXd& S, int f) {
  const Eigen::Index n = S.rows() - 2, k = 2 * f;
  Eigen::MatrixXd rest(n, n);
  rest.topLeftCorner(k, k) = S.topLeftCorner(k, k);
  rest.topRightCorner(k, n - k) = S.topRightCorner(k, n - k);
  rest.bottomLeftCorner(n - k, k) = S.bottomLeftCorner(n - k, k);
  rest.bottomRightCorner(n - k, n - k) = S.bottomRightCorner(n - k, n - k);
  return rest;
}

/// Eq. 4.31 as it stands.
Eigen::VectorXd plainInformation(const Eigen::MatrixXd& S) {
  const double whole = log2Determinant(S);
  Eigen::VectorXd bits(S.rows() / 2);
  for (int f = 0; f < bits.size(); ++f)
    bits(f) = 0.5 * (log2Determinant(S.block<2, 2>(2 * f, 2 * f)) + log2Determinant(without(S, f)) -
                     whole);
  return bits;
}

/// S after features 0, 1, ... are measured, by whole conditional covariances.
Eigen::MatrixXd plainConditional(const Eigen::MatrixXd& S, int c) {
  const Eigen::MatrixXd gain = S.middleCols<2>(2 * c) * S.block<2, 2>(2 * c, 2 * c).inverse();
  return S - gain * S.middleRows<2>(2 * c);
}

std::map<std::string, double>& shortcutSeconds() {
  static std::map<std::string, double> table;
  return table;
}

void registerShortcut(const std::string& name, std::function<double()> work) {
  benchmark::RegisterBenchmark(name.c_str(), [=](benchmark::State& state) {
    const double start = threadSeconds();
    for (auto _ : state) benchmark::DoNotOptimize(work());
    shortcutSeconds()[name] = (threadSeconds() - start) / static_cast<double>(state.iterations());
  })->Unit(benchmark::kMicrosecond);
}

void registerShortcuts() {
  const Eigen::MatrixXd S = shortcutCovariance();
  registerShortcut("plain/A features' information", [S] { return plainInformation(S).sum(); });
  registerShortcut("shortcut/A features' information",
                   [S] { return featureInformation(S).bits.sum(); });
  // B: the information of all features left after one measurement.
  const Eigen::MatrixXd after =
      plainConditional(S, 0).bottomRightCorner(S.rows() - 2, S.rows() - 2);
  const Eigen::VectorXd precision = featureInformation(S).precision_determinant;
  registerShortcut("plain/B information after a measurement",
                   [after] { return featureInformation(after).bits.sum(); });
  registerShortcut("shortcut/B information after a measurement", [after, precision] {
    double bits = 0.0;
    for (int f = 0; 2 * f < after.rows(); ++f)
      bits += informationBits(after.block<2, 2>(2 * f, 2 * f).determinant(), precision(f + 1));
    return bits;
  });
  registerShortcut("plain/C all measurements in turn", [S] {
    Eigen::MatrixXd conditional = S;
    for (int c = 0; c + 1 < kShortcutFeatures; ++c) {
      conditional = plainConditional(conditional, c);
      // What is measured has no variance left; its rows play no further part.
      conditional.middleRows<2>(2 * c).setZero();
      conditional.middleCols<2>(2 * c).setZero();
    }
    return conditional.trace();
  });
  registerShortcut("shortcut/C all measurements in turn", [S, precision] {
    const auto joint = makeDenseJoint(S, precision, Eigen::VectorXd::Ones(S.rows() / 2));
    auto given = joint->prior();
    for (int c = 0; c + 1 < kShortcutFeatures; ++c) given = joint->measure(given, c);
    return given->marginal(kShortcutFeatures - 1).covariance.trace();
  });
  // D: eq. 5.5-5.8 for a search of 1000 pixels with two matches.
  const volatile double ptp = 0.9, pfp = 1e-4, pixels = 1000.0, matches = 2.0;
  registerShortcut("plain/D likelihoods of a search", [&] {
    const double out = std::pow(pfp, matches) * std::pow(1.0 - pfp, pixels - matches);
    const double in =
        std::pow(pfp, matches) * (1.0 - ptp) * std::pow(1.0 - pfp, pixels - matches - 1);
    const double match = ptp * std::pow(pfp, matches - 1) * std::pow(1.0 - pfp, pixels - matches);
    return in / out + match / out;
  });
  registerShortcut("shortcut/D likelihoods of a search",
                   [&] { return (1.0 - ptp) / (1.0 - pfp) + ptp / pfp; });
  const ChowLiuTree tree = chowLiuTree(S);
  registerShortcut("plain/E information in the tree",
                   [tree] { return plainInformation(treeCovariance(tree)).sum(); });
  registerShortcut("shortcut/E information in the tree",
                   [tree] { return treeInformationBits(tree).sum(); });
}

void registerMatches() {
  for (const char* matcher :
       {"active_search", "one_point_ransac", "jcbb", "active", "fast_active", "chow_liu"}) {
    registerMatch(matcher, 11, 640, 480, 30, false);
    registerMatch(matcher, 11, 640, 480, 15, false);
    registerMatch(matcher, 40, 1024, 768, 30, false);
    registerMatch(matcher, 100, 1024, 768, 30, false);
    registerMatch(matcher, 100, 1024, 768, 15, false);
  }
  for (const char* matcher : {"active", "chow_liu"}) {
    for (const int features : {25, 50, 200, 400})
      registerMatch(matcher, features, 1024, 768, 30, false);
    for (const int features : {25, 50, 100, 200, 400})
      registerMatch(matcher, features, 1024, 768, 30, true);
  }
}

/// Slope of log(cost) over log(features), least squares.
double exponentOf(const std::map<int, double>& cost) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const auto& [features, milliseconds] : cost) {
    const double a = std::log(features), b = std::log(milliseconds);
    n += 1, x += a, y += b, xx += a * a, xy += a * b;
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

void printSummary() {
  for (const auto& [label, cost] : medians())
    if (cost.size() > 2)
      std::fprintf(stderr, "%-20s grows with features ^ %.2f (%d to %d)\n", label.c_str(),
                   exponentOf(cost), cost.begin()->first, cost.rbegin()->first);
  for (const auto& [name, seconds] : shortcutSeconds()) {
    if (name.rfind("plain/", 0) != 0) continue;
    const auto shortcut = shortcutSeconds().find("shortcut/" + name.substr(6));
    if (shortcut == shortcutSeconds().end()) continue;
    std::fprintf(stderr, "shortcut %-40s %10.2f us -> %8.2f us, %.1f times faster\n",
                 name.substr(6).c_str(), 1e6 * seconds, 1e6 * shortcut->second,
                 seconds / shortcut->second);
  }
}

}  // namespace
}  // namespace active_matching_slam

int main(int argc, char** argv) {
  benchmark::Initialize(&argc, argv);
  if (benchmark::ReportUnrecognizedArguments(argc, argv)) return 1;
  active_matching_slam::registerMatches();
  active_matching_slam::registerShortcuts();
  benchmark::RunSpecifiedBenchmarks();
  active_matching_slam::printSummary();
  return 0;
}
