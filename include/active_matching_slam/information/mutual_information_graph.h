#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "active_matching_slam/information/spanning_tree.h"

namespace active_matching_slam {

/// A link between two features: mutual information averaged over the frames that saw both.
struct InformationLink {
  std::int64_t first = -1, second = -1;  ///< feature ids, first < second
  double information_bits = 0.0;
  int frames = 0;        ///< in how many frames both were candidates
  bool in_tree = false;  ///< part of the maximum spanning forest
};

/// A snapshot of the MI graph of the map (Chli 2009, section 6.2.2).
struct MutualInformationGraph {
  std::vector<std::int64_t> ids;  ///< ascending
  std::vector<InformationLink>
      links;  ///< sorted by (first, second); pairs never seen together: none
};

/// The graph of a single covariance: `S` is the 2F x 2F joint covariance of the image points of
/// `ids` [px^2], in any order. Features that are not usable (see gaussian_information.h) are left
/// out. The tree is marked. Throws std::invalid_argument when sizes differ or an id is given twice.
MutualInformationGraph informationGraph(const std::vector<std::int64_t>& ids,
                                        const Eigen::Ref<const Eigen::MatrixXd>& S);

/// The links as edges between indices of `ids`, in the order of `links`. Throws
/// std::invalid_argument unless ids and links are sorted as above and every link's ids are known.
std::vector<WeightedEdge> graphEdges(const MutualInformationGraph& graph);

/// Sets every link's `in_tree`.
void markTree(MutualInformationGraph& graph);

}  // namespace active_matching_slam
