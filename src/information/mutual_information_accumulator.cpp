#include "active_matching_slam/information/mutual_information_accumulator.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>
#include <string>
#include <utility>

#include "active_matching_slam/information/pair_dependence.h"

namespace active_matching_slam {
namespace {

/// Features beyond what is kept, as a part of it, before some are forgotten. Cost: a pass over all
/// links each time.
constexpr std::size_t kSpare = 10;

/// Indices of the frame's features by ascending id.
std::vector<int> orderById(const std::vector<std::int64_t>& ids) {
  std::vector<int> order(ids.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return ids[a] < ids[b]; });
  for (std::size_t k = 1; k < order.size(); ++k) {
    if (ids[order[k - 1]] == ids[order[k]]) {
      throw std::invalid_argument("ids holds " + std::to_string(ids[order[k]]) +
                                  " twice, allowed: once");
    }
  }
  return order;
}

}  // namespace

MutualInformationAccumulator::MutualInformationAccumulator(const MutualInformationGraph& graph) {
  graphEdges(graph);
  for (std::int64_t id : graph.ids) features_[id];
  for (const InformationLink& link : graph.links) {
    if (!(link.information_bits >= 0.0 && std::isfinite(link.information_bits)) ||
        link.frames < 1) {
      throw std::invalid_argument(
          "link (" + std::to_string(link.first) + ", " + std::to_string(link.second) + ") of " +
          std::to_string(link.information_bits) + " bits and " + std::to_string(link.frames) +
          " frames, allowed: finite, 0 or more, and 1 or more");
    }
    features_[link.first].push_back(
        {link.second, link.information_bits * link.frames, link.frames});
  }
}

void MutualInformationAccumulator::addFrame(const std::vector<std::int64_t>& ids,
                                            const Eigen::Ref<const Eigen::MatrixXd>& S) {
  const Eigen::Index rows = 2 * static_cast<Eigen::Index>(ids.size());
  if (S.rows() != rows || S.cols() != rows) {
    throw std::invalid_argument("S is " + std::to_string(S.rows()) + " x " +
                                std::to_string(S.cols()) + ", allowed: " + std::to_string(rows) +
                                " x " + std::to_string(rows));
  }
  struct Visible {
    std::int64_t id;
    int index;
    Whitening whitening;
  };
  std::vector<Visible> visible;
  visible.reserve(ids.size());
  for (int i : orderById(ids)) {
    const Whitening whitening = Whitening::of(S.block<2, 2>(2 * i, 2 * i));
    if (whitening.usable) visible.push_back({ids[i], i, whitening});
  }
  for (std::size_t a = 0; a < visible.size(); ++a) {
    Partners& partners = features_[visible[a].id];
    std::size_t known = 0;
    Partners added;
    for (std::size_t b = a + 1; b < visible.size(); ++b) {
      // Columns of the first feature: one contiguous walk down S.
      const int i = 2 * visible[a].index, k = 2 * visible[b].index;
      const double odds = dependenceOdds(visible[b].whitening, visible[a].whitening, S(k, i),
                                         S(k + 1, i), S(k, i + 1), S(k + 1, i + 1));
      const double bits = std::isfinite(odds) ? oddsToBits(odds) : 0.0;
      while (known < partners.size() && partners[known].id < visible[b].id) ++known;
      if (known < partners.size() && partners[known].id == visible[b].id) {
        partners[known].sum_bits += bits;
        ++partners[known].frames;
      } else {
        added.push_back({visible[b].id, bits, 1});
      }
    }
    if (added.empty()) continue;
    const auto middle = static_cast<std::ptrdiff_t>(partners.size());
    partners.insert(partners.end(), added.begin(), added.end());
    std::inplace_merge(partners.begin(), partners.begin() + middle, partners.end(),
                       [](const Partner& x, const Partner& y) { return x.id < y.id; });
  }
}

void MutualInformationAccumulator::remove(std::int64_t id) {
  if (features_.erase(id) == 0) return;
  for (auto& [lower, partners] : features_) {
    if (lower > id) break;
    const auto at = std::lower_bound(partners.begin(), partners.end(), id,
                                     [](const Partner& p, std::int64_t x) { return p.id < x; });
    if (at != partners.end() && at->id == id) partners.erase(at);
  }
}

void MutualInformationAccumulator::forgetWeakest(std::vector<std::int64_t> ids, int most) {
  std::sort(ids.begin(), ids.end());
  std::map<std::int64_t, double> bits_of;  // of those that may be forgotten
  for (const auto& feature : features_)
    if (!std::binary_search(ids.begin(), ids.end(), feature.first)) bits_of[feature.first] = 0.0;
  const std::size_t kept = static_cast<std::size_t>(most);
  if (bits_of.size() <= kept + kept / kSpare) return;
  for (const auto& [id, partners] : features_) {
    const auto own = bits_of.find(id);
    for (const Partner& partner : partners) {
      const double bits = partner.sum_bits / partner.frames;
      if (own != bits_of.end()) own->second += bits;
      const auto other = bits_of.find(partner.id);
      if (other != bits_of.end()) other->second += bits;
    }
  }
  std::vector<std::pair<double, std::int64_t>> weakest;
  for (const auto& [id, bits] : bits_of) weakest.emplace_back(bits, id);
  std::sort(weakest.begin(), weakest.end());
  for (std::size_t i = 0; i + kept < weakest.size(); ++i) remove(weakest[i].second);
}

MutualInformationGraph MutualInformationAccumulator::links() const {
  MutualInformationGraph graph;
  std::size_t count = 0;
  for (const auto& feature : features_) count += feature.second.size();
  graph.ids.reserve(features_.size());
  graph.links.reserve(count);
  for (const auto& [id, partners] : features_) {
    graph.ids.push_back(id);
    for (const Partner& partner : partners) {
      graph.links.push_back(
          {id, partner.id, partner.sum_bits / partner.frames, partner.frames, false});
    }
  }
  return graph;
}

}  // namespace active_matching_slam
