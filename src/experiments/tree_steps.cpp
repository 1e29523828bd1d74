// Figure 7.6: Chow-Liu Active Matching of one frame step by step: a tree that each match cuts.

#include <algorithm>
#include <set>

#include "active_matching_slam/information/chow_liu_tree.h"
#include "active_matching_slam/visualisation/debug_canvas.h"
#include "match_replay.h"
#include "workbench.h"

namespace active_matching_slam {
namespace {

using Edges = std::vector<std::pair<int, int>>;

std::vector<int> degreesOf(const Edges& edges, int features) {
  std::vector<int> degrees(static_cast<std::size_t>(features), 0);
  for (const auto& [i, k] : edges) {
    ++degrees[static_cast<std::size_t>(i)];
    ++degrees[static_cast<std::size_t>(k)];
  }
  return degrees;
}

/// Features in the largest part of the tree once the links of these are cut.
int largestSubtree(const Edges& edges, int features, const std::set<int>& cut) {
  DisjointSets sets(features);
  for (const auto& [i, k] : edges)
    if (!cut.count(i) && !cut.count(k)) sets.unite(i, k);
  std::vector<int> sizes(static_cast<std::size_t>(features), 0);
  for (const int label : sets.labels()) ++sizes[static_cast<std::size_t>(label)];
  return *std::max_element(sizes.begin(), sizes.end());
}

/// The joint Gaussian that the tree stands for.
JointPoints treeJoint(const MeasurementPrior& prior, const Edges& edges) {
  std::vector<WeightedEdge> weighted;
  for (const auto& [i, k] : edges) weighted.push_back({i, k, 1.0});
  return {prior.z, treeCovariance(treeOf(prior.S, weighted))};
}

cv::Mat drawTree(const cv::Mat& image, const JointPoints& joint, const Edges& edges,
                 const std::set<int>& measured, std::size_t count) {
  DebugCanvas canvas(image);
  for (const auto& [i, k] : edges)
    if (!measured.count(i) && !measured.count(k))
      canvas.line(joint.mean(i), joint.mean(k), {60, 220, 255}, 1.5);
  drawJoint(joint, {80, 220, 80}, &canvas);
  return captioned(canvas.image(), canvas.unit(), text("after %zu matches", count));
}

}  // namespace

ExperimentResult runTreeSteps(Workbench& bench) {
  Table table({"sequence", "image", "matches", "features", "largest_subtree", "cut_links"});
  ExperimentResult result;
  int frames = 0, nearer = 0;
  double first_degree = 0.0, mean_degree = 0.0, near_bits = 0.0, far_bits = 0.0;
  double after_tenth = 0.0, after_third = 0.0;
  for (const std::string& name : bench.testBedSequences()) {
    RecordingOptions options;
    options.every = 4;
    options.features = bench.featureCounts().back();
    options.problems = bench.quick() ? 4 : 8;
    const Sequence& sequence = bench.sequence(name);
    const std::vector<RecordedProblem>& problems = bench.recording(name, options).problems;
    for (std::size_t p = 0; p < problems.size(); ++p) {
      const RecordedProblem& problem = problems[p];
      const MatchingTrial trial = tryMatcher(sequence, problem, matcherVariant("chow_liu"), true);
      const MatchReplay replay(trial);
      const std::vector<MatchReplay::Match>& matches = replay.matchesOf(replay.accepted());
      const Edges& edges = trial.result.tree_edges;
      const int features = problem.prior.size();
      if (matches.size() < 3 || edges.empty()) continue;
      const JointPoints before = treeJoint(problem.prior, edges);
      JointPoints now = before;
      std::set<int> measured;
      const bool is_drawn = name == bench.mainSequence() && p == problems.size() / 2;
      std::vector<cv::Mat> panels;
      const std::set<std::size_t> shown = {1, 2, 4, matches.size() / 3, matches.size()};
      const cv::Mat& image = sequence.images[static_cast<std::size_t>(problem.image)];
      if (is_drawn) panels.push_back(drawTree(image, now, edges, measured, 0));
      for (std::size_t k = 0; k < matches.size(); ++k) {
        now.condition(matches[k].feature, matches[k].pixel);
        measured.insert(matches[k].feature);
        const int largest = largestSubtree(edges, features, measured);
        const auto cut = std::count_if(edges.begin(), edges.end(), [&](const auto& edge) {
          return measured.count(edge.first) || measured.count(edge.second);
        });
        table.add({name, problem.image, static_cast<int>(k) + 1, features, largest,
                   static_cast<long>(cut)});
        if (k + 1 == static_cast<std::size_t>(features + 9) / 10)
          after_tenth += static_cast<double>(largest) / features;
        if (k + 1 == static_cast<std::size_t>(features + 2) / 3)
          after_third += static_cast<double>(largest) / features;
        if (k == 0) {
          std::vector<int> near, far;
          for (int f = 0; f < features; ++f) {
            if (f == matches[0].feature) continue;
            const bool is_near = std::any_of(edges.begin(), edges.end(), [&](const auto& edge) {
              return (edge.first == f && edge.second == matches[0].feature) ||
                     (edge.second == f && edge.first == matches[0].feature);
            });
            (is_near ? near : far).push_back(f);
          }
          const double of_near = meanShrinkBits(before, now, near),
                       of_far = meanShrinkBits(before, now, far);
          near_bits += of_near;
          far_bits += of_far;
          nearer += of_near > of_far;
        }
        if (is_drawn && shown.count(k + 1))
          panels.push_back(drawTree(image, now, edges, measured, k + 1));
      }
      const std::vector<int> degrees = degreesOf(edges, features);
      first_degree += degrees[static_cast<std::size_t>(matches[0].feature)];
      mean_degree += 2.0 * static_cast<double>(edges.size()) / features;
      ++frames;
      if (is_drawn) result.pictures.emplace_back("", tilePictures(panels, 2));
    }
  }
  result.tables.emplace_back("", table);
  if (frames == 0) return result;
  result.findings.push_back({"links of the feature that is matched first, and of one on average",
                             "hub-like, in the midst of the image",
                             text("%.1f, %.1f", first_degree / frames, mean_degree / frames),
                             verdict(first_degree > 1.5 * mean_degree)});
  result.findings.push_back(
      {"bits by which its match shrinks the ellipses of its neighbours in the tree, of the others",
       "neighbours become more certain than the rest",
       text("%.2f, %.2f; more in %d of %d frames", near_bits / frames, far_bits / frames, nearer,
            frames),
       verdict(nearer == frames)});
  result.findings.push_back(
      {"largest part of the tree, once a tenth, once a third of the features are matched",
       "each match partitions the problem of matching further",
       text("%.0f %%, %.0f %% of the features", 100.0 * after_tenth / frames,
            100.0 * after_third / frames),
       verdict(after_third < 0.5 * frames)});
  return result;
}

}  // namespace active_matching_slam
