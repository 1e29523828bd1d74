#include "active_matching_slam/information/mutual_information_graph.h"

#include <stdexcept>
#include <string>

#include "active_matching_slam/information/mutual_information_accumulator.h"

namespace active_matching_slam {

MutualInformationGraph informationGraph(const std::vector<std::int64_t>& ids,
                                        const Eigen::Ref<const Eigen::MatrixXd>& S) {
  MutualInformationAccumulator single;
  single.addFrame(ids, S);
  MutualInformationGraph graph = single.links();
  markTree(graph);
  return graph;
}

std::vector<WeightedEdge> graphEdges(const MutualInformationGraph& graph) {
  const int nodes = static_cast<int>(graph.ids.size());
  for (int i = 1; i < nodes; ++i) {
    if (graph.ids[i - 1] < graph.ids[i]) continue;
    throw std::invalid_argument("ids holds " + std::to_string(graph.ids[i]) + " after " +
                                std::to_string(graph.ids[i - 1]) + ", allowed: ascending");
  }
  std::vector<WeightedEdge> edges;
  edges.reserve(graph.links.size());
  int first = 0, second = 0;  // links are sorted as ids are, so both only walk on
  for (const InformationLink& link : graph.links) {
    while (first < nodes && graph.ids[first] < link.first) second = ++first;
    while (second < nodes && graph.ids[second] < link.second) ++second;
    const bool known = first < nodes && second < nodes && graph.ids[first] == link.first &&
                       graph.ids[second] == link.second && first < second;
    const bool repeated =
        !edges.empty() && edges.back().first == first && edges.back().second == second;
    if (!known || repeated) {
      throw std::invalid_argument("link (" + std::to_string(link.first) + ", " +
                                  std::to_string(link.second) +
                                  "), allowed: known ids, first < second, sorted, each once");
    }
    edges.push_back({first, second, link.information_bits});
  }
  return edges;
}

void markTree(MutualInformationGraph& graph) {
  for (InformationLink& link : graph.links) link.in_tree = false;
  for (const BoruvkaLink& link :
       boruvkaRounds(static_cast<int>(graph.ids.size()), graphEdges(graph))) {
    graph.links[link.edge_index].in_tree = true;
  }
}

}  // namespace active_matching_slam
