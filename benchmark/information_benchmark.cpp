// Cost of the information in a frame's prediction, by the number of features: the features'
// information by one factorisation against the plain formula (Chli 2009, eq. 4.31), all pairs, the
// Chow-Liu tree, and conditioning on one feature after another, dense and by messages along the
// tree. Complexity is fitted to the number of features.

#include <benchmark/benchmark.h>

#include <vector>

#include "../src/matching/joint.h"
#include "active_matching_slam/evaluation/simulated_problem.h"
#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/information/gaussian_information.h"

namespace active_matching_slam {
namespace {

Eigen::MatrixXd covarianceOf(const benchmark::State& state) {
  SimulatedProblemOptions options;
  options.features = static_cast<int>(state.range(0));
  options.width = 1024;
  options.height = 768;
  return ProblemSimulator(options, 1).next().prior.S;
}

void report(benchmark::State& state) {
  state.SetComplexityN(state.range(0));
  state.counters["features"] = static_cast<double>(state.range(0));
}

void plainInformation(benchmark::State& state) {
  const Eigen::MatrixXd S = covarianceOf(state);
  for (auto _ : state)
    for (int f = 0; f < state.range(0); ++f)
      benchmark::DoNotOptimize(partitionInformationBits(S, {2 * f, 2 * f + 1}));
  report(state);
}

void oneFactorisation(benchmark::State& state) {
  const Eigen::MatrixXd S = covarianceOf(state);
  for (auto _ : state) benchmark::DoNotOptimize(featureInformation(S));
  report(state);
}

void pairInformation(benchmark::State& state) {
  const Eigen::MatrixXd S = covarianceOf(state);
  for (auto _ : state) benchmark::DoNotOptimize(pairInformationMatrix(S));
  report(state);
}

void tree(benchmark::State& state) {
  const Eigen::MatrixXd S = covarianceOf(state);
  for (auto _ : state) benchmark::DoNotOptimize(chowLiuTree(S));
  report(state);
}

void treeInformation(benchmark::State& state) {
  const ChowLiuTree tree = chowLiuTree(covarianceOf(state));
  for (auto _ : state) benchmark::DoNotOptimize(treeInformationBits(tree));
  report(state);
}

/// Every feature measured once, in index order.
void measureAll(benchmark::State& state, const Joint& joint) {
  for (auto _ : state) {
    auto given = joint.prior();
    for (int f = 0; f < joint.size(); ++f) given = joint.measure(given, f);
    benchmark::DoNotOptimize(given);
  }
  report(state);
}

void measureAllDense(benchmark::State& state) {
  const Eigen::MatrixXd S = covarianceOf(state);
  measureAll(state, *makeDenseJoint(S, featureInformation(S).precision_determinant,
                                    Eigen::VectorXd::Ones(S.rows() / 2)));
}

void measureAllByMessages(benchmark::State& state) {
  const ChowLiuTree tree = chowLiuTree(covarianceOf(state));
  measureAll(state, *makeTreeJoint(tree, Eigen::VectorXd::Ones(tree.size())));
}

#define AMS_FEATURES                  \
  ArgName("features")                 \
      ->RangeMultiplier(2)            \
      ->Range(25, 400)                \
      ->Unit(benchmark::kMicrosecond) \
      ->Complexity()

BENCHMARK(plainInformation)
    ->ArgName("features")
    ->RangeMultiplier(2)
    ->Range(25, 200)
    ->Unit(benchmark::kMicrosecond)
    ->Complexity();
BENCHMARK(oneFactorisation)->AMS_FEATURES;
BENCHMARK(pairInformation)->AMS_FEATURES;
BENCHMARK(tree)->AMS_FEATURES;
BENCHMARK(treeInformation)->AMS_FEATURES;
BENCHMARK(measureAllDense)->AMS_FEATURES;
BENCHMARK(measureAllByMessages)->AMS_FEATURES;

}  // namespace
}  // namespace active_matching_slam

BENCHMARK_MAIN();
