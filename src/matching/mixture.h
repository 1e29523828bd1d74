#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "active_matching_slam/matching/match_result.h"
#include "active_matching_slam/matching/search_ellipse.h"
#include "budgeted_search.h"
#include "joint.h"
#include "pair_table.h"

namespace active_matching_slam {

/// Likelihood of the outcome of a feature's search, relative to that of clutter alone (Chli
/// 2009, eq. 5.5-5.8): no power of the number of pixels is ever formed.
struct SearchLikelihood {
  double true_positive = 0.0;
  double in = 0.0;            ///< the feature is inside, missed detection: Pfn / Ptn
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

/// Largest weight a hypothesis must once have had to count among the k-best alternatives. Cost:
/// each is searched to completion.
constexpr double kAlternativeWeight = 0.1;

/// One Gaussian of the prior: its joint over the features, and its probability.
struct PriorGaussian {
  const Joint* joint = nullptr;
  const Eigen::MatrixXd* S = nullptr;  ///< what the joint represents
  double probability = 1.0;
};

/// One Gaussian of the mixture: a data-association hypothesis, and its prediction of the features
/// that are not matched yet.
struct Hypothesis {
  /// A feature that can be searched here.
  struct Candidate {
    int feature = -1;
    bool open = true;           ///< not searched here yet
    bool clipped = false;       ///< the ellipse reaches beyond the valid area
    double area = 0.0;          ///< of the 3-sigma ellipse inside the valid area [px^2]
    double cost = 0.0;          ///< expected correlations of its search
    double mass = 0.0;          ///< own probability mass inside
    double bits = 0.0;          ///< continuous information of a match
    double child = 0.0;         ///< match * mass: a match's factor for the child
    double child_log = 0.0;     ///< child * ln(child)
    std::int64_t checked = -1;  ///< cache of Mixture::isExhausted
  };
  /// Sum of p over the first `runs` runs of the pixels searched.
  struct PixelMass {
    int feature;
    double sum;
    std::size_t runs;
  };
  int id = 0, parent = -1;
  double log_weight = 0.0, weight = 1.0;
  double most_weight = 1.0;  ///< largest weight so far
  bool was_searched = false;
  double log_merged = 0.0;               ///< what merged siblings added to log_weight
  const PriorGaussian* prior = nullptr;  ///< that it descends from
  std::shared_ptr<const ConditionalJoint> joint;
  std::vector<Eigen::Vector2d> mean;      ///< F, the match for a fused feature [px]
  std::vector<int> match;                 ///< F, -1: not fused
  std::vector<double> match_probability;  ///< F, posterior of the match among those merged with it
  std::vector<int> ancestry;            ///< F, newest ellipse searched, in Mixture's pool; -1: none
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

/// A hypothesis, its matches completed by Mixture::rescoreJointly, and its posterior probability.
struct Explanation {
  const Hypothesis* hypothesis = nullptr;
  std::vector<int> match;  ///< F
  double probability = 0.0;
};

/// The mixture of Gaussians of Active Matching (Chli 2009, section 5.3): `sum_k lambda_k G(z_k,
/// S_k)`, over any representation of the joint, with the two rules of update.
class Mixture {
 public:
  /// All but the likelihoods must outlive it. `gaussians`: of the prior, at least one, with
  /// probabilities that sum to one.
  Mixture(const ProperPrior& prior, const std::vector<PriorGaussian>& gaussians,
          BudgetedSearch& budgeted, std::vector<SearchLikelihood> likelihoods,
          const MatchOptions& options);

  int features() const { return prior_.size(); }
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
  /// The same for k = g; what a match adds goes to the child.
  const PairTerm& ownTerm(int g, int c);
  /// Frees what only term() needs; term() must not be called any more.
  void forgetTerms();
  /// Rule incremental: a search of candidate c of g is uninformative, since it would bring neither
  /// a new pixel nor a known match outside the ellipses that g or its ancestors searched.
  bool isExhausted(int g, int c);

  /// Deferred pruning: the hypothesis that is to be searched next to confirm or refute it; -1:
  /// none.
  int unconfirmed() const;

  /// Searches candidate c of hypothesis g and updates the mixture. `step` gets the outcome.
  void searchAndUpdate(int g, int c, MatchStep& step);
  /// Fuses a match of the candidate's feature into g, just searched, without an update of the other
  /// weights; g keeps its id and weight. The probability of another match, or none, is lost.
  void fuse(int g, int c, int match);
  /// The hypotheses as they are, heaviest first.
  std::vector<Explanation> explanations() const;
  /// Searches candidate c of hypothesis g, and marks it as searched, without an update.
  SearchOutcome searchOnly(int g, int c);

  /// Joint re-scoring: posteriors of the live hypotheses, and of those pruned while they had
  /// unclaimed matches, from the joint evidence of all matches; the most probable first. They sum
  /// to 1 less the probability of whatever else was pruned.
  ///
  /// The weights of the mixture alone are no posteriors: a hypothesis that was not searched itself
  /// is weighted by the matches that others found in its ellipses as if features were independent,
  /// so its weight decays with every such search until it is pruned. Here it claims these matches
  /// one by one, each predicted from the ones before (chain rule): the evidence is their joint
  /// density.
  std::vector<Explanation> rescoreJointly() const;

  /// Whether the heaviest hypothesis has more missed detections than the features' rates explain.
  /// Where structure repeats, a wrong hypothesis finds many of the features, and each of its
  /// matches lowers the weight of the true one, which is pruned before any of its own ellipses was
  /// searched.
  bool heaviestMissesTooMany() const;
  /// Keeps the hypotheses for joint re-scoring, and restarts the mixture from the best alternative:
  /// of all kept ones that are not searched to completion, the one of the largest weight so far.
  /// False if there is none.
  bool beginAlternative();

  /// Whether the options ask for rescoreJointly(), and the rule of update allows it.
  bool rescoresJointly() const {
    return options_.joint_rescoring && options_.update_rule == UpdateRule::kIncremental;
  }

  /// Adds to the modelled time.
  void charge(double milliseconds) const { search_.charge(milliseconds); }
  const PriorGaussian* firstPrior() const { return first_prior_; }
  int mostGaussians() const { return most_gaussians_; }
  bool wasCapped() const { return was_capped_; }

 private:
  struct SearchedEllipse {
    SearchEllipse ellipse;
    int next;  ///< older one of the same feature and ancestry, -1: none
  };
  struct Child {
    int match;
    double log_weight;
    double probability = 1.0;  ///< of its match among those merged with it
    double log_merged = 0.0;   ///< what merged siblings added to log_weight
  };

  /// Joint evidence for a hypothesis from the matches of some features, relative to clutter alone.
  struct Evidence {
    std::vector<int> match;       ///< F, completed
    double log_likelihood = 0.0;  ///< of these matches
    double log_evidence = 0.0;    ///< summed over all matches that the hypothesis allows
  };

  /// Whether other hypotheses found matches in its ellipses that it has not searched for.
  bool hasUnclaimedMatches(const Hypothesis& h) const;
  bool awaitsConfirmation(const Hypothesis& h) const {
    return options_.deferred_pruning_weight > 0.0 && !h.was_searched &&
           h.most_weight >= options_.deferred_pruning_weight && h.hasOpenCandidate();
  }
  /// Evidence for a hypothesis from one feature's matches, given where it predicts the feature;
  /// likelihoods relative to clutter alone.
  struct FeatureEvidence {
    SearchEllipse predicted;
    int best = -1;                 ///< the likeliest match that it may claim
    double best_likelihood = 0.0;  ///< of that match
    double likelihood = 1.0;       ///< of all matches of the feature
  };
  FeatureEvidence featureEvidence(const Hypothesis& h, int f, const SearchEllipse& predicted) const;
  std::vector<int> contradictions(const Hypothesis& a, const Hypothesis& b,
                                  std::size_t skipped) const;
  Evidence evidenceOf(const Hypothesis& h, const std::vector<int>& features) const;
  bool liesInAncestry(const Hypothesis& h, int f, const Eigen::Vector2d& p) const;
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
  BudgetedSearch& search_;
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
  const PriorGaussian* first_prior_ = nullptr;
  int next_id_ = 1;
  int most_gaussians_ = 1;
  bool was_capped_ = false;
  // For rescoreJointly()
  std::vector<int> first_searched_;    // features, in order
  std::vector<Hypothesis> pruned_;     // with unclaimed matches, or once of kAlternativeWeight
  std::vector<Hypothesis> completed_;  // searched to completion before an alternative
  double kept_ = 1.0;                  // probability mass that was not pruned for good
};

}  // namespace active_matching_slam
