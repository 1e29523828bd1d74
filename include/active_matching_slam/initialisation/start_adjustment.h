#pragma once

#include <Eigen/Core>
#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/initialisation/bundle_adjustment.h"

namespace active_matching_slam {

/// State of a filter made from the first images together, for Ekf::restore().
struct AdjustedStart {
  CameraState camera;
  std::vector<FeatureState> features;  ///< ascending id
  Eigen::MatrixXd covariance;
  /// Where a camera of the start was taken to be, and where it was.
  struct Move {
    std::int64_t image = 0;
    Eigen::Isometry3d T_world_camera_before, T_world_camera_after;
  };
  std::vector<Move> moves;     ///< of some of the images, ascending
  bool is_refinement = false;  ///< of a map that was known well: it stays much the same

  /// Pose of a camera near one of the moves' by the same correction.
  Eigen::Isometry3d corrected(std::int64_t image, const Eigen::Isometry3d& T_world_camera) const;
};

/// Start with free scale. A filter linearises the first images about depths that it can only guess,
/// and can't take back what it made of them: a turn read as a move, near and far exchanged. So the
/// matches of the first images are kept, and when they show parallax, cameras and depths are
/// adjusted together, from what the filter believes and, until the images have clearly settled it,
/// from its opposites; the best, if it is clearly the best, becomes the filter's state. Repeated
/// with each image while there is little parallax, then as parallax or time grow, also when the
/// first image is out of sight, until depths are known well enough to be followed linearly, or the
/// filter, which has seen every image, knows them clearly better than the images kept here tell.
class StartAdjustment {
 public:
  /// Starts anew with image `index`: `first` is where it shows the filter's features; its camera is
  /// the world's origin.
  void begin(std::int64_t index, const std::vector<FeatureMeasurement>& first);
  void end() { is_active_ = false; }
  bool isActive() const { return is_active_; }
  /// While nothing has been adjusted yet: the depths are a guess.
  bool areDepthsGuessed() const { return is_active_ && last_parallax_px_ == 0.0; }
  /// Whether the feature took part when adjusted last, and will again.
  bool adjusts(FeatureId id) const {
    return is_active_ && std::binary_search(adjusted_.begin(), adjusted_.end(), id);
  }
  /// While all that is seen has been seen from about the same place.
  bool areDepthsVague() const { return is_active_ && !has_left_first_; }

  /// Keeps the matches of image `index`, taken `interval_s` after the one before; `filter` is what
  /// was made of it.
  void add(std::int64_t index, double interval_s, const Ekf& filter,
           const std::vector<FeatureMeasurement>& measurements);

  /// Joins to the last image features that it showed first, numbered above all before.
  void addFirstSights(const std::vector<FeatureMeasurement>& measurements);

  /// Takes all lengths so far times `factor`, as the filter does when its scale becomes known.
  void rescale(double factor);

  /// The adjusted state when it was time for one an image or two ago and the images leave no
  /// doubt: the work is done in steps, one a call. `model` as calibrated; the readout is adjusted
  /// too.
  std::optional<AdjustedStart> adjust(const CameraModel& model, const Ekf& filter);

 private:
  struct Image {
    std::int64_t index = 0;
    double interval_s = 0.0;
    CameraState camera;
    std::vector<FeatureMeasurement> measurements;  ///< ascending id
    /// Speed [px/s] of each of them, by the images next to this one that show it; zero: none does.
    std::vector<Eigen::Vector2d> speeds;
    double sigma_px = 0.0;  ///< of most of them; 0: unknown
  };

  enum class Adjusted { kSomeImages, kAllImages, kAllByTheirNoise };

  /// One of the explanations of the images kept.
  struct Reading {
    Bundle bundle;
    std::vector<FeatureId> ids;  ///< of its features, ascending
    double parallax_px = 0.0;
    double lead = 0.0;                 ///< see ChosenReading; zero: its opposites were not asked
    std::vector<std::int64_t> images;  ///< of its cameras
    Adjusted adjusted = Adjusted::kSomeImages;
  };
  struct Weighed {
    Reading reading;
    Bundle believed;  ///< the same features and images as the filter has them
    BundleOptions options;
  };

  void thinOut();
  void rememberFeatures(const Ekf& filter);
  std::optional<double> parallax(const CameraModel& model);
  bool isTime(double parallax_px, double sigma_px);
  std::vector<double> noiseOfFeatures(const std::vector<FeatureId>& ids) const;
  Bundle makeBundle(const CameraModel& model, std::vector<FeatureId>* ids) const;
  std::optional<Reading> chooseReading(const CameraModel& model, const Ekf& filter,
                                       double parallax_px) const;
  Bundle continued(const Reading& chosen, const Bundle& believed,
                   const std::vector<FeatureId>& ids) const;
  std::optional<Weighed> weigh(const CameraModel& model, const Ekf& filter,
                               const Reading& chosen) const;
  std::optional<AdjustedStart> adopt(const CameraModel& model, const Ekf& filter, Weighed weighed);
  void takeOver(const Reading& reading, AdjustedStart* start);

  bool is_active_ = false;
  std::vector<Image> images_;  ///< the first, some between, the last two
  /// Ascending id: those of the filter, and what has left it but is in the images.
  std::vector<FeatureState> features_;
  std::optional<Reading> chosen_;    ///< at the image before, for the next step
  std::vector<FeatureId> adjusted_;  ///< features that took part when adjusted last, ascending
  /// Relative, of the way from the first camera; the least at an adjustment so far.
  std::optional<double> length_sigma_;
  bool has_left_first_ = false;  ///< the last image shares too little with the first
  bool is_settled_ = false;      ///< what the filter was given has no opposite any more
  double least_motion_px_ = 1.0;
  double last_parallax_px_ = 0.0;  ///< when adjusted last; zero: has not been
  double next_parallax_px_ = 0.0;  ///< to be adjusted at
  int age_ = 0, last_age_ = 0;     ///< of the start, now and when adjusted last [images]
};

}  // namespace active_matching_slam
