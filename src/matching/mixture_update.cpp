#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>

#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/math/slot.h"
#include "gaussian_mass.h"
#include "mixture.h"
#include "modelled_cost.h"

namespace active_matching_slam {
namespace {

/// Floor of a likelihood, so that its logarithm stays finite.
constexpr double kLeastLikelihood = 1e-9;
/// Log-odds that the better of two near matches is the true one, per difference of their similarity
/// (ZNCC).
constexpr double kLogOddsPerScore = 20.0;
/// Cost: most pruned hypotheses that are kept for joint re-scoring.
constexpr std::size_t kMaxPruned = 32;

}  // namespace

double Mixture::pixelMass(Hypothesis& h, int f) {
  const PixelMask& mask = search_.searchedPixels(f);
  const std::vector<PixelRun>& runs = mask.history();
  for (Hypothesis::PixelMass& known : h.pixel_masses) {
    if (known.feature != f) continue;
    if (known.runs < runs.size()) {
      charge(kRunMs * static_cast<double>(runs.size() - known.runs));
      known.sum += massOnRuns(runs, known.runs, h.mean[slot(f)], h.covariance(f));
      known.runs = runs.size();
    }
    return std::min(1.0, known.sum);
  }
  charge(kRunMs * static_cast<double>(runs.size()));
  const double sum = massOnPixels(mask, h.mean[slot(f)], h.covariance(f));
  h.pixel_masses.push_back({f, sum, runs.size()});
  return std::min(1.0, sum);
}

/// match * sum of p over the matches outside the own ancestry + in * max(0, A - sum of p over all)
/// + 1 - A
double Mixture::explained(Hypothesis& h, int f) {
  const std::vector<SearchMatch>& known = search_.matches(f);
  search_.charge(kWeighingMs + kWeighingMatchMs * static_cast<double>(known.size()));
  const double searched_mass = pixelMass(h, f);
  const Eigen::Matrix2d covariance = h.covariance(f);
  double all = 0.0, foreign = 0.0;
  for (const SearchMatch& m : known) {
    const double p = massOfPixel(m.pixel, h.mean[slot(f)], covariance);
    all += p;
    if (!liesInAncestry(h, f, m.pixel)) foreign += p / m.clutter;
  }
  const SearchLikelihood& likelihood = this->likelihood(f);
  const double z = likelihood.match * foreign + likelihood.in * std::max(0.0, searched_mass - all) +
                   1.0 - searched_mass;
  return std::max(z, kLeastLikelihood);
}

void Mixture::updateIncremental(int g, int c, MatchStep& step, std::vector<Child>& children) {
  const int f = hypotheses_[slot(g)].candidates[slot(c)].feature;
  const auto counts = [&](const Hypothesis& h) {
    return !h.isFused(f) && h.joint->marginal(f).determinant > 0.0;
  };
  // Before a feature's first search every Z is 1.
  const bool fresh = search_.searchedPixels(f).size() == 0 && search_.matches(f).empty();
  std::vector<double> before(hypotheses_.size(), 1.0);
  for (std::size_t k = 0; k < hypotheses_.size() && !fresh; ++k)
    if (counts(hypotheses_[k])) before[k] = explained(hypotheses_[k], f);
  Hypothesis& searcher = hypotheses_[slot(g)];
  const int ancestry_before = searcher.ancestry[slot(f)];
  const SearchOutcome outcome = searchOnly(g, c);
  step.pixels_in_ellipse = outcome.pixels_in_ellipse;
  step.pixels_new = outcome.pixels_new;
  step.matches = outcome.matches;
  // Only matches outside the ellipses of g and its ancestors spawn children.
  const double base = searcher.log_weight - std::log(before[slot(g)]);
  const Eigen::Matrix2d covariance = searcher.covariance(f);
  const int ancestry_after = searcher.ancestry[slot(f)];
  searcher.ancestry[slot(f)] = ancestry_before;
  for (const int m : outcome.matches) {
    const SearchMatch& found = search_.matches(f)[slot(m)];
    if (liesInAncestry(searcher, f, found.pixel)) continue;
    const double p = massOfPixel(found.pixel, searcher.mean[slot(f)], covariance) / found.clutter;
    children.push_back({m, base + std::log(likelihood(f).match * p)});
  }
  searcher.ancestry[slot(f)] = ancestry_after;
  for (std::size_t k = 0; k < hypotheses_.size(); ++k)
    if (counts(hypotheses_[k]))
      hypotheses_[k].log_weight += std::log(explained(hypotheses_[k], f) / before[k]);
}

void Mixture::updateThesis(int g, int c, MatchStep& step, std::vector<Child>& children) {
  const int f = hypotheses_[slot(g)].candidates[slot(c)].feature;
  const SearchLikelihood& likelihood = this->likelihood(f);
  const double base = hypotheses_[slot(g)].log_weight;
  const SearchOutcome outcome = searchOnly(g, c);
  step.pixels_in_ellipse = outcome.pixels_in_ellipse;
  step.pixels_new = outcome.pixels_new;
  step.matches = outcome.matches;
  for (int k = 0; k < static_cast<int>(hypotheses_.size()); ++k) {
    Hypothesis& h = hypotheses_[slot(k)];
    if (!(h.joint->marginal(f).determinant > 0.0)) continue;
    search_.charge(kWeighingMs);
    const Eigen::Matrix2d covariance = h.covariance(f);
    double sum = 0.0, claimed = 0.0;
    for (const int m : outcome.matches) {
      const SearchMatch& found = search_.matches(f)[slot(m)];
      const double p = massOfPixel(found.pixel, h.mean[slot(f)], covariance);
      sum += p;
      claimed += p / found.clutter;
      if (k == g) children.push_back({m, base + std::log(likelihood.match * p / found.clutter)});
    }
    const double inside = mass(k, c, g);
    const double factor = (k == g ? 0.0 : likelihood.match * claimed) +
                          likelihood.in * std::max(0.0, inside - sum) + 1.0 - inside;
    h.log_weight += std::log(std::max(factor, kLeastLikelihood));
  }
}

void Mixture::searchAndUpdate(int g, int c, MatchStep& step) {
  const int f = hypotheses_[slot(g)].candidates[slot(c)].feature;
  std::vector<Child> children;
  if (options_.update_rule == UpdateRule::kIncremental) {
    updateIncremental(g, c, step, children);
  } else {
    updateThesis(g, c, step, children);
  }
  for (const Child& child : children) step.spawned.push_back(child.match);
  reweigh(g, f, children, step);
}

/// Merges children with nearly the same predictions of all other features: they differ only in
/// which of some near matches is this feature's. Otherwise k features with two near matches each
/// would make 2^k Gaussians. Position hardly discriminates between such matches; similarity does.
void Mixture::mergeSiblings(int g, int f, std::vector<Child>& children) const {
  if (children.size() < 2 || !(options_.merge_sigmas > 0.0)) return;
  const Hypothesis& parent = hypotheses_[slot(g)];
  const auto joint = parent.prior->joint->measure(parent.joint, f);
  const std::vector<int>& touched = joint->touched();
  std::vector<Eigen::Matrix2d> gains, precisions;
  for (std::size_t i = 0; i < touched.size(); ++i) {
    if (parent.isFused(touched[i]) || !(joint->marginal(touched[i]).determinant > 0.0)) continue;
    gains.emplace_back(joint->cross(i) * joint->measuredPrecision());
    precisions.emplace_back(joint->marginal(touched[i]).covariance.inverse());
  }
  const double limit = options_.merge_sigmas * options_.merge_sigmas;
  const auto isNear = [&](const Child& a, const Child& b) {
    const Eigen::Vector2d apart =
        search_.matches(f)[slot(a.match)].pixel - search_.matches(f)[slot(b.match)].pixel;
    for (std::size_t i = 0; i < gains.size(); ++i) {
      const Eigen::Vector2d shift = gains[i] * apart;
      if (shift.dot(precisions[i] * shift) > limit) return false;
    }
    return true;
  };
  const auto log_odds = [&](const Child& child) {
    return child.log_weight + kLogOddsPerScore * search_.matches(f)[slot(child.match)].score;
  };
  std::stable_sort(children.begin(), children.end(),
                   [&](const Child& a, const Child& b) { return log_odds(a) > log_odds(b); });
  std::vector<Child> kept;
  std::vector<double> kept_log_odds;
  for (const Child& child : children) {
    const auto near = std::find_if(kept.begin(), kept.end(),
                                   [&](const Child& other) { return isNear(other, child); });
    if (near == kept.end()) {
      kept.push_back(child);
      kept_log_odds.push_back(log_odds(child));
      continue;
    }
    const double best = kept_log_odds[static_cast<std::size_t>(near - kept.begin())];
    near->probability = 1.0 / (1.0 / near->probability + std::exp(log_odds(child) - best));
    const double more = std::log1p(std::exp(child.log_weight - near->log_weight));
    near->log_weight += more;
    near->log_merged += more;
  }
  children = std::move(kept);
}

/// Normalises, prunes, and only then makes the children: thousands of spurious matches cost
/// thousands of weights, not thousands of Gaussians.
void Mixture::reweigh(int g, int f, std::vector<Child>& children, MatchStep& step) {
  mergeSiblings(g, f, children);
  struct Entry {
    int index;  ///< of a hypothesis, or of a child after them
    int id, parent;
    double weight;
  };
  const int old_count = static_cast<int>(hypotheses_.size());
  const int searcher_id = hypotheses_[slot(g)].id;
  double most = -std::numeric_limits<double>::infinity();
  for (const Hypothesis& h : hypotheses_) most = std::max(most, h.log_weight);
  for (const Child& child : children) most = std::max(most, child.log_weight);
  std::vector<Entry> entries;
  for (int k = 0; k < old_count; ++k) {
    const Hypothesis& h = hypotheses_[slot(k)];
    entries.push_back({k, h.id, h.parent, std::exp(h.log_weight - most)});
  }
  for (std::size_t c = 0; c < children.size(); ++c)
    entries.push_back({old_count + static_cast<int>(c), next_id_ + static_cast<int>(c), searcher_id,
                       std::exp(children[c].log_weight - most)});
  next_id_ += static_cast<int>(children.size());
  most_gaussians_ = std::max(most_gaussians_, static_cast<int>(entries.size()));
  const auto normalise = [&] {
    double sum = 0.0;
    for (const Entry& e : entries) sum += e.weight;
    for (Entry& e : entries) e.weight /= sum;
  };
  const auto record = [&](std::vector<MatchStep::GaussianWeight>& weights) {
    if (!options_.keep_trace) return;
    for (const Entry& e : entries) weights.push_back({e.id, e.parent, e.weight});
  };
  normalise();
  record(step.weights);
  std::vector<double> weights;
  for (const Entry& e : entries) weights.push_back(e.weight);
  double heaviest = 0.0;
  for (const Entry& e : entries) heaviest = std::max(heaviest, e.weight);
  double least = std::min(options_.prune_weight, heaviest);
  const auto limit = slot(options_.max_gaussians);
  const auto prune = [&] {
    entries.erase(std::remove_if(entries.begin(), entries.end(),
                                 [&](const Entry& e) {
                                   return e.weight < least &&
                                          !(e.index < old_count &&
                                            awaitsConfirmation(hypotheses_[slot(e.index)]));
                                 }),
                  entries.end());
  };
  prune();
  if (limit > 0 && entries.size() > limit) {
    std::vector<Entry> ordered = entries;
    std::stable_sort(ordered.begin(), ordered.end(),
                     [](const Entry& a, const Entry& b) { return a.weight > b.weight; });
    ordered.resize(limit);
    std::sort(ordered.begin(), ordered.end(),
              [](const Entry& a, const Entry& b) { return a.index < b.index; });
    entries = std::move(ordered);
    was_capped_ = true;
  }
  double kept = 0.0;
  for (const Entry& e : entries) kept += e.weight;
  normalise();
  record(step.pruned);

  // Entries of what dies are free for what is born, but the parent is needed until then.
  std::vector<char> lives(hypotheses_.size(), 0);
  for (const Entry& e : entries)
    if (e.index < old_count) lives[slot(e.index)] = 1;
  for (int k = 0; k < old_count; ++k) {
    if (!lives[slot(k)] && k != g) releaseEntries(hypotheses_[slot(k)]);
  }
  hypotheses_.reserve(hypotheses_.size() + entries.size());
  for (Entry& e : entries) {
    if (e.index < old_count) continue;
    hypotheses_.push_back(spawn(hypotheses_[slot(g)], f, children[slot(e.index - old_count)]));
    e.index = static_cast<int>(hypotheses_.size()) - 1;
  }
  if (!lives[slot(g)]) releaseEntries(hypotheses_[slot(g)]);
  for (int k = 0; k < old_count && rescoresJointly(); ++k) {
    if (lives[slot(k)] || pruned_.size() >= kMaxPruned) continue;
    Hypothesis& dropped = hypotheses_[slot(k)];
    // The searcher itself is dropped for its own child: all but its last match lives on in that.
    const bool is_alternative = k != g && dropped.most_weight >= kAlternativeWeight;
    if (!is_alternative && !hasUnclaimedMatches(dropped)) continue;
    pruned_.push_back(std::move(dropped));
    kept += weights[slot(k)];
  }
  kept_ *= kept;
  std::vector<Hypothesis> next;
  next.reserve(entries.size());
  for (const Entry& e : entries) {
    next.push_back(std::move(hypotheses_[slot(e.index)]));
    next.back().id = e.id;
    next.back().parent = e.parent;
    next.back().weight = e.weight;
    next.back().most_weight =
        e.index < old_count ? std::max(next.back().most_weight, e.weight) : e.weight;
    next.back().log_weight = std::log(e.weight);
  }
  hypotheses_ = std::move(next);
}

}  // namespace active_matching_slam
