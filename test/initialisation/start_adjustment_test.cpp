#include "active_matching_slam/initialisation/start_adjustment.h"

#include <gtest/gtest.h>

#include <map>
#include <utility>

#include "active_matching_slam/math/quantile.h"
#include "initialisation/example_bundle.h"

namespace active_matching_slam {
namespace {

/// A filter that has believed for `bundle`'s first images that the camera stood still.
class StartOfATrack {
 public:
  explicit StartOfATrack(const Bundle& truth)
      : truth_(truth), model_(exampleCalibration()), filter_(options()) {
    filter_.reset(CameraState(), 1e-8 * Eigen::Matrix<double, 12, 12>::Identity());
    std::vector<FeatureMeasurement> first;
    for (const BundleObservation& o : truth.observations.front()) {
      const FeatureId id = filter_.addInverseDepthFeature(model_, o.pixel);
      place_of_id_.push_back(o.feature);
      first.push_back({id, o.pixel, 0.0});
    }
    adjustment_.begin(0, first);
  }

  /// What the images up to `image` make of it; nothing is adjusted before the last.
  std::optional<AdjustedStart> adjustAfter(int image) {
    show(image);
    return adjust();
  }

  /// All images not yet shown up to `image`.
  void show(int image) {
    for (; shown_ < image; ++shown_) {
      std::vector<FeatureMeasurement> seen;
      for (const BundleObservation& o : truth_.observations[shown_ + 1]) {
        const auto it = std::find(place_of_id_.begin(), place_of_id_.end(), o.feature);
        if (it == place_of_id_.end()) continue;
        seen.push_back({it - place_of_id_.begin(), o.pixel, 0.0});
        const auto sigma = sigma_px_of_place_.find(o.feature);
        if (sigma != sigma_px_of_place_.end()) seen.back().sigma_px = sigma->second;
      }
      adjustment_.add(shown_ + 1, 1.0 / 30.0, filter_, seen);
    }
  }

  /// FeatureMeasurement::sigma_px by the feature's place in the bundle.
  void setSigmas(const std::map<int, double>& sigma_px_of_place) {
    sigma_px_of_place_ = sigma_px_of_place;
  }

  /// Puts the filter's camera there, as it will be taken to be in the images to come.
  void believeIn(const Eigen::Vector3d& position_world) {
    CameraState camera = filter_.camera();
    camera.position_world = position_world;
    filter_.restore(camera, filter_.features(), filter_.covariance(), filter_.nextId());
  }

  /// Lets the filter be sure of the distances that it believes in, to this share of them.
  void beSure(double relative_sigma) {
    Eigen::MatrixXd covariance = filter_.covariance();
    for (const FeatureState& feature : filter_.features()) {
      const int row = feature.inverseDepthRow();
      covariance.row(row).setZero();
      covariance.col(row).setZero();
      covariance(row, row) = std::pow(relative_sigma * feature.inverse_depth, 2);
    }
    filter_.restore(filter_.camera(), filter_.features(), covariance, filter_.nextId());
  }

  void rescale(double factor) {
    filter_.rescale(factor);
    adjustment_.rescale(factor);
  }

  /// Those that `image` shows first.
  void startFeatures(int image) {
    std::vector<FeatureMeasurement> first_sights;
    for (const BundleObservation& o : truth_.observations[image]) {
      if (std::find(place_of_id_.begin(), place_of_id_.end(), o.feature) != place_of_id_.end())
        continue;
      first_sights.push_back({filter_.addInverseDepthFeature(model_, o.pixel), o.pixel, 0.0});
      place_of_id_.push_back(o.feature);
    }
    adjustment_.addFirstSights(first_sights);
  }

  /// An adjustment takes as many as three steps, one a call.
  std::optional<AdjustedStart> adjust() {
    std::optional<AdjustedStart> adjusted;
    for (int step = 0; step < 3 && !adjusted; ++step) adjusted = adjustOnce();
    return adjusted;
  }

  std::optional<AdjustedStart> adjustOnce() { return adjustment_.adjust(model_, filter_); }

  static FilterOptions options() {
    FilterOptions options;
    options.sigma_px = 0.5;
    return options;
  }

  const StartAdjustment& adjustment() const { return adjustment_; }
  Ekf& filter() { return filter_; }
  int featureOf(FeatureId id) const { return place_of_id_[static_cast<std::size_t>(id)]; }

 private:
  Bundle truth_;
  CameraModel model_;
  Ekf filter_;
  StartAdjustment adjustment_;
  std::vector<int> place_of_id_;  ///< in the bundle
  std::map<int, double> sigma_px_of_place_;
  int shown_ = 0;  ///< the last image
};

Bundle track(int images, double step_m, unsigned seed) {
  return exampleBundle(CameraModel(exampleCalibration()), images, 40, step_m, 0.2, seed);
}

double medianInverseDepth(const AdjustedStart& adjusted) {
  std::vector<double> inverse_depths;
  for (const FeatureState& feature : adjusted.features)
    inverse_depths.push_back(feature.inverse_depth);
  return medianOf(std::move(inverse_depths));
}

/// Length of the adjusted way by that of the true one.
double scaleOf(const AdjustedStart& adjusted, const CameraState& truth) {
  return adjusted.camera.position_world.norm() / truth.position_world.norm();
}

TEST(StartAdjustment, FindsTheMoveThatTheFilterMissed) {
  const Bundle truth = track(12, 0.02, 1);
  StartOfATrack start(truth);
  const auto adjusted = start.adjustAfter(11);
  ASSERT_TRUE(adjusted);
  EXPECT_GT(cosineBetween(adjusted->camera.position_world, truth.cameras[11].position_world), 0.99);
  EXPECT_LT(adjusted->camera.q_world_camera.angularDistance(truth.cameras[11].q_world_camera),
            0.01);
  const double scale = scaleOf(*adjusted, truth.cameras.back());
  const Eigen::Vector3d velocity =
      30.0 * (truth.cameras[11].position_world - truth.cameras[10].position_world);
  EXPECT_LT((adjusted->camera.velocity_world / scale - velocity).norm(), 0.2 * velocity.norm());
  // The unit of length: the median depth is what it was.
  EXPECT_NEAR(medianInverseDepth(*adjusted), 1.0, 0.05);
  // The state is one that a filter takes, and its errors are within its covariance.
  start.filter().restore(adjusted->camera, adjusted->features, adjusted->covariance, 1000);
  double sum = 0.0;
  for (const FeatureState& feature : start.filter().features()) {
    const double error =
        feature.inverse_depth * scale - truth.features[start.featureOf(feature.id)].inverse_depth;
    sum += std::pow(error / (scale * start.filter().sigmaInverseDepth(feature)), 2);
  }
  EXPECT_LT(sum / static_cast<double>(adjusted->features.size()), 2.5);
}

TEST(StartAdjustment, WhatIsNearTellsTheMoveAlsoWhenItCameAfterTheFirstImage) {
  constexpr int kFar = 39;
  Bundle truth = exampleBundle(CameraModel(exampleCalibration()), 12, 60, 0.005, 0.05, 9, 0.65);
  for (int k = 0; k < 2; ++k) {
    auto& seen = truth.observations[k];
    seen.erase(std::remove_if(seen.begin(), seen.end(),
                              [](const BundleObservation& o) { return o.feature >= kFar; }),
               seen.end());
  }
  StartOfATrack start(truth);
  start.show(2);
  start.startFeatures(2);
  const auto adjusted = start.adjustAfter(11);
  ASSERT_TRUE(adjusted);
  const AdjustedStart::Move& some = adjusted->moves[adjusted->moves.size() / 2];
  EXPECT_GT(cosineBetween(adjusted->camera.position_world - some.T_world_camera_after.translation(),
                          truth.cameras[11].position_world -
                              truth.cameras[static_cast<std::size_t>(some.image)].position_world),
            0.99);
}

TEST(StartAdjustment, SaysWhereTheCamerasOfTheStartWere) {
  const Bundle truth = track(12, 0.02, 2);
  StartOfATrack start(truth);
  const auto adjusted = start.adjustAfter(11);
  ASSERT_TRUE(adjusted);
  // The filter believed in a camera at rest; the correction takes image 5 to its place.
  const Eigen::Isometry3d corrected = adjusted->corrected(5, Eigen::Isometry3d::Identity());
  EXPECT_GT(cosineBetween(corrected.translation(), truth.cameras[5].position_world), 0.9);
}

TEST(StartAdjustment, ACameraThatOnlyTurnsIsLeftAlone) {
  Bundle truth = track(12, 0.02, 3);
  const CameraModel model(exampleCalibration());
  Random random(3);
  for (std::size_t k = 0; k < truth.cameras.size(); ++k) {
    truth.cameras[k].position_world.setZero();
    truth.observations[k].clear();
    for (std::size_t i = 0; i < truth.features.size(); ++i) {
      const auto p = projectFeature(model, truth.cameras[k], truth.features[i]);
      const double du = random.normal(0.2), dv = random.normal(0.2);
      if (p) truth.observations[k].push_back({int(i), p->pixel + Eigen::Vector2d(du, dv)});
    }
  }
  StartOfATrack start(truth);
  EXPECT_FALSE(start.adjustAfter(11));
  EXPECT_TRUE(start.adjustment().isActive());
}

TEST(StartAdjustment, AFeatureThatWandersIsLeftOut) {
  Bundle truth = track(12, 0.02, 4);
  const int wanderer = truth.observations.front()[5].feature;
  for (std::size_t k = 0; k < truth.cameras.size(); ++k)
    for (BundleObservation& o : truth.observations[k])
      if (o.feature == wanderer) o.pixel.y() += (k % 4 < 2 ? 4.0 : -4.0);
  StartOfATrack start(truth);
  const auto adjusted = start.adjustAfter(11);
  ASSERT_TRUE(adjusted);
  for (const FeatureState& feature : adjusted->features)
    EXPECT_NE(start.featureOf(feature.id), wanderer);
  EXPECT_GT(adjusted->features.size(), truth.observations.front().size() / 2);
}

TEST(StartAdjustment, OneWrongMatchDoesNotMakeTheMoveAnother) {
  constexpr int kRuns = 40, kLast = 4;
  int adjusted_runs = 0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    SCOPED_TRACE(seed);
    Bundle truth =
        exampleBundle(CameraModel(exampleCalibration()), kLast + 1, 30, 0.0025, 0.03, seed, 0.5);
    auto& last = truth.observations[kLast];
    last[seed % last.size()].pixel += Eigen::Vector2d(2.0, -11.0);  // across the move
    StartOfATrack start(truth);
    const auto adjusted = start.adjustAfter(kLast);
    if (!adjusted) continue;  // in doubt
    ++adjusted_runs;
    EXPECT_GT(cosineBetween(adjusted->camera.position_world, truth.cameras[kLast].position_world),
              0.8);
  }
  EXPECT_GT(adjusted_runs, kRuns / 2);
}

TEST(StartAdjustment, ABlurredImageCountsForLess) {
  // Every other image is far noisier, which nobody tells: with these the result is no worse than
  // without.
  constexpr int kRuns = 8, kLast = 11;
  double with = 0.0, without = 0.0;  // squared errors of the depths, in the unit that fits best
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    Bundle truth =
        exampleBundle(CameraModel(exampleCalibration()), kLast + 1, 40, 0.005, 0.05, seed);
    Random random(seed);
    Bundle sharp = truth;
    for (int k = kLast - 1; k >= 2; k -= 2) {
      for (BundleObservation& o : truth.observations[k])
        for (int axis = 0; axis < 2; ++axis) o.pixel[axis] += random.normal(0.25);
      sharp.cameras.erase(sharp.cameras.begin() + k);
      sharp.observations.erase(sharp.observations.begin() + k);
    }
    for (const Bundle& shown : {truth, sharp}) {
      StartOfATrack start(shown);
      const auto adjusted = start.adjustAfter(static_cast<int>(shown.cameras.size()) - 1);
      ASSERT_TRUE(adjusted) << seed;
      std::vector<double> ratios;
      double mean = 0.0;
      for (const FeatureState& feature : adjusted->features) {
        ratios.push_back(feature.inverse_depth /
                         truth.features[start.featureOf(feature.id)].inverse_depth);
        mean += ratios.back();
      }
      mean /= static_cast<double>(ratios.size());
      double& squares = shown.cameras.size() > sharp.cameras.size() ? with : without;
      for (const double ratio : ratios)
        squares += std::pow(ratio / mean - 1.0, 2) / (kRuns * ratios.size());
    }
  }
  std::printf("depths err by %.4f, %.4f without the blurred images\n", std::sqrt(with),
              std::sqrt(without));
  EXPECT_LT(with, 1.2 * without);
}

TEST(StartAdjustment, NoisyFeaturesWeighLess) {
  constexpr int kRuns = 20, kLast = 11;
  constexpr double kSigma_px = 0.03, kLargeSigma_px = 0.1;
  double weighted = 0.0, uniform = 0.0;  // squared angles between estimated and true direction
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    Bundle truth =
        exampleBundle(CameraModel(exampleCalibration()), kLast + 1, 40, 0.005, kSigma_px, seed);
    Random random(seed);
    std::map<int, double> sigmas_px, same_px;
    for (int place = 0; place < 40; ++place) {
      sigmas_px[place] = place % 3 == 0 ? kLargeSigma_px : kSigma_px;
      same_px[place] = kSigma_px;
    }
    for (int k = 1; k <= kLast; ++k)
      for (BundleObservation& o : truth.observations[k])
        if (o.feature % 3 == 0)
          o.pixel += Eigen::Vector2d(random.normal(kLargeSigma_px), random.normal(kLargeSigma_px));
    for (const bool is_weighted : {true, false}) {
      StartOfATrack start(truth);
      start.setSigmas(is_weighted ? sigmas_px : same_px);
      const auto adjusted = start.adjustAfter(kLast);
      ASSERT_TRUE(adjusted) << seed;
      const double angle =
          std::acos(std::min(1.0, cosineBetween(adjusted->camera.position_world,
                                                truth.cameras[kLast].position_world)));
      (is_weighted ? weighted : uniform) += angle * angle / kRuns;
    }
  }
  std::printf("direction off by %.4f rad, by %.4f with equal weights\n", std::sqrt(weighted),
              std::sqrt(uniform));
  EXPECT_LT(weighted, uniform);
}

TEST(StartAdjustment, AScaleThatIsSetMeanwhileHoldsForEarlierImagesToo) {
  const Bundle truth = track(12, 0.02, 6);
  StartOfATrack start(truth);
  constexpr double kFactor = 3.0;
  constexpr int kSet = 5;
  const Eigen::Vector3d believed(0.02, 0.0, -0.01);
  start.believeIn(believed);
  start.show(kSet);
  start.rescale(kFactor);
  const auto adjusted = start.adjustAfter(11);
  ASSERT_TRUE(adjusted);
  EXPECT_NEAR(kFactor * medianInverseDepth(*adjusted), 1.0, 0.05);
  // A patch taken from where that camera was believed to be is now where the camera was.
  Eigen::Isometry3d T_world_camera = Eigen::Isometry3d::Identity();
  T_world_camera.translation() = kFactor * believed;
  const Eigen::Vector3d place =
      scaleOf(*adjusted, truth.cameras.back()) * truth.cameras[kSet].position_world;
  EXPECT_LT((adjusted->corrected(kSet, T_world_camera).translation() - place).norm(),
            0.1 * place.norm());
}

TEST(StartAdjustment, GoesOnWhenTheFirstImageIsOutOfSight) {
  // Features come and go; the filter forgets those that went, but what the first images say of them
  // still counts.
  constexpr int kPerImage = 5, kInSight = 40, kLast = 11;
  Bundle truth = exampleBundle(CameraModel(exampleCalibration()), kLast + 1,
                               kPerImage * kLast + kInSight, 0.003, 0.2, 6);
  for (int k = 0; k <= kLast; ++k) {
    auto& seen = truth.observations[k];
    seen.erase(std::remove_if(seen.begin(), seen.end(),
                              [k](const BundleObservation& o) {
                                return o.feature < kPerImage * k ||
                                       o.feature >= kPerImage * k + kInSight;
                              }),
               seen.end());
  }
  StartOfATrack start(truth);
  for (int k = 1; k < kLast; ++k) {
    start.show(k);
    start.startFeatures(k);
  }
  std::vector<FeatureId> gone;
  for (const FeatureState& feature : start.filter().features())
    if (start.featureOf(feature.id) < kPerImage * kLast) gone.push_back(feature.id);
  ASSERT_GT(gone.size(), 20u);
  start.filter().removeFeatures(gone);
  start.show(kLast);
  const auto adjusted = start.adjust();
  ASSERT_TRUE(adjusted);
  EXPECT_TRUE(start.adjustment().isActive());
  EXPECT_FALSE(start.adjustment().areDepthsVague());
  EXPECT_GT(adjusted->features.size(), 10u);
  for (const FeatureState& feature : adjusted->features)
    EXPECT_NE(start.filter().find(feature.id), nullptr);
  EXPECT_EQ(adjusted->moves.front().image, 0);
  EXPECT_GT(cosineBetween(adjusted->camera.position_world, truth.cameras[kLast].position_world),
            0.98);
}

TEST(StartAdjustment, TheUnitOfTheDepthsStays) {
  const Bundle truth = track(24, 0.002, 7);
  StartOfATrack start(truth);
  const auto first = start.adjustAfter(11);
  ASSERT_TRUE(first);
  start.filter().restore(first->camera, first->features, first->covariance, 1000);
  for (int k = 12; k <= 23; ++k) {
    start.filter().predict(1.0 / 30.0);
    start.show(k);
  }
  const auto second = start.adjust();
  ASSERT_TRUE(second);
  // That which the first adjustment's depths tell, by what each tells: as the square of how near.
  double sum = 0.0, squares = 0.0, weights = 0.0;
  for (const FeatureState& feature : second->features) {
    const double before = start.filter().find(feature.id)->inverse_depth;
    const double weight = before * before, ratio = std::log(feature.inverse_depth / before);
    sum += weight * ratio;
    squares += weight * ratio * ratio;
    weights += weight;
  }
  const double spread = std::sqrt(squares / weights);
  EXPECT_GT(spread, 0.01) << "nothing was learnt";
  EXPECT_LT(std::abs(sum / weights), 0.1 * spread);
  EXPECT_GT(cosineBetween(second->camera.position_world, truth.cameras[23].position_world), 0.99);
}

// Images tell nothing of a change of all lengths: only the unit says how certain they are.
TEST(StartAdjustment, TheUnitIsKnownToATenthOfWhatLengthsAreUncertainBy) {
  const Bundle truth = track(24, 0.002, 7);
  StartOfATrack start(truth);
  const auto first = start.adjustAfter(11);
  ASSERT_TRUE(first);
  start.filter().restore(first->camera, first->features, first->covariance, 1000);
  for (int k = 12; k <= 23; ++k) {
    start.filter().predict(1.0 / 30.0);
    start.show(k);
  }
  // As certain as before.
  start.filter().restore(start.filter().camera(), first->features, first->covariance, 1000);
  const Eigen::Vector3d way = start.filter().camera().position_world;
  const Eigen::Matrix3d P = start.filter().cameraCovariance().topLeftCorner<3, 3>();
  const double length_sigma = std::sqrt(way.dot(P * way)) / way.squaredNorm();
  const auto second = start.adjust();
  ASSERT_TRUE(second);
  // Of the camera's position and rotation and the features, whose rows come after the camera's.
  const int more = CameraError::kSize - 6, n = static_cast<int>(second->covariance.rows()) - more;
  Eigen::MatrixXd covariance(n, n);
  covariance << second->covariance.topLeftCorner(6, 6), second->covariance.topRightCorner(6, n - 6),
      second->covariance.bottomLeftCorner(n - 6, 6),
      second->covariance.bottomRightCorner(n - 6, n - 6);
  Eigen::VectorXd all_larger = Eigen::VectorXd::Zero(n);
  all_larger.head<3>() = second->camera.position_world;
  for (const FeatureState& feature : second->features)
    all_larger[feature.inverseDepthRow() - more] = -feature.inverse_depth;
  const double sigma = 1.0 / std::sqrt(all_larger.dot(covariance.llt().solve(all_larger)));
  std::printf("lengths to %.5f, their unit to %.5f\n", length_sigma, sigma);
  EXPECT_NEAR(sigma, 0.1 * length_sigma, 0.01 * length_sigma);
}

TEST(StartAdjustment, GoesInStepsAndTakesInTheImageOfTheLast) {
  for (const auto& [images, steps] : {std::pair{12, 2}, std::pair{26, 3}}) {
    const Bundle truth = track(images, 0.003, 9);
    StartOfATrack start(truth);
    start.show(images - steps);
    for (int step = 1; step < steps; ++step) {
      EXPECT_FALSE(start.adjustOnce()) << images << " images, step " << step;
      start.filter().predict(1.0 / 30.0);
      start.show(images - steps + step);
    }
    const auto adjusted = start.adjustOnce();
    ASSERT_TRUE(adjusted) << images;
    EXPECT_EQ(adjusted->moves.back().image, images - 1);
    EXPECT_GT(
        cosineBetween(adjusted->camera.position_world, truth.cameras[images - 1].position_world),
        0.99);
    StartOfATrack at_once(truth);
    const auto same = at_once.adjustAfter(images - 1);
    ASSERT_TRUE(same) << images;
    EXPECT_EQ(adjusted->features.size(), same->features.size());
    // The unit of length is told by the depths.
    const Eigen::Vector3d moved = adjusted->camera.position_world * medianInverseDepth(*adjusted);
    const Eigen::Vector3d moved_at_once = same->camera.position_world * medianInverseDepth(*same);
    EXPECT_LT((moved - moved_at_once).norm(), 0.02 * moved.norm()) << images;
  }
}

TEST(StartAdjustment, ASettledReadingIsAdjustedFurtherFromWhatTheFilterBelieves) {
  // The first adjustment settles it: from the second on nothing else is tried.
  constexpr double kStep = 0.003;
  const Bundle truth = track(36, kStep, 8);
  StartOfATrack start(truth);
  std::vector<double> errors, sigmas;
  for (const int last : {11, 23, 35}) {
    const auto adjusted = start.adjustAfter(last);
    ASSERT_TRUE(adjusted) << last;
    EXPECT_GT(cosineBetween(adjusted->camera.position_world, truth.cameras[last].position_world),
              0.99);
    const auto trueInverseDepth = [&](const FeatureState& feature) {
      return truth.features[start.featureOf(feature.id)].inverse_depth;
    };
    double sum = 0.0, true_sum = 0.0;  // which tell the unit of length
    for (const FeatureState& feature : adjusted->features) {
      sum += feature.inverse_depth;
      true_sum += trueInverseDepth(feature);
    }
    double squares = 0.0, variances = 0.0;
    for (const FeatureState& feature : adjusted->features) {
      const double by_truth = feature.inverse_depth / sum * true_sum / trueInverseDepth(feature);
      const int row = feature.inverseDepthRow();
      squares += std::pow(by_truth - 1.0, 2);
      variances += adjusted->covariance(row, row) / std::pow(feature.inverse_depth, 2);
    }
    errors.push_back(std::sqrt(squares / adjusted->features.size()));
    sigmas.push_back(std::sqrt(variances / adjusted->features.size()));
    start.filter().restore(adjusted->camera, adjusted->features, adjusted->covariance, 1000);
  }
  for (std::size_t i = 1; i < errors.size(); ++i) {
    EXPECT_LT(errors[i], errors[i - 1]);
    EXPECT_LT(sigmas[i], sigmas[i - 1]);
    EXPECT_LT(errors[i], 2.0 * sigmas[i]);
  }
}

TEST(StartAdjustment, EndsWhenTheFilterKnowsMore) {
  constexpr double kEnough = 0.005, kTooLittle = 0.002;  // parallax, for such steps [m]
  constexpr double kSure = 1e-3, kLessSure = 0.02;       // than what the images tell
  for (const unsigned seed : {1u, 2u, 3u}) {
    StartOfATrack vague(track(12, kEnough, seed)), known(track(12, kEnough, seed)),
        known_less(track(12, kEnough, seed)), early(track(12, kTooLittle, seed));
    known.beSure(kSure);
    known_less.beSure(kLessSure);
    early.beSure(kSure);
    EXPECT_FALSE(known.adjustAfter(11));
    EXPECT_FALSE(known.adjustment().isActive());
    for (StartOfATrack* start : {&vague, &known_less, &early}) {
      EXPECT_TRUE(start->adjustAfter(11));
      EXPECT_TRUE(start->adjustment().isActive());
    }
  }
}

TEST(StartAdjustment, EndsWhenNoEarlierImageIsInSight) {
  Bundle truth = track(12, 0.02, 5);
  StartOfATrack start(truth);
  for (std::size_t k = 6; k < truth.observations.size(); ++k) truth.observations[k].resize(4);
  StartOfATrack lost(truth);
  EXPECT_FALSE(lost.adjustAfter(11));
  EXPECT_FALSE(lost.adjustment().isActive());
}

}  // namespace
}  // namespace active_matching_slam
