#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "active_matching_slam/filter/filter_options.h"

namespace active_matching_slam {

/// How much more or less noisy the matches of one feature are than most: some corners are cleaner
/// than others, and where something near hides something far there is no point to be found. By what
/// is left between image and template, and by what updates leave over about the last hundred
/// matches; like others, until there are enough to tell. Where the patch is not what it is taken
/// for, matches are off to the same side for long, and that one can see, too.
class FeatureNoise {
 public:
  /// `sigma_px` of a match as its image tells it (SearchMatch::sigma_px), over
  /// MatchNoise::ofImage(); 0 tells nothing.
  void see(double sigma_px);

  /// `residual_px` as MatchNoise::learn() has it, `shown_px` > 0 what it returned for that frame.
  void learn(const Eigen::Vector2d& residual_px, double shown_px);

  /// Standard deviation of this feature's matches as updates show it, in what was expected.
  double factor() const;

  /// Variance of the average of some matches in a row, in what it would be if their errors were
  /// independent and as large as what frames showed. Empty: too few to tell.
  std::optional<double> lasting() const;
  /// The same, in that of most (`of_most` > 0), which is what it is taken for until there are
  /// enough.
  double lastingLikeMost(double of_most) const;

  /// Average of what images told, as a standard deviation [px]; 0: nothing yet.
  double seen_px() const;

 private:
  void learnLasting(Eigen::Vector2d in_shown);

  double sum_ = 0.0;    ///< of squared residuals per axis, in what their frames showed
  double count_ = 0.0;  ///< of matches
  Eigen::Vector2d recent_ = Eigen::Vector2d::Zero();  ///< average of the last few residuals
  double recent_variance_ = 0.0;                      ///< of that, if they were independent
  double lasting_sum_ = 0.0;                          ///< of its squares per axis, in that
  double seen_px2_ = 0.0;
  int seen_ = 0;
};

/// The noise of matches as updates show it: what they leave between matches and map, by its median
/// (so that the few that are wrong don't count), averaged over the last few images, and as much
/// more or less as the present image is blurred or sharp: what is left between it and the templates
/// tells so at once. It is for the update only; gates and mutual information keep
/// FilterOptions::sigma_px, which must hold for what has not been matched yet.
class MatchNoise {
 public:
  /// Nothing is known yet: it is taken to be FilterOptions::sigma_px.
  void reset() { *this = MatchNoise(); }

  /// `residuals_px`: UpdateReport::left_px of each match fused, over the root of its noise_left and
  /// over likeMost() of its feature; of the image that see() was told of. Too few tell nothing.
  /// Returns what they show, as a standard deviation per axis [px]; 0: nothing.
  double learn(const std::vector<Eigen::Vector2d>& residuals_px);

  /// How far matches moved since the image before [px]: the less, the longer what a patch is off by
  /// where it falls and how it is seen and lit stays the same. Too few tell nothing.
  void seeMotion(std::vector<double> motions_px);

  /// `lasting`: FeatureNoise::lasting() of the features matched that can tell it. Too few tell
  /// nothing.
  void learnLasting(std::vector<double> lasting);

  /// Variance of the part of a feature's errors that lasts, in that of most.
  double lastingLikeMost(const FeatureNoise& feature) const;

  /// FeatureMeasurement::repetitions of the feature's match in the present image, as seeMotion()
  /// had that.
  double repetitions(const FeatureNoise& feature) const;

  /// What the present image tells of its matches (SearchMatch::sigma_px, known ones). Too few tell
  /// nothing: it is like most.
  void see(std::vector<double> sigmas_px);

  /// What the present image tells of its matches, in what most images tell.
  double ofImage() const { return of_image_; }

  /// Standard deviation of a feature's matches in that of most, by what images told. What is left
  /// between image and template says how much a patch is off by chance; where it is more than of
  /// most, the patch is not the plane that it is taken for, and wanders by more than that.
  double likeMost(const FeatureNoise& feature) const;

  /// By how much more or less than most a corner wanders as the view of it turns: in proportion to
  /// its matches' noise, as rendered scenes have it, and to what of it lasts, but that one which
  /// looks clean hardly wanders is not counted upon.
  double wanderLikeMost(const FeatureNoise& feature) const;

  /// Standard deviation per axis [px] for most matches, not above FilterOptions::sigma_px and,
  /// where that allows it, not below FilterOptions::minimum_sigma_px.
  double sigma_px(const FilterOptions& options) const;
  /// The same for matches of a feature whose noise is known, but without the upper bound.
  double sigma_px(const FilterOptions& options, const FeatureNoise& feature) const;

 private:
  /// Standard deviation of matches in the present image in that of most images.
  double noiseOfImage() const;
  /// Standard deviation of a feature's matches in that of most, by all that is known of it.
  double inThatOfMost(const FeatureNoise& feature) const;

  double shown_px2_ = 0.0;  ///< average variance, in an image like most
  double seen_px_ = 0.0;    ///< average of what images tell of most matches; 0: nothing yet
  double of_image_ = 1.0;
  double lasting_ = 0.0;      ///< average FeatureNoise::lasting() of most; 0: nothing yet
  int updates_ = 0;           ///< that told something
  double same_images_ = 1.0;  ///< that show the same
};

}  // namespace active_matching_slam
