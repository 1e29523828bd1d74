#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <map>
#include <vector>

#include "active_matching_slam/information/mutual_information_graph.h"

namespace active_matching_slam {

/// Averages the pairwise mutual information of features over the frames in which both were
/// predicted visible (Chli 2009, section 6.2.2). Memory is proportional to the pairs ever seen
/// together; a frame costs O(F^2) for its F features plus a walk along their links.
class MutualInformationAccumulator {
 public:
  MutualInformationAccumulator() = default;
  /// Goes on from a graph, for example of a stored map. Throws as graphEdges() does, and when a
  /// link's bits are not finite or negative or its frames are less than 1.
  explicit MutualInformationAccumulator(const MutualInformationGraph& graph);

  /// Adds one frame: the features predicted visible, in any order, and the joint covariance of
  /// their image points, 2F x 2F [px^2]. A feature whose own covariance is not usable does not
  /// count as seen. Throws std::invalid_argument when sizes differ or an id is given twice.
  void addFrame(const std::vector<std::int64_t>& ids, const Eigen::Ref<const Eigen::MatrixXd>& S);

  /// Forgets a feature and its links. An unknown id is no fault.
  void remove(std::int64_t id);
  /// Forgets, of the features that are not among `ids` (in any order), all but `most`: those of the
  /// least information with all others go first. Amortised: nothing happens before there are a
  /// tenth more.
  void forgetWeakest(std::vector<std::int64_t> ids, int most);
  void clear() { features_.clear(); }

  /// The links so far. The tree is not marked: see markTree() and buildSubmapHierarchy().
  MutualInformationGraph links() const;

 private:
  struct Partner {
    std::int64_t id;  ///< higher than the feature's own
    double sum_bits;
    int frames;
  };
  using Partners = std::vector<Partner>;  ///< by ascending id

  std::map<std::int64_t, Partners> features_;
};

}  // namespace active_matching_slam
