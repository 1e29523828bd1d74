#pragma once

#include <random>
#include <utility>

#include "active_matching_slam/information/mutual_information_graph.h"
#include "active_matching_slam/information/submap_hierarchy.h"

namespace active_matching_slam {
namespace test {

/// `density`: fraction of pairs that have a link; `levels` distinct weights, few for many ties.
inline MutualInformationGraph randomGraph(int features, unsigned seed, double density = 1.0,
                                          int levels = 1000000) {
  std::mt19937 generator(seed);
  MutualInformationGraph graph;
  for (int i = 0; i < features; ++i) {
    graph.ids.push_back(10 * i + 1);
    for (int k = i + 1; k < features; ++k) {
      const bool linked = generator() % 1000 < 1000 * density;
      const double bits = 4.0 * (1 + generator() % levels) / levels;
      if (linked) graph.links.push_back({10 * i + 1, 10 * k + 1, bits, 1, false});
    }
  }
  return graph;
}

/// A graph and its hierarchy.
struct GraphStructure {
  explicit GraphStructure(MutualInformationGraph given)
      : graph(std::move(given)), hierarchy(buildSubmapHierarchy(graph)) {}
  MutualInformationGraph graph;
  SubmapHierarchy hierarchy;
};

}  // namespace test
}  // namespace active_matching_slam
