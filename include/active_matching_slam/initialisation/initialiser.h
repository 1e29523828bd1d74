#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/initialisation/initialiser_options.h"
#include "active_matching_slam/initialisation/keyframes.h"
#include "active_matching_slam/initialisation/scale_gauge.h"

namespace active_matching_slam {

/// State of a filter made from the first images together, for Ekf::restore().
struct InitialState {
  CameraState camera;
  std::vector<FeatureState> features;  ///< ascending id
  Eigen::MatrixXd covariance;
  /// Where a keyframe's camera was taken to be, and where it was.
  struct Correction {
    std::int64_t image = 0;
    Eigen::Isometry3d T_world_camera_before, T_world_camera_after;
  };
  std::vector<Correction> corrections;  ///< ascending
  bool is_first = true;                 ///< until it, depths were a guess

  /// Pose of a camera by the correction of the last keyframe up to its image.
  Eigen::Isometry3d corrected(std::int64_t image, const Eigen::Isometry3d& T_world_camera) const;
};

enum class InitialiserState {
  kCollecting,      ///< no parallax yet: the camera only rotates, or rests
  kDisambiguating,  ///< parallax, but more than one motion explains the images
  kRefining,        ///< one motion is accepted and adjusted again as parallax grows
  kDone,
};

/// Initialisation with free scale. A filter linearises the first images about depths that it can
/// only guess, and can't take back what it made of them: a rotation read as a translation, near and
/// far exchanged. So the matches of the first images are kept. When they show parallax, the motions
/// that explain them are adjusted and tested against each other; that which is accepted becomes the
/// filter's state, with its covariance, and is adjusted further until depths are known well enough
/// to be followed linearly. A camera that only rotates is waited for, however long. Nothing depends
/// on what the filter makes of the images meanwhile but the unit of length.
///
/// The work is bounded: a step an image, over a bounded number of keyframes.
class Initialiser {
 public:
  explicit Initialiser(const InitialiserOptions& options = {});

  /// Starts anew: `first` is where an image shows the filter's features; its camera is the world's
  /// origin.
  void begin(KeyframeMeasurements first);
  void end() { state_ = InitialiserState::kDone; }
  InitialiserState state() const { return state_; }
  int keyframes() const { return keyframes_.size(); }
  bool isDone() const { return state_ == InitialiserState::kDone; }
  /// Until the first commit: the filter's depths are a guess.
  bool areDepthsGuessed() const { return !isDone() && committed_.empty(); }
  /// Whether the feature took part in the last commit, and will in the next.
  bool isAdjusting(FeatureId id) const {
    return !isDone() && std::binary_search(committed_.begin(), committed_.end(), id);
  }
  /// The second image, which was added last, has nothing to do with the first: start from it.
  bool isFirstUnrelated() const { return is_first_unrelated_; }

  /// Adds the matches of an image; `filter` is what was made of it. `looked_for`: how many features
  /// were searched for in it, matched or not.
  void add(const CameraModel& model, const KeyframeMeasurements& image, const Ekf& filter,
           int looked_for);
  /// Joins to the last image features that it showed first, numbered above all before.
  void addFirstSights(const std::vector<FeatureMeasurement>& measurements);
  /// Takes all lengths times `factor`, as the filter does when its scale becomes known.
  void rescale(double factor);

  /// Once after each add(): bounded work, and at times a state to restore. `model` as calibrated;
  /// the readout is estimated too.
  std::optional<InitialState> step(const CameraModel& model, const Ekf& filter);
  /// How uncertain velocities are from one image to the next; by default, as FilterOptions say.
  void expect(const Accelerations& accelerations) { expected_ = accelerations; }

 private:
  bool hasGrown(double parallax);
  BundleOptions bundleOptions(const FilterOptions& filter) const;
  void disambiguate(const CameraModel& model, const Ekf& filter);
  std::optional<InitialState> refine(const CameraModel& model, const Ekf& filter);
  std::optional<InitialState> commit(const CameraModel& model, const Ekf& filter,
                                     const BundleOptions& options, MotionHypothesis adjusted);

  InitialiserOptions options_;
  InitialiserState state_ = InitialiserState::kDone;
  Keyframes keyframes_;
  std::optional<MotionHypothesis> accepted_;
  ScaleGauge scale_;
  std::vector<FeatureId> committed_;  ///< features of the last commit, ascending
  double sigma_px_ = 0.0;             ///< of image points, by the accepted hypothesis
  double parallax_ = 0.0;             ///< [rad], now
  double last_parallax_ = 0.0;        ///< when last tested or adjusted
  int images_ = 0, last_images_ = 0;
  int adjusting_images_ = 0;  ///< that the adjustment in hand has taken; 0: none is
  bool is_last_added_ = false, is_first_unrelated_ = false;
  std::optional<Accelerations> expected_;
};

}  // namespace active_matching_slam
