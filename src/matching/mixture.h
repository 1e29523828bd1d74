#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "active_matching_slam/matching/match_result.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "joint.h"
#include "pair_table.h"
#include "search_ledger.h"

namespace active_matching_slam {

/// Likelihood of what a search of a feature brings, divided by that of nothing but clutter (Chli
/// 2009, eq. 5.5-5.8): no power of the number of pixels is ever formed.
struct SearchLikelihood {
  double true_positive = 0.0;
  double in = 0.0;            ///< the feature is inside and was missed: Pfn / Ptn
  double match = 0.0;         ///< one of the matches is the feature: Ptp / Pfp
  double child_log = 0.0;     ///< c ln(c), c = match * mass of a whole ellipse
  double clutter_odds = 0.0;  ///< Pfp / Ptn

  explicit SearchLikelihood(const FeatureRates& rates)
      : true_positive(rates.true_positive),
        in((1.0 - rates.true_positive) / (1.0 - rates.false_positive)),
        match(rates.true_positive / rates.false_positive),
        clutter_odds(rates.false_positive / (1.0 - rates.false_positive)) {
    const double child = match * kEllipseMass;
    child_log = child * std::log(child);
  }
};

/// Of a hypothesis that is worth a second look, once.
constexpr double kRunnerUpWeight = 0.1;

/// One Gaussian of the mixture: a scenario of matches, and what it expects of the features left.
struct Hypothesis {
  /// A feature that can be searched here.
  struct Candidate {
    int feature = -1;
    bool open = true;           ///< not searched here yet
    bool clipped = false;       ///< the ellipse reaches beyond the valid area
    double area = 0.0;          ///< of the 3-sigma ellipse inside the valid area [px^2]
    double mass = 0.0;          ///< own probability mass inside
    double bits = 0.0;          ///< continuous information of a match
    double child = 0.0;         ///< match * mass: a match's factor for the child
    double child_log = 0.0;     ///< child * ln(child)
    std::int64_t checked = -1;  ///< cache of Mixture::isSterile
  };
  /// Sum of p over the first `runs` runs of the pixels searched.
  struct PixelMass {
    int feature;
    double sum;
    std::size_t runs;
  };
  int id = 0, parent = -1;
  double log_weight = 0.0, weight = 1.0;
  double most_weight = 1.0;  ///< it ever had
  bool was_searched = false;
  double log_merged = 0.0;  ///< what merged siblings added to log_weight
  std::shared_ptr<const Conditional> joint;
  std::vector<Eigen::Vector2d> mean;    ///< F, the match for a fused feature [px]
  std::vector<int> match;               ///< F, -1: not fused
  std::vector<double> share;            ///< F, of the match among those merged with it
  std::vector<int> lineage;             ///< F, newest ellipse searched, in Mixture's pool; -1: none
  std::vector<Candidate> candidates;    ///< by feature, as they were at birth
  std::vector<int> candidate_of;        ///< F, index into candidates; -1: none
  std::vector<PixelMass> pixel_masses;  ///< cache
  std::vector<int> entry;               ///< F, in the feature's table of pairs

  Eigen::Matrix2d covariance(int f) const { return joint->marginal(f).covariance; }
  SearchEllipse ellipse(int f) const {
    return {mean[static_cast<std::size_t>(f)], joint->marginal(f).covariance};
  }
  bool isFused(int f) const { return match[static_cast<std::size_t>(f)] >= 0; }
  bool hasOpenCandidate() const {
    for (const Candidate& c : candidates)
      if (c.open) return true;
    return false;
  }
};

/// A hypothesis, its matches completed by Mixture::recount, and its probability.
struct Explanation {
  const Hypothesis* hypothesis = nullptr;
  std::vector<int> match;  ///< F
  double probability = 0.0;
};

/// The mixture of Gaussians of Active Matching (Chli 2009, section 5.3): `sum_k lambda_k G(z_k,
/// S_k)`, over any representation of the joint, with the two rules of update.
class Mixture {
 public:
  /// All but the likelihoods must outlive it.
  Mixture(const ProperPrior& prior, const Joint& joint, SearchLedger& ledger,
          std::vector<SearchLikelihood> likelihoods, const MatchOptions& options);

  int features() const { return joint_.size(); }
  /// In order of creation, weights normalised.
  const std::vector<Hypothesis>& hypotheses() const { return hypotheses_; }
  /// Index of the heaviest (ties: the lower id).
  int heaviest() const;
  const SearchLikelihood& likelihood(int f) const {
    return likelihoods_[static_cast<std::size_t>(f)];
  }
  /// Mass of hypothesis k's marginal inside g's ellipse, both of g's candidate c (indices, not
  /// ids).
  double mass(int k, int c, int g);
  /// The same, k != g, with the factors that follow from it.
  const PairTerm& term(int k, int c, int g);
  /// As g sees its own search; what a match adds goes to the child.
  const PairTerm& ownTerm(int g, int c);
  /// Frees what only term() needs; it is not to be asked any more.
  void forgetTerms();
  /// Rule incremental: a search of candidate c of g would see neither a new pixel nor a match that
  /// is known but outside the ellipses that g or its ancestors searched.
  bool isSterile(int g, int c);

  /// The hypothesis that is to be heard before anything else is searched; -1: none.
  int unheard() const;

  /// Searches candidate c of hypothesis g and updates the mixture. `step` gets what came of it.
  void searchAndUpdate(int g, int c, MatchStep& step);
  /// Fuses a match of the candidate's feature into g, just searched, without asking the others; g
  /// keeps its id and weight. That it may be another match, or none, counts as dropped.
  void fuse(int g, int c, int match);
  /// The hypotheses as they are, heaviest first.
  std::vector<Explanation> explanations() const;
  /// Searches candidate c of hypothesis g, and marks it as searched, without an update.
  SearchOutcome searchOnly(int g, int c);

  /// The hypotheses, and those that were dropped while matches that others found could still be
  /// theirs, judged anew by all that was found; the most probable first. The probabilities sum to
  /// less than 1 by that of what was dropped otherwise.
  ///
  /// The weights of the mixture alone are no probabilities. To a hypothesis that is not searched
  /// itself they credit what others found in its ellipses as if features were independent, though
  /// the place of one tells those of all others. So the longer it waits the lighter it gets, until
  /// it is dropped. Here it takes up what was found, match by match, each expected where the ones
  /// before tell: the evidence is the joint density of all its matches.
  std::vector<Explanation> recount() const;

  /// Whether the heaviest hypothesis misses more features than their rates explain. Where structure
  /// repeats, one that is wrong finds a good part of the features, and each of those speaks against
  /// the true one, which is dropped before anything was searched where it expects it.
  bool heaviestFallsShort() const;
  /// Sets the hypotheses aside for the recount, and begins anew with the one of them, or of those
  /// dropped, that was likeliest once and has not been searched to its end. False if there is none.
  bool beginRunnerUp();

  /// Whether the options ask for recount(), and the rule of update allows it.
  bool recounts() const {
    return options_.recount && options_.update_rule == UpdateRule::kIncremental;
  }

  int mostGaussians() const { return most_gaussians_; }
  bool wasCapped() const { return was_capped_; }

 private:
  struct SearchedEllipse {
    SearchEllipse ellipse;
    int next;  ///< older one of the same feature and lineage, -1: none
  };
  struct Child {
    int match;
    double log_weight;
    double share = 1.0;       ///< of its own in log_weight
    double log_merged = 0.0;  ///< what merged siblings added to log_weight
  };

  /// How well a hypothesis explains what was found for some features, relative to clutter alone.
  struct Evidence {
    std::vector<int> match;    ///< F, completed
    double log_claimed = 0.0;  ///< by these matches
    double log_any = 0.0;      ///< by all that the hypothesis allows
  };

  /// Whether others found matches that may be its own.
  bool lags(const Hypothesis& h) const;
  bool awaitsHearing(const Hypothesis& h) const {
    return options_.hearing_weight > 0.0 && !h.was_searched &&
           h.most_weight >= options_.hearing_weight && h.hasOpenCandidate();
  }
  /// What was found for a feature, as a hypothesis that expects it so sees it.
  struct View {
    SearchEllipse expected;
    int best = -1;         ///< the likeliest match that it may claim
    double of_best = 0.0;  ///< its likelihood, relative to clutter alone
    double any = 1.0;      ///< likelihood of all that was found
  };
  View viewOf(const Hypothesis& h, int f, const SearchEllipse& expected) const;
  std::vector<int> contradictions(const Hypothesis& a, const Hypothesis& b,
                                  std::size_t skipped) const;
  Evidence evidenceOf(const Hypothesis& h, const std::vector<int>& features) const;
  bool liesInLineage(const Hypothesis& h, int f, const Eigen::Vector2d& p) const;
  void addCandidate(Hypothesis& h, int f) const;
  double pixelMass(Hypothesis& h, int f);
  /// Z_kf of rule incremental.
  double explained(Hypothesis& h, int f);
  void updateIncremental(int g, int c, MatchStep& step, std::vector<Child>& children);
  void updateThesis(int g, int c, MatchStep& step, std::vector<Child>& children);
  void reweigh(int g, int f, std::vector<Child>& children, MatchStep& step);
  void mergeSiblings(int g, int f, std::vector<Child>& children) const;
  void beginTerms(Hypothesis& h);
  Hypothesis spawn(const Hypothesis& parent, int f, const Child& child);
  /// Entries of a newborn in the tables of pairs; its parent's where `is_changed` is 0.
  void takeEntries(Hypothesis& child, const Hypothesis& parent, int f,
                   const std::vector<char>& is_changed);
  void releaseEntries(Hypothesis& h);
  int entryOfFused(int f, int match);
  double computeMass(const Hypothesis& of, const Hypothesis& in,
                     const Hypothesis::Candidate& candidate) const;
  void complete(PairTerm& term, const Hypothesis::Candidate& candidate, double child) const;

  const ProperPrior& prior_;
  const Joint& joint_;
  SearchLedger& ledger_;
  const MatchOptions& options_;
  std::vector<SearchLikelihood> likelihoods_;
  std::vector<PixelBox> valid_;
  std::vector<Hypothesis> hypotheses_;
  std::vector<SearchedEllipse> searched_;
  std::vector<PairTable> pairs_;  // by feature
  struct FusedEntry {
    int entry = PairTable::kNone;
    std::int64_t serial = 0;
  };
  std::vector<std::vector<FusedEntry>> fused_entries_;  // by feature and match
  bool keeps_terms_ = true;
  PairTerm scratch_;  // of a Gaussian without an entry
  int next_id_ = 1;
  int most_gaussians_ = 1;
  bool was_capped_ = false;
  // For recount()
  std::vector<int> first_searched_;  // features, in order
  std::vector<Hypothesis> aside_;    // dropped while they lagged, or were likely once
  std::vector<Hypothesis> ended_;    // searched to their end, or passed over, before a runner-up
  double kept_ = 1.0;                // probability of all that was not dropped otherwise
};

}  // namespace active_matching_slam
