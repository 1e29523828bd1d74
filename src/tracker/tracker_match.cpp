#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "active_matching_slam/filter/match_motion.h"
#include "active_matching_slam/filter/measurement_model.h"
#include "active_matching_slam/image/image_motion.h"
#include "active_matching_slam/image/warp.h"
#include "active_matching_slam/information/gaussian_information.h"
#include "active_matching_slam/matching/false_alarm.h"
#include "active_matching_slam/matching/innovation_gate.h"
#include "active_matching_slam/tracker/image_motion_prior.h"
#include "tracker_implementation.h"

namespace active_matching_slam {
namespace {

/// Share of the matches expected below which another matcher is asked too.
constexpr double kPoorShare = 0.6, kPoorShareWhenAmbiguous = 0.8;
/// Of JCBB's joint squared distance: 1 is what the truth has on average when the filter's noise is
/// what it is told, less when it is told more, and chance fills the whole gate of 1.2 to 1.5.
constexpr double kCloseChi2PerDegree = 0.5;
constexpr double kFarChi2PerDegree = 1.0;  ///< of RANSAC's
constexpr double kLeastShare = 0.1;        ///< of the matches expected: fewer are chance
constexpr int kFewPoorFrames = 2;          ///< after more, no second opinion
constexpr double kMajority = 0.5;          ///< of the matches expected, for JCBB's to count
constexpr double kClearlyMore = 1.25;      ///< matches, for RANSAC's to count
constexpr double kFirstShare = 0.6;        ///< of the budget, for the first attempt
constexpr double kShareOfRest = 0.5;       ///< for each opinion but the last, which has it all
constexpr double kAgreementChi2 = 13.8;    ///< 99.9 % of 2 degrees of freedom
constexpr double kMostLogFalseAlarms = -1.0;
constexpr double kLeastNoiseLeft = 0.1;  ///< of a match's variance, for what is left to tell it
/// FeatureMeasurement::repetitions of matches that the start's adjustment will hear again: what it
/// learns from them the filter need not.
constexpr double kLearntByAdjustment = 1000.0;
/// Their noise to the camera, in that of others: what of it lasts is its alone then. (By NEES over
/// rendered runs.)
constexpr double kNoiseWhileAdjusted = 1.27;
/// Share of its velocity that a camera keeps from one frame without matches to the next: a hand
/// that jerks does not go on for long.
constexpr double kSlowingUnseen = 0.7;
/// Pixels in all ellipses together beyond which the image's motion guides the first attempt.
constexpr double kWideGatesPx = 2e5;

/// In all 3-sigma ellipses together.
double gatesPixels(const MeasurementPrior& prior) {
  double pixels = 0.0;
  for (int i = 0; i < prior.size(); ++i)
    pixels += 9.0 * M_PI * std::sqrt(std::max(prior.covariance(i).determinant(), 0.0));
  return pixels;
}

}  // namespace

void Tracker::Implementation::predict(double interval_s) {
  if (poor_frames_ == 0) {
    T_world_camera_before_ = filter_.camera().poseWorldCamera();
  } else {
    filter_.doubtVelocity(kSlowingUnseen);
  }
  interval_s = std::min(interval_s, options_.max_frame_interval_s);
  filter_.predict(interval_s);
  std::vector<double> wander;
  for (const FeatureState& state : filter_.features()) {
    const MapFeature& feature = *map_.find(state.id);
    // What is known holds the scale: no more of that is let go than of others.
    wander.push_back(feature.known ? 1.0 : match_noise_.wanderLikeMost(feature.noise));
  }
  filter_.letCornersWander(camera_, interval_s, wander);
}

/// Predicts what should be seen and prepares the search for it.
void Tracker::Implementation::measure(const cv::Mat& image) {
  visible_ = map_.visible(filter_, camera_, options_.map, options_.image.border_px);
  auto chosen = map_.choose(visible_, camera_, options_.map.features_per_frame);
  const Eigen::Isometry3d T_world_camera = filter_.camera().poseWorldCamera();
  candidates_.clear();
  templates_.clear();
  std::vector<FeatureId> ids;
  for (VisibleFeature& feature : chosen) {
    const SourcePatch& patch = map_.find(feature.id)->patch;
    Template expected;
    if (!bendView(patch, camera_, T_world_camera, homogeneousPosition(*filter_.find(feature.id)),
                  &feature.view) ||
        !warpTemplate(patch, feature.view, options_.image.template_size_px, &expected) ||
        expected.contrast() < options_.image.minimum_contrast)
      continue;
    candidates_.push_back(feature);
    templates_.push_back(expected);
    ids.push_back(feature.id);
  }
  PredictedMeasurements predicted = filter_.predictMeasurements(camera_, ids);
  prior_.ids = std::move(predicted.ids);
  prior_.z = std::move(predicted.z);
  prior_.S = std::move(predicted.S);
  prior_.noise_variance_px2 = options_.filter.sigma_px * options_.filter.sigma_px;
  if (prior_.ids.size() != ids.size()) {  // some did not project after all
    std::size_t kept = 0;
    for (std::size_t i = 0; i < ids.size() && kept < prior_.ids.size(); ++i) {
      if (ids[i] != prior_.ids[kept]) continue;
      candidates_[kept] = candidates_[i];
      templates_[kept++] = templates_[i];
    }
    candidates_.resize(kept);
    templates_.resize(kept);
  }
  prior_.rates.clear();
  if (options_.learn_rates)
    for (const FeatureId id : prior_.ids)
      prior_.rates.push_back(map_.find(id)->rates.rates({options_.matching.default_rates}));
  search_.beginFrame(image, templates_);
}

/// Asks again, under a prior of its own, in a new search or going on in that of the first attempt,
/// with a share of what is left of the frame's budget; a consensus of at least so many counts, if
/// its joint squared distance (0 where the matcher has none) is at most `chi2_per_degree`.
bool Tracker::Implementation::askToo(Matcher& matcher, const MeasurementPrior& prior,
                                     ImageFeatureSearch& search, double share, double least,
                                     double chi2_per_degree, TrackedFrame* frame) {
  const std::int64_t pixels_before = frame->matching.statistics.pixels_searched;
  const double total_before_ms = frame->matching.statistics.total_ms;
  const double budget_before_ms = frame->matching.statistics.budget_ms;
  const double left = 1.0 - shareOfBudget(partOfBudget(1.0), pixels_before, budget_before_ms);
  if (!(left > 0.0)) return false;
  MatchResult second = matcher.match(prior, search, partOfBudget(share * left));
  second.statistics.pixels_searched += pixels_before;
  second.statistics.total_ms += total_before_ms;
  second.statistics.budget_ms += budget_before_ms;
  const bool is_better =
      second.statistics.matched >= least &&
      second.statistics.mahalanobis2 <= 2.0 * second.statistics.matched * chi2_per_degree;
  if (is_better) {
    frame->matching = std::move(second);
  } else {
    frame->matching.statistics.pixels_searched = second.statistics.pixels_searched;
    frame->matching.statistics.total_ms = second.statistics.total_ms;
    frame->matching.statistics.budget_ms = second.statistics.budget_ms;
  }
  return is_better;
}

/// The prior once it is known how the image as a whole moved since the last whose camera is known.
/// Empty when that can't be told.
std::optional<MeasurementPrior> Tracker::Implementation::guidedPrior(const cv::Mat& image) const {
  if (image_before_.size() != image.size()) return std::nullopt;
  const Eigen::Isometry3d T_camera_world = T_world_camera_before_.inverse();
  const int n = prior_.size();
  std::vector<std::optional<Eigen::Vector2d>> before_px(n);
  for (int i = 0; i < n; ++i) {
    const Eigen::Vector4d point = homogeneousPosition(*filter_.find(prior_.ids[i]));
    before_px[i] = camera_.project(T_camera_world.linear() * point.head<3>() +
                                   point.w() * T_camera_world.translation());
  }
  const auto motion =
      estimateImageMotion(image_before_, image, predictedImageMotion(prior_, before_px));
  if (!motion) return std::nullopt;
  return conditionOnImageMotion(prior_, before_px, *motion);
}

/// Matches that a result should have. One that was cut short need not answer for the features that
/// its budget did not suffice for, unless those searched had several matches each: then it has
/// chosen without having heard the others.
double Tracker::Implementation::expectedOf(const MatchStatistics& s) const {
  constexpr double kSeveral = 1.5;
  if (!s.cut_short) return map_.expectedMatches(candidates_);
  std::vector<VisibleFeature> searched;
  for (std::size_t i = 0; i < candidates_.size(); ++i)
    if (search_.searchedPixels(static_cast<int>(i)).size() > 0) searched.push_back(candidates_[i]);
  const bool is_crowded = s.matches_met > kSeveral * static_cast<double>(searched.size());
  return map_.expectedMatches(is_crowded ? candidates_ : searched);
}

/// Whether as many matches agree by accident, among all that were met. In the first images depths
/// are so vague that matches leave each other most of their gates: only very few count for nothing.
bool Tracker::Implementation::isByChance(const MatchResult& result, double expected) const {
  if (initialiser_.isFirstInSight()) return result.statistics.matched < kLeastShare * expected;
  if (result.statistics.matched >= kMajority * expectedOf(result.statistics)) return false;
  std::vector<int> matches, accepted;
  for (int i = 0; i < prior_.size(); ++i) {
    matches.push_back(static_cast<int>(search_.matches(i).size()));
    if (result.match_of_feature[i] >= 0) accepted.push_back(i);
  }
  return logFalseAlarms(prior_.S, matches, accepted) > kMostLogFalseAlarms;
}

/// A slower camera, or a gap, leaves more time: the budget is meant for 30 Hz.
MatchOptions Tracker::Implementation::partOfBudget(double share) const {
  MatchOptions options = options_.matching;
  const double interval_s = std::min(interval_s_, options_.max_frame_interval_s);
  options.max_milliseconds *= share * std::max(1.0, 30.0 * interval_s);
  if (options.max_pixels > 0)
    options.max_pixels =
        std::max<std::int64_t>(1, std::llround(share * static_cast<double>(options.max_pixels)));
  return options;
}

/// Asks the matcher, and again when far fewer features matched than should have:
/// - The same matcher under the motion of the image as a whole, for a camera that was jerked. Where
///   the ellipses are wide from the start, that comes first and holds for all.
/// - Where structure repeats in gates as wide as the image, a sequential matcher can lose the true
///   hypothesis among hundreds of equals while all are still short, and be sure of a wrong one:
///   JCBB, which asks for the longest. Since that pairs whatever its test lets pass, it counts only
///   if it agrees far better than it must.
/// - A sequential matcher that follows something that moves by itself (a hand, a door) first, can
///   end up with that and little else: RANSAC.
/// What is then still less than half of what should match counts only if it is no accident: a few
/// matches that agree by chance in a blurred image throw the camera off, where none would let it
/// wait for the next image.
void Tracker::Implementation::match(const cv::Mat& image, TrackedFrame* frame) {
  if (!options_.second_opinion) {
    frame->matching = matcher_->match(prior_, search_, partOfBudget(1.0));
    return;
  }
  const bool is_wide = gatesPixels(prior_) > kWideGatesPx;
  const auto guided = is_wide ? guidedPrior(image) : std::nullopt;
  const MeasurementPrior& prior = guided ? *guided : prior_;
  frame->matching = matcher_->match(prior, search_, partOfBudget(kFirstShare));
  const double expected = map_.expectedMatches(candidates_);
  if (expected < 8.0) return;
  const auto isPoor = [&] {
    const MatchStatistics& s = frame->matching.statistics;
    return s.matched <= (s.ambiguous ? kPoorShareWhenAmbiguous : kPoorShare) * expectedOf(s);
  };
  if (!is_wide && isPoor()) {
    if (const auto jerked = guidedPrior(image)) {
      second_search_.beginFrame(image, templates_);
      if (askToo(*matcher_, *jerked, second_search_, kShareOfRest,
                 std::max(kClearlyMore * frame->matching.statistics.matched, kMajority * expected),
                 0.0, frame))
        std::swap(search_, second_search_);  // match indices belong to the search that found them
    }
  }
  // After some poor frames the ellipses are so wide that chance alone makes a consensus.
  if (poor_frames_ <= kFewPoorFrames) {
    // Both look where the ellipses are, so what has been searched there need not be again.
    bool is_settled = false;
    const int matched = frame->matching.statistics.matched;
    if (isPoor())
      is_settled =
          askToo(*longest_matcher_, prior, search_, kShareOfRest,
                 std::max(1.0 * matched, kMajority * expected), kCloseChi2PerDegree, frame);
    if (!is_settled && frame->matching.statistics.matched <= kPoorShare * expected)
      askToo(*consensus_matcher_, prior, search_, 1.0,
             std::max(kClearlyMore * frame->matching.statistics.matched, kLeastShare * expected),
             kFarChi2PerDegree, frame);
  }
  MatchResult& result = frame->matching;
  if (!isByChance(result, expected)) return;
  std::fill(result.match_of_feature.begin(), result.match_of_feature.end(), -1);
  result.statistics.matched = 0;
}

/// Learns from what the matches fused miss of the map as it is now how noisy they are. Where the
/// state has followed nearly all of a match, what is left tells nothing.
void Tracker::Implementation::learnNoise(const UpdateReport& report) {
  if (initialiser_.areDepthsGuessed()) return;
  const Eigen::Vector2d unknown =
      Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  std::vector<Eigen::Vector2d> residuals_px;
  for (std::size_t i = 0; i < fused_.size(); ++i) {
    const FeatureId id = fused_[i].id;
    const double left = report.noise_left[i];
    const double unit = std::sqrt(left) * match_noise_.likeMost(map_.find(id)->noise);
    residuals_px.push_back(left > kLeastNoiseLeft ? Eigen::Vector2d(report.left_px[i] / unit)
                                                  : unknown);
  }
  const double shown_px = match_noise_.learn(residuals_px);
  if (!(shown_px > 0.0)) return;
  std::vector<double> lasting;
  for (std::size_t i = 0; i < fused_.size(); ++i) {
    const FeatureId id = fused_[i].id;
    map_.learnNoise(id, residuals_px[i], shown_px);
    if (const auto known = map_.find(id)->noise.lasting()) lasting.push_back(*known);
  }
  match_noise_.learnLasting(std::move(lasting));
}

/// Fuses the accepted matches, and learns from them.
void Tracker::Implementation::correct(const cv::Mat& image, TrackedFrame* frame) {
  std::vector<int> matched;
  const int n = prior_.size();
  for (int i = 0; i < n; ++i) {
    frame->matches.push_back(search_.matches(i));
    if (frame->matching.match_of_feature[i] >= 0) matched.push_back(i);
  }
  const int m = static_cast<int>(matched.size());
  const auto matchOf = [&](int i) -> const SearchMatch& {
    return search_.matches(i)[frame->matching.match_of_feature[i]];
  };
  Eigen::VectorXd innovation(2 * m);
  for (int a = 0; a < m; ++a)
    innovation.segment<2>(2 * a) = matchOf(matched[a]).pixel - prior_.mean(matched[a]);
  const Eigen::MatrixXd S = selectFeatures(prior_.S, matched);
  std::vector<FeatureMeasurement> fused;
  std::vector<double> seen_px;
  for (int k : agreeingMeasurements(innovation, S, kAgreementChi2)) {
    const FeatureId id = prior_.ids[matched[k]];
    const SearchMatch& match = matchOf(matched[k]);
    fused.push_back({id, match.pixel, match.sigma_px, 1.0, match.noise_shape});
    if (match.sigma_px > 0.0) seen_px.push_back(match.sigma_px);
  }
  match_noise_.see(std::move(seen_px));
  match_noise_.seeMotion(matchMotions(fused_, fused));
  frame->match_sigma_px = match_noise_.sigma_px(options_.filter);
  for (FeatureMeasurement& match : fused) {
    map_.seeNoise(match.id, match.sigma_px / match_noise_.ofImage());
    const MapFeature& feature = *map_.find(match.id);
    match.sigma_px = match_noise_.sigma_px(options_.filter, feature.noise);
    match.lasting = match_noise_.lastingLikeMost(feature.noise);
    if (initialiser_.isAdjusting(match.id)) {
      match.repetitions = kLearntByAdjustment;
      match.sigma_px *= kNoiseWhileAdjusted;
    } else if (!feature.known) {  // it lies where it was said to, whatever its first images showed
      match.repetitions = match_noise_.repetitions(feature.noise);
    }
  }
  fused_ = std::move(fused);

  const UpdateReport report = filter_.update(camera_, fused_);
  learnNoise(report);
  frame->nis = report.nis;
  frame->nis_degrees = 2 * report.used;

  std::vector<SearchRecord> records;
  std::size_t next = 0;
  for (int i = 0; i < n; ++i) {
    const bool used = next < fused_.size() && fused_[next].id == prior_.ids[i];
    if (used) map_.learnSlope(candidates_[i], templates_[i], image, fused_[next].pixel);
    const Eigen::Vector2d innovation_px =
        used ? Eigen::Vector2d(fused_[next++].pixel - prior_.mean(i)) : Eigen::Vector2d::Zero();
    const std::int64_t pixels = search_.searchedPixels(i).size();
    if (used || pixels > 0)
      records.push_back({prior_.ids[i], used, static_cast<std::int64_t>(search_.matches(i).size()),
                         pixels, innovation_px});
  }
  map_.record(records, frame->index);
}

}  // namespace active_matching_slam
