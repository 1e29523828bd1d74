#include "active_matching_slam/initialisation/initialiser.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

#include "active_matching_slam/math/quantile.h"
#include "initialisation/example_bundle.h"

namespace active_matching_slam {
namespace {

constexpr double kIntervalS = 1.0 / 30.0;

/// A filter that takes the camera of `truth`'s images to stand still, and the initialiser that sees
/// what it sees.
class Start {
 public:
  explicit Start(const Bundle& truth, const InitialiserOptions& options = {})
      : truth_(truth),
        model_(exampleCalibration()),
        filter_(filterOptions()),
        initialiser_(options) {
    filter_.reset(CameraState(), 1e-8 * Eigen::Matrix<double, 12, 12>::Identity());
    initialiser_.begin({0, 0.0, firstSights(0)});
  }

  static FilterOptions filterOptions() {
    FilterOptions options;
    options.sigma_px = 0.5;
    return options;
  }

  /// Shows the next image; what is committed is restored to the filter.
  std::optional<InitialState> showNext() {
    ++shown_;
    std::vector<FeatureMeasurement> measurements;
    for (const BundleObservation& o : truth_.observations[shown_]) {
      const auto it = std::find(place_of_id_.begin(), place_of_id_.end(), o.feature);
      if (it != place_of_id_.end())
        measurements.push_back({it - place_of_id_.begin(), o.pixel, 0.0});
    }
    std::sort(measurements.begin(), measurements.end(),
              [](const auto& a, const auto& b) { return a.id < b.id; });
    initialiser_.add(model_, {shown_, shown_ * kIntervalS, measurements}, filter_,
                     looked_for_.value_or(static_cast<int>(filter_.features().size())));
    const auto state = initialiser_.step(model_, filter_);
    if (state) filter_.restore(state->camera, state->features, state->covariance, filter_.nextId());
    if (starts_features_) initialiser_.addFirstSights(firstSights(shown_));
    return state;
  }

  /// Shows images up to and with `image`; the last state committed.
  std::optional<InitialState> showUntil(int image) {
    std::optional<InitialState> last;
    while (shown_ < image && !initialiser_.isFirstUnrelated()) {
      auto state = showNext();
      if (!state) continue;
      committed_.push_back(shown_);
      last = std::move(state);
    }
    return last;
  }

  /// How many features an image is searched for; without, all of them.
  void lookFor(int features) { looked_for_ = features; }
  /// From now on what comes into sight is added to the map, and what went is removed.
  void startFeatures() { starts_features_ = true; }

  void rescale(double factor) {
    filter_.rescale(factor);
    initialiser_.rescale(factor);
  }

  const Initialiser& initialiser() const { return initialiser_; }
  Ekf& filter() { return filter_; }
  int featureOf(FeatureId id) const { return place_of_id_[static_cast<std::size_t>(id)]; }
  int shown() const { return shown_; }
  const std::vector<int>& committed() const { return committed_; }  ///< images

 private:
  std::vector<FeatureMeasurement> firstSights(int image) {
    std::vector<FeatureId> gone;
    for (const FeatureState& feature : filter_.features())
      if (std::none_of(truth_.observations[image].begin(), truth_.observations[image].end(),
                       [&](const auto& o) { return o.feature == featureOf(feature.id); }))
        gone.push_back(feature.id);
    filter_.removeFeatures(gone);
    std::vector<FeatureMeasurement> first_sights;
    for (const BundleObservation& o : truth_.observations[image]) {
      if (std::find(place_of_id_.begin(), place_of_id_.end(), o.feature) != place_of_id_.end())
        continue;
      first_sights.push_back({filter_.addInverseDepthFeature(model_, o.pixel), o.pixel, 0.0});
      place_of_id_.push_back(o.feature);
    }
    return first_sights;
  }

  Bundle truth_;
  CameraModel model_;
  Ekf filter_;
  Initialiser initialiser_;
  std::vector<int> place_of_id_;  ///< in the bundle
  std::vector<int> committed_;
  bool starts_features_ = false;
  int shown_ = 0;
  std::optional<int> looked_for_;
};

Bundle track(int images, double step_m, unsigned seed, double sigma_px = 0.2) {
  return exampleBundle(CameraModel(exampleCalibration()), images, 60, step_m, sigma_px, seed);
}

/// Image points of a camera that goes where it is put, past `points` features.
Bundle filmOf(int images, int features, double sigma_px, unsigned seed,
              const std::function<void(int, CameraState*)>& place) {
  const CameraModel model(exampleCalibration());
  Random random(seed);
  Bundle bundle;
  bundle.cameras.resize(images);
  bundle.observations.resize(images);
  for (int i = 0; i < features; ++i) {
    FeatureState feature;
    feature.anchored_at_origin = true;
    const double azimuth = random.uniform(-M_PI, M_PI), height = random.uniform(-0.5, 0.5);
    feature.bearing_world =
        Eigen::Vector3d(std::sin(azimuth), height, std::cos(azimuth)).normalized();
    feature.tangent_world = feature.bearing_world.unitOrthogonal();
    feature.inverse_depth = random.uniform(0.3, 1.5);
    bundle.features.push_back(feature);
  }
  for (int k = 0; k < images; ++k) {
    place(k, &bundle.cameras[k]);
    for (int i = 0; i < features; ++i) {
      const auto p = projectFeature(model, bundle.cameras[k], bundle.features[i]);
      const double du = random.normal(sigma_px), dv = random.normal(sigma_px);
      if (p && model.isInImage(p->pixel))
        bundle.observations[k].push_back({i, p->pixel + Eigen::Vector2d(du, dv)});
    }
  }
  return bundle;
}

double scaleOf(const InitialState& state, const CameraState& truth) {
  return state.camera.position_world.norm() / truth.position_world.norm();
}

/// Relative errors of the inverse depths after the scale is fitted, over their sigmas, squared.
double meanSquaredDepthError(const Start& start, const Bundle& truth, const InitialState& state) {
  double products = 0.0, squares = 0.0, sum = 0.0;
  for (const FeatureState& f : state.features) {
    const double inverse_depth = truth.features[start.featureOf(f.id)].inverse_depth;
    products += f.inverse_depth * inverse_depth;
    squares += inverse_depth * inverse_depth;
  }
  for (const FeatureState& f : state.features) {
    const double expected =
        products / squares * truth.features[start.featureOf(f.id)].inverse_depth;
    const int row = f.inverseDepthRow();
    sum += std::pow(f.inverse_depth - expected, 2) / state.covariance(row, row);
  }
  return sum / static_cast<double>(state.features.size());
}

TEST(Initialiser, FindsTheTranslationThatTheFilterMissed) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Bundle truth = track(20, 0.02, seed);
    Start start(truth);
    const auto state = start.showUntil(19);
    ASSERT_TRUE(state) << seed;
    const CameraState& camera = truth.cameras[start.committed().back()];
    EXPECT_GT(cosineBetween(state->camera.position_world, camera.position_world), 0.99) << seed;
    EXPECT_LT(state->camera.q_world_camera.angularDistance(camera.q_world_camera), 0.01) << seed;
    const double scale = scaleOf(*state, camera);
    const Eigen::Vector3d velocity =
        (truth.cameras[1].position_world - truth.cameras[0].position_world) / kIntervalS;
    EXPECT_LT((state->camera.velocity_world / scale - velocity).norm(), 0.2 * velocity.norm());
    EXPECT_LT(meanSquaredDepthError(start, truth, *state), 2.5) << seed;
  }
}

TEST(Initialiser, GoesThroughItsStatesInOrderAndEnds) {
  const Bundle truth = track(30, 0.01, 1);
  Start start(truth);
  EXPECT_EQ(start.initialiser().state(), InitialiserState::kCollecting);
  auto state = start.initialiser().state();
  while (start.shown() < 29) {
    start.showNext();
    EXPECT_GE(start.initialiser().state(), state);
    state = start.initialiser().state();
  }
  EXPECT_TRUE(start.initialiser().isDone());
}

TEST(Initialiser, KeepsTheMedianDepthAtTheFirstCommitAndTheScaleAtTheNext) {
  const Bundle truth = track(40, 0.004, 7);
  Start start(truth);
  const auto medianInverseDepth = [](const std::vector<FeatureState>& features) {
    std::vector<double> inverse_depths;
    for (const FeatureState& f : features) inverse_depths.push_back(f.inverse_depth);
    return medianOf(std::move(inverse_depths));
  };
  std::optional<InitialState> first;
  while (!first && start.shown() < 39) first = start.showNext();
  ASSERT_TRUE(first);
  EXPECT_TRUE(first->is_first);
  EXPECT_NEAR(medianInverseDepth(first->features), Start::filterOptions().initial_inverse_depth,
              0.05);
  const double scale = scaleOf(*first, truth.cameras[start.shown()]);
  std::optional<InitialState> second;
  while (!second && start.shown() < 39) second = start.showNext();
  ASSERT_TRUE(second);
  EXPECT_FALSE(second->is_first);
  EXPECT_NEAR(scaleOf(*second, truth.cameras[start.shown()]), scale, 0.1 * scale);
}

TEST(Initialiser, EachCommitIsMoreExactAndSaysSo) {
  const Bundle truth = track(40, 0.004, 8);
  Start start(truth);
  std::vector<double> sigmas;
  while (start.shown() < 39) {
    const auto state = start.showNext();
    if (!state) continue;
    double variances = 0.0;
    for (const FeatureState& f : state->features)
      variances += state->covariance(f.inverseDepthRow(), f.inverseDepthRow()) /
                   std::pow(f.inverse_depth, 2);
    sigmas.push_back(std::sqrt(variances / static_cast<double>(state->features.size())));
    EXPECT_LT(meanSquaredDepthError(start, truth, *state), 2.5) << start.shown();
  }
  ASSERT_GE(sigmas.size(), 3u);
  EXPECT_LT(sigmas.back(), 0.5 * sigmas.front());
}

TEST(Initialiser, SaysWhereTheCamerasOfTheFirstImagesWere) {
  const Bundle truth = track(20, 0.02, 2);
  Start start(truth);
  std::optional<InitialState> first;
  while (!first && start.shown() < 19) first = start.showNext();
  ASSERT_TRUE(first);
  // The filter took the camera to rest; the correction takes it to its place.
  const Eigen::Isometry3d corrected = first->corrected(2, Eigen::Isometry3d::Identity());
  EXPECT_GT(cosineBetween(corrected.translation(), truth.cameras[2].position_world), 0.9);
}

TEST(Initialiser, AScaleThatIsSetMeanwhileHolds) {
  constexpr double kFactor = 3.0;
  const Bundle truth = track(20, 0.02, 6);
  Start plain(truth), scaled(truth);
  scaled.rescale(kFactor);
  const auto state = plain.showUntil(19), same = scaled.showUntil(19);
  ASSERT_TRUE(state);
  ASSERT_TRUE(same);
  EXPECT_NEAR(same->camera.position_world.norm(), kFactor * state->camera.position_world.norm(),
              0.01 * kFactor * state->camera.position_world.norm());
}

TEST(Initialiser, PureRotationIsWaitedForHoweverLongAndItsMemoryIsBounded) {
  // The camera turns round and round; only then it moves.
  constexpr int kRotating = 400, kImages = 450;
  const InitialiserOptions options;
  for (unsigned seed = 1; seed <= 2; ++seed) {
    const Bundle film = filmOf(kImages, 400, 0.1, seed, [](int k, CameraState* camera) {
      camera->q_world_camera = rotationFromVector(Eigen::Vector3d(0.0, 0.02 * k, 0.0));
      camera->position_world =
          0.01 * std::max(0, k - kRotating) * Eigen::Vector3d(0.5, 0.2, 1.0).normalized();
    });
    Start start(film);
    start.startFeatures();
    for (int k = 1; k < kRotating; ++k) {
      ASSERT_FALSE(start.showNext()) << "seed " << seed << " image " << k;
      ASSERT_TRUE(start.initialiser().areDepthsGuessed());
      ASSERT_LE(start.initialiser().keyframes(), static_cast<int>(options.maximum_keyframes));
    }
    const auto state = start.showUntil(kImages - 1);
    ASSERT_TRUE(state) << seed;
    const int last = start.committed().back();
    const CameraState& camera = film.cameras[last];
    EXPECT_GT(cosineBetween(state->camera.position_world, camera.position_world), 0.95) << seed;
    EXPECT_LT(state->camera.q_world_camera.angularDistance(camera.q_world_camera), 0.05) << seed;
  }
}

TEST(Initialiser, ForwardMotionIsFound) {
  for (unsigned seed = 1; seed <= 5; ++seed) {
    const Bundle truth = forwardBundle(CameraModel(exampleCalibration()), 25, 80, 0.02, 0.15, seed);
    Start start(truth);
    const auto state = start.showUntil(24);
    ASSERT_TRUE(state) << seed;
    EXPECT_GT(cosineBetween(state->camera.position_world, Eigen::Vector3d::UnitZ()), 0.99) << seed;
    EXPECT_LT(meanSquaredDepthError(start, truth, *state), 2.5) << seed;
  }
}

TEST(Initialiser, FarPointsThatKeepTheirPixelAreKept) {
  // Sideways without a turn: what is far keeps its pixel too, and is a point of the scene.
  Bundle film = exampleBundle(CameraModel(exampleCalibration()), 25, 80, 0.0, 0.0, 4, 0.3);
  const CameraModel model(exampleCalibration());
  Random random(4);
  for (int k = 0; k < 25; ++k) {
    film.cameras[k].position_world = 0.02 * k * Eigen::Vector3d::UnitX();
    film.observations[k].clear();
    for (int i = 0; i < 80; ++i) {
      film.features[i].inverse_depth = i < 24 ? 1e-3 : film.features[i].inverse_depth;
      const auto p = projectFeature(model, film.cameras[k], film.features[i]);
      if (p && model.isInImage(p->pixel))
        film.observations[k].push_back(
            {i, p->pixel + Eigen::Vector2d(random.normal(0.1), random.normal(0.1))});
    }
  }
  Start start(film);
  const auto state = start.showUntil(24);
  ASSERT_TRUE(state);
  const auto far = std::count_if(state->features.begin(), state->features.end(),
                                 [&start](const auto& f) { return start.featureOf(f.id) < 24; });
  EXPECT_GE(far, 20);
  EXPECT_GT(cosineBetween(state->camera.position_world, Eigen::Vector3d::UnitX()), 0.99);
}

TEST(Initialiser, AFirstImageThatHasNothingToDoWithTheSecondIsSaidToBe) {
  Bundle film = track(12, 0.02, 5);
  EXPECT_FALSE([&] {
    Start start(film);
    start.showUntil(11);
    return start.initialiser().isFirstUnrelated();
  }());
  // Of what the first image showed, little is found in the second.
  film.observations[1].resize(film.observations[1].size() / 4);
  Start start(film);
  start.showUntil(1);
  EXPECT_TRUE(start.initialiser().isFirstUnrelated());
}

TEST(Initialiser, OfFeaturesThatWereNotLookedForNothingIsKnown) {
  Bundle film = track(12, 0.02, 5);
  const std::size_t quarter = film.observations[1].size() / 4;
  film.observations[1].resize(quarter);
  Start start(film);
  start.lookFor(static_cast<int>(quarter));  // and found
  start.showUntil(11);
  EXPECT_FALSE(start.initialiser().isFirstUnrelated());
}

TEST(Initialiser, ImagesThatShowLittleInBetweenAreLeftOut) {
  // Lights that flicker: every third image shows next to nothing.
  Bundle film = track(30, 0.015, 5);
  for (std::size_t k = 2; k < film.observations.size(); k += 3) film.observations[k].resize(4);
  Start start(film);
  const auto state = start.showUntil(29);
  ASSERT_TRUE(state);
  EXPECT_GT(cosineBetween(state->camera.position_world,
                          film.cameras[start.committed().back()].position_world),
            0.99);
  EXPECT_LT(meanSquaredDepthError(start, film, *state), 2.5);
}

TEST(Initialiser, AFeatureThatMovesByItselfIsLeftOut) {
  Bundle truth = track(20, 0.02, 4);
  const int moving = truth.observations.front()[5].feature;
  for (std::size_t k = 0; k < truth.cameras.size(); ++k)
    for (BundleObservation& o : truth.observations[k])
      if (o.feature == moving) o.pixel.y() += (k % 4 < 2 ? 4.0 : -4.0);
  Start start(truth);
  const auto state = start.showUntil(19);
  ASSERT_TRUE(state);
  for (const FeatureState& feature : state->features)
    EXPECT_NE(start.featureOf(feature.id), moving);
  EXPECT_GT(state->features.size(), truth.observations.front().size() / 2);
}

TEST(Initialiser, WrongMatchesDoNotDecideTheMotion) {
  constexpr int kRuns = 40;
  int wrong = 0, decided = 0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    Bundle truth = exampleBundle(CameraModel(exampleCalibration()), 20, 40, 0.003, 0.05, seed, 0.5);
    for (std::size_t k = 3; k < truth.observations.size(); k += 4) {  // across the motion
      auto& observations = truth.observations[k];
      observations[seed % observations.size()].pixel += Eigen::Vector2d(2.0, -11.0);
    }
    Start start(truth);
    std::optional<InitialState> first;
    while (!first && start.shown() < 19) first = start.showNext();
    if (!first) continue;
    ++decided;
    wrong += cosineBetween(first->camera.position_world,
                           truth.cameras[start.shown()].position_world) < 0.8;
  }
  EXPECT_GT(decided, kRuns / 2);
  EXPECT_LE(wrong, 1);
}

TEST(Initialiser, TheTestErrsAsSeldomAsItsOddsSayWhenErrorsAreCorrelated) {
  // First commits at the least parallax that the test accepts, errors an autoregression.
  constexpr int kRuns = 60;
  constexpr double kCorrelation = 0.45, kSigmaPx = 0.1;
  int wrong = 0, decided = 0;
  for (unsigned seed = 1; seed <= kRuns; ++seed) {
    Bundle truth = track(40, 0.0015, seed, 0.0);
    Random random(seed);
    std::vector<Eigen::Vector2d> errors(truth.features.size(), Eigen::Vector2d::Zero());
    for (auto& observations : truth.observations) {
      for (Eigen::Vector2d& error : errors) {
        const double du = random.normal(kSigmaPx), dv = random.normal(kSigmaPx);
        error = kCorrelation * error +
                std::sqrt(1.0 - kCorrelation * kCorrelation) * Eigen::Vector2d(du, dv);
      }
      for (BundleObservation& o : observations) o.pixel += errors[o.feature];
    }
    Start start(truth);
    std::optional<InitialState> first;
    while (!first && start.shown() < 39) first = start.showNext();
    if (!first) continue;
    ++decided;
    wrong += cosineBetween(first->camera.position_world,
                           truth.cameras[start.shown()].position_world) < 0.7;
  }
  EXPECT_GT(decided, kRuns / 2);
  EXPECT_LE(wrong, 2);
}

TEST(Initialiser, GoesOnWhenTheFirstImageIsOutOfSight) {
  // Features come and go; what the first images say of those that went still counts.
  constexpr int kPerImage = 4, kInSight = 50, kLast = 20;
  Bundle truth = exampleBundle(CameraModel(exampleCalibration()), kLast + 1,
                               kPerImage * kLast + kInSight, 0.004, 0.2, 6);
  for (int k = 0; k <= kLast; ++k) {
    auto& seen = truth.observations[k];
    seen.erase(std::remove_if(seen.begin(), seen.end(),
                              [k](const BundleObservation& o) {
                                return o.feature < kPerImage * k ||
                                       o.feature >= kPerImage * k + kInSight;
                              }),
               seen.end());
  }
  Start start(truth);
  start.startFeatures();
  const auto state = start.showUntil(kLast);
  ASSERT_TRUE(state);
  EXPECT_GT(state->features.size(), 10u);
  EXPECT_GT(cosineBetween(state->camera.position_world,
                          truth.cameras[start.committed().back()].position_world),
            0.98);
}

}  // namespace
}  // namespace active_matching_slam
