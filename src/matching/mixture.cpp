#include "mixture.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "active_matching_slam/math/slot.h"
#include "gaussian_mass.h"
#include "modelled_cost.h"

namespace active_matching_slam {
Mixture::Mixture(const ProperPrior& prior, const std::vector<PriorGaussian>& gaussians,
                 BudgetedSearch& budgeted, std::vector<SearchLikelihood> likelihoods,
                 const MatchOptions& options)
    : prior_(prior), search_(budgeted), options_(options), likelihoods_(std::move(likelihoods)) {
  const std::size_t size = slot(prior.size());
  for (int f = 0; f < prior.size(); ++f) valid_.push_back(budgeted.validArea(f));
  first_prior_ = &gaussians.front();
  for (const PriorGaussian& gaussian : gaussians) {
    Hypothesis root;
    root.prior = &gaussian;
    root.joint = gaussian.joint->prior();
    root.weight = root.most_weight = gaussian.probability;
    root.log_weight = std::log(gaussian.probability);
    root.mean.resize(size);
    root.match.assign(size, -1);
    root.match_probability.assign(size, 1.0);
    root.ancestry.assign(size, -1);
    root.candidate_of.assign(size, -1);
    for (int f = 0; f < prior.size(); ++f) {
      root.mean[slot(f)] = prior.mean(f);
      addCandidate(root, f);
    }
    if (hypotheses_.empty()) {
      beginTerms(root);
    } else {
      root.id = next_id_++;
      for (PairTable& pairs : pairs_) root.entry.push_back(pairs.acquire());
    }
    hypotheses_.push_back(std::move(root));
  }
}

int Mixture::heaviest() const {
  int best = 0;
  for (int k = 1; k < static_cast<int>(hypotheses_.size()); ++k)
    if (hypotheses_[slot(k)].weight > hypotheses_[slot(best)].weight) best = k;
  return best;
}

int Mixture::unconfirmed() const {
  constexpr double kDecayed = 0.2;  // fraction of the largest weight
  for (int k = 0; k < static_cast<int>(hypotheses_.size()); ++k) {
    const Hypothesis& h = hypotheses_[slot(k)];
    if (h.weight < kDecayed * h.most_weight && awaitsConfirmation(h)) return k;
  }
  return -1;
}

double Mixture::computeMass(const Hypothesis& of, const Hypothesis& in,
                            const Hypothesis::Candidate& candidate) const {
  const int f = candidate.feature;
  if (!(of.joint->marginal(f).determinant > 0.0)) return 0.0;
  charge(candidate.clipped ? kClippedMassMs : kMassMs);
  return candidate.clipped ? ClippedEllipse(in.ellipse(f), valid_[slot(f)])
                                 .mass(of.mean[slot(f)], of.covariance(f))
                           : massInEllipse(in.ellipse(f), of.mean[slot(f)], of.covariance(f));
}

double Mixture::mass(int k, int c, int g) {
  const Hypothesis& of = hypotheses_[slot(k)];
  const Hypothesis& in = hypotheses_[slot(g)];
  const Hypothesis::Candidate& candidate = in.candidates[slot(c)];
  const std::size_t f = slot(candidate.feature);
  if (k == g || (of.entry[f] == in.entry[f] && of.entry[f] != PairTable::kNone))
    return candidate.mass;
  if (of.entry[f] == PairTable::kNone || in.entry[f] == PairTable::kNone)
    return computeMass(of, in, candidate);
  PairTerm& known = pairs_[f].term(of.entry[f], in.entry[f]);
  if (known.mass == PairTerm::kUnknown) known.mass = computeMass(of, in, candidate);
  return known.mass;
}

/// The factors that follow from the mass; `child`: what a match adds to others.
void Mixture::complete(PairTerm& term, const Hypothesis::Candidate& candidate, double child) const {
  const SearchLikelihood& likelihood = this->likelihood(candidate.feature);
  const auto timesLog = [](double x) { return x > 0.0 ? x * std::log(x) : 0.0; };
  const double a = term.mass;
  term.null = likelihood.in * a + 1.0 - a;
  // A sliver of an ellipse, clipped to less than a pixel, has no room for a second match.
  term.match = std::max(
      child + likelihood.in * (candidate.area - 1.0) * a + candidate.area * (1.0 - a), 0.0);
  term.null_log = timesLog(term.null);
  term.match_log = timesLog(term.match);
}

const PairTerm& Mixture::term(int k, int c, int g) {
  const Hypothesis& of = hypotheses_[slot(k)];
  const Hypothesis& in = hypotheses_[slot(g)];
  const Hypothesis::Candidate& candidate = in.candidates[slot(c)];
  const std::size_t f = slot(candidate.feature);
  PairTerm* known = &scratch_;
  if (of.entry[f] != PairTable::kNone && in.entry[f] != PairTable::kNone) {
    known = &pairs_[f].term(of.entry[f], in.entry[f]);
    if (known->null != PairTerm::kUnknown) return *known;
  }
  known->mass = mass(k, c, g);
  complete(*known, candidate, likelihood(candidate.feature).match * known->mass);
  return *known;
}

const PairTerm& Mixture::ownTerm(int g, int c) {
  const Hypothesis& h = hypotheses_[slot(g)];
  const Hypothesis::Candidate& candidate = h.candidates[slot(c)];
  const std::size_t f = slot(candidate.feature);
  PairTerm& own = h.entry[f] == PairTable::kNone ? scratch_ : pairs_[f].own(h.entry[f]);
  if (h.entry[f] != PairTable::kNone && own.null != PairTerm::kUnknown) return own;
  own.mass = candidate.mass;
  complete(own, candidate, 0.0);
  return own;
}

/// Remembers terms from now on; `h` is alone.
void Mixture::beginTerms(Hypothesis& h) {
  const std::size_t size = h.mean.size();
  keeps_terms_ = true;
  pairs_.assign(size, {});
  fused_entries_.assign(size, {});
  h.entry.clear();
  for (PairTable& pairs : pairs_) h.entry.push_back(pairs.acquire());
}

void Mixture::forgetTerms() {
  keeps_terms_ = false;
  for (Hypothesis& h : hypotheses_) h.entry.assign(h.entry.size(), PairTable::kNone);
  pairs_.clear();
}

bool Mixture::liesInAncestry(const Hypothesis& h, int f, const Eigen::Vector2d& p) const {
  for (int i = h.ancestry[slot(f)]; i >= 0; i = searched_[slot(i)].next)
    if (mahalanobisSquared(searched_[slot(i)].ellipse, p) <= kEllipseRadius2) return true;
  return false;
}

bool Mixture::isExhausted(int g, int c) {
  constexpr double kSurelyHoldsAPixel = 30.0;  // px^2
  Hypothesis& h = hypotheses_[slot(g)];
  Hypothesis::Candidate& candidate = h.candidates[slot(c)];
  const int f = candidate.feature;
  const PixelMask& searched = search_.searchedPixels(f);
  const std::int64_t pixels = searched.size();
  const std::vector<SearchMatch>& known = search_.matches(f);
  if (pixels == 0 && candidate.area > kSurelyHoldsAPixel && !candidate.clipped) return false;
  // Both only grow, so their sum shows whether anything has changed since the last check.
  const std::int64_t state = 2 * (pixels + static_cast<std::int64_t>(known.size()));
  if (candidate.checked >= 0 && candidate.checked / 2 == state / 2)
    return candidate.checked % 2 == 1;
  const SearchEllipse ellipse = h.ellipse(f);
  bool exhausted = true;
  int runs = 0;
  forEachEllipseRun(ellipse, valid_[slot(f)], [&](const PixelRun& run) {
    ++runs;
    if (exhausted) exhausted = searched.countMissing(run) == 0;
  });
  charge(kRunMs * runs);
  for (std::size_t m = 0; m < known.size() && exhausted; ++m)
    exhausted = !(mahalanobisSquared(ellipse, known[m].pixel) <= kEllipseRadius2) ||
                liesInAncestry(h, f, known[m].pixel);
  candidate.checked = state + (exhausted ? 1 : 0);
  return exhausted;
}

/// Makes f a candidate of h if its ellipse can be searched and lies in none of its ancestry.
void Mixture::addCandidate(Hypothesis& h, int f) const {
  const Marginal& marginal = h.joint->marginal(f);
  if (!(marginal.determinant > 0.0) || !h.mean[slot(f)].allFinite()) return;
  const SearchEllipse ellipse = h.ellipse(f);
  Hypothesis::Candidate candidate;
  candidate.feature = f;
  candidate.bits = marginal.information_bits;
  candidate.clipped = reachesBeyond(ellipse, valid_[slot(f)]);
  if (candidate.clipped) {
    charge(kClippedMassMs);
    const ClippedEllipse clipped(ellipse, valid_[slot(f)]);
    constexpr double kLeastArea = 1e-3;  // px^2: no pixel to look at
    candidate.area = clipped.area();
    if (candidate.area < kLeastArea) return;
    candidate.mass = clipped.mass(ellipse.center, ellipse.covariance);
    candidate.child = likelihood(f).match * candidate.mass;
    candidate.child_log = candidate.child > 0.0 ? candidate.child * std::log(candidate.child) : 0.0;
  } else {
    candidate.area = kEllipseRadius2 * M_PI * std::sqrt(marginal.determinant);
    candidate.mass = kEllipseMass;
    candidate.child = likelihood(f).match * kEllipseMass;
    candidate.child_log = likelihood(f).child_log;
  }
  candidate.cost = search_.expectedCost(f, candidate.area);
  for (int i = h.ancestry[slot(f)]; i >= 0; i = searched_[slot(i)].next)
    if (liesInside(ellipse, searched_[slot(i)].ellipse)) return;
  h.candidate_of[slot(f)] = static_cast<int>(h.candidates.size());
  h.candidates.push_back(candidate);
}

Hypothesis Mixture::spawn(const Hypothesis& parent, int f, const Child& born) {
  const int match = born.match;
  Hypothesis child;
  child.parent = parent.id;
  child.prior = parent.prior;
  child.joint = parent.prior->joint->measure(parent.joint, f);
  child.mean = parent.mean;
  child.match = parent.match;
  child.match_probability = parent.match_probability;
  child.ancestry = parent.ancestry;
  const Eigen::Vector2d found = search_.matches(f)[slot(match)].pixel;
  const Eigen::Vector2d weighted =
      child.joint->measuredPrecision() * (found - parent.mean[slot(f)]);
  const std::vector<int>& touched = child.joint->touched();
  search_.charge(kTouchedMs * static_cast<double>(touched.size()));
  for (std::size_t i = 0; i < touched.size(); ++i)
    child.mean[slot(touched[i])].noalias() += child.joint->cross(i) * weighted;
  child.mean[slot(f)] = found;
  child.match[slot(f)] = match;
  child.match_probability[slot(f)] = born.probability;
  child.log_merged = parent.log_merged + born.log_merged;
  std::vector<char> is_changed(child.mean.size(), 0);
  is_changed[slot(f)] = 1;
  for (const int t : touched) is_changed[slot(t)] = 1;
  for (const Hypothesis::PixelMass& known : parent.pixel_masses)
    if (!is_changed[slot(known.feature)]) child.pixel_masses.push_back(known);
  child.candidate_of.assign(child.mean.size(), -1);
  child.candidates.reserve(parent.candidates.size());
  for (int t = 0; t < features(); ++t) {
    if (child.isFused(t)) continue;
    if (is_changed[slot(t)]) {
      addCandidate(child, t);
      continue;
    }
    // With the parent's marginal: what the parent has searched or cannot search is closed here too.
    const int c = parent.candidate_of[slot(t)];
    if (c < 0 || !parent.candidates[slot(c)].open) continue;
    child.candidate_of[slot(t)] = static_cast<int>(child.candidates.size());
    child.candidates.push_back(parent.candidates[slot(c)]);
  }
  takeEntries(child, parent, f, is_changed);
  return child;
}

/// All hypotheses that have fused one match of a feature have one entry in common.
int Mixture::entryOfFused(int f, int match) {
  std::vector<FusedEntry>& known = fused_entries_[slot(f)];
  if (known.size() <= slot(match)) known.resize(slot(match) + 1);
  PairTable& pairs = pairs_[slot(f)];
  FusedEntry& fused = known[slot(match)];
  if (fused.entry != PairTable::kNone && pairs.serial(fused.entry) == fused.serial) {
    pairs.retain(fused.entry);
  } else {
    fused.entry = pairs.acquire();
    fused.serial = fused.entry == PairTable::kNone ? 0 : pairs.serial(fused.entry);
  }
  return fused.entry;
}

void Mixture::takeEntries(Hypothesis& child, const Hypothesis& parent, int f,
                          const std::vector<char>& is_changed) {
  child.entry.assign(child.mean.size(), PairTable::kNone);
  if (!keeps_terms_) return;
  for (std::size_t t = 0; t < child.entry.size(); ++t) {
    if (is_changed[t]) {
      child.entry[t] = t == slot(f) ? entryOfFused(f, child.match[t]) : pairs_[t].acquire();
    } else {
      child.entry[t] = parent.entry[t];
      pairs_[t].retain(child.entry[t]);
    }
  }
}

void Mixture::releaseEntries(Hypothesis& h) {
  if (!keeps_terms_) return;
  for (std::size_t t = 0; t < h.entry.size(); ++t) pairs_[t].release(h.entry[t]);
}

SearchOutcome Mixture::searchOnly(int g, int c) {
  Hypothesis& h = hypotheses_[slot(g)];
  const int f = h.candidates[slot(c)].feature;
  const SearchEllipse ellipse = h.ellipse(f);
  if (search_.searchedPixels(f).size() == 0) first_searched_.push_back(f);
  SearchOutcome outcome = search_.search(f, ellipse);
  searched_.push_back({ellipse, h.ancestry[slot(f)]});
  h.ancestry[slot(f)] = static_cast<int>(searched_.size()) - 1;
  h.candidates[slot(c)].open = false;
  h.was_searched = true;
  return outcome;
}

void Mixture::fuse(int g, int c, int match) {
  Hypothesis& h = hypotheses_[slot(g)];
  const Hypothesis::Candidate& candidate = h.candidates[slot(c)];
  const int f = candidate.feature;
  double taken = 0.0, all = 0.0, claimed = 0.0;
  for (int m = 0; m < static_cast<int>(search_.matches(f).size()); ++m) {
    const SearchMatch& known = search_.matches(f)[slot(m)];
    const double p = massOfPixel(known.pixel, h.mean[slot(f)], h.covariance(f));
    all += p;
    claimed += p / known.clutter;
    if (m == match) taken = p / known.clutter;
  }
  const SearchLikelihood& of = likelihood(f);
  const double missed = of.in * std::max(0.0, candidate.mass - all) + 1.0 - candidate.mass;
  kept_ *= of.match * taken / (of.match * claimed + missed);
  Hypothesis fused = spawn(h, f, {match, h.log_weight});
  fused.id = h.id;
  fused.parent = h.parent;
  fused.log_weight = h.log_weight;
  fused.weight = h.weight;
  fused.most_weight = h.most_weight;
  releaseEntries(h);
  h = std::move(fused);
}

std::vector<Explanation> Mixture::explanations() const {
  std::vector<Explanation> explanations;
  for (const Hypothesis& h : hypotheses_) explanations.push_back({&h, h.match, h.weight});
  std::stable_sort(
      explanations.begin(), explanations.end(),
      [](const Explanation& a, const Explanation& b) { return a.probability > b.probability; });
  return explanations;
}

}  // namespace active_matching_slam
