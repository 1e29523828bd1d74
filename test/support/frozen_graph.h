#pragma once

#include <cmath>
#include <cstdint>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "active_matching_slam/information/mutual_information_graph.h"

namespace active_matching_slam {
namespace test {

/// The mutual information graph of a map, and what is known of where its features are.
///
/// Text, "#" begins a comment. One line a feature, in order of initialisation: its group, then what
/// it shares with each feature before it in thousandths of a bit, and "-" where the two were never
/// seen together.
struct FrozenGraph {
  MutualInformationGraph graph;     ///< ids 0, 1, ...; trees are not marked
  std::vector<char> group_of_node;  ///< 'a', 'b', and '.' for neither
};

inline FrozenGraph readFrozenGraph(const std::string& path) {
  std::ifstream file(path);
  if (!file) throw std::runtime_error(path + ": cannot be read");
  FrozenGraph frozen;
  std::string line;
  std::map<std::pair<std::int64_t, std::int64_t>, double> bits;  // links are sorted by their ids
  while (std::getline(file, line)) {
    if (line.empty() || line[0] == '#') continue;
    std::istringstream words(line);
    const auto node = static_cast<std::int64_t>(frozen.group_of_node.size());
    char group = '.';
    words >> group;
    std::string word;
    std::int64_t before = 0;
    for (; words >> word; ++before)
      if (word != "-") bits[{before, node}] = 1e-3 * std::stod(word);
    if (before != node) throw std::runtime_error(path + ": a line of another length: " + line);
    frozen.group_of_node.push_back(group);
    frozen.graph.ids.push_back(node);
  }
  for (const auto& [pair, value] : bits)
    frozen.graph.links.push_back({pair.first, pair.second, value, 1, false});
  return frozen;
}

/// `group_of_node` has an entry for each of graph.ids.
inline void writeFrozenGraph(const std::string& path, const std::string& comment,
                             const MutualInformationGraph& graph,
                             const std::vector<char>& group_of_node) {
  const std::size_t nodes = graph.ids.size();
  const std::vector<WeightedEdge> edges = graphEdges(graph);
  std::vector<std::vector<std::string>> rows(nodes);
  for (std::size_t node = 0; node < nodes; ++node) rows[node].assign(node, "-");
  for (const WeightedEdge& edge : edges)
    rows[edge.second][edge.first] = std::to_string(std::lround(1e3 * edge.weight));
  std::ofstream file(path);
  file << "# " << comment << "\n";
  for (std::size_t node = 0; node < nodes; ++node) {
    file << group_of_node[node];
    for (const std::string& value : rows[node]) file << ' ' << value;
    file << '\n';
  }
  if (!file.flush()) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace test
}  // namespace active_matching_slam
