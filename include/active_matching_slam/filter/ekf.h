#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "active_matching_slam/camera/camera_model.h"
#include "active_matching_slam/filter/camera_state.h"
#include "active_matching_slam/filter/covariance_matrix.h"
#include "active_matching_slam/filter/feature_state.h"
#include "active_matching_slam/filter/filter_options.h"
#include "active_matching_slam/filter/motion_measurement.h"

namespace active_matching_slam {

/// Predicted image points of some features, jointly Gaussian (Chli 2009, eq. 3.13).
struct PredictedMeasurements {
  std::vector<FeatureId> ids;  ///< those of the request that project (in front of the camera)
  Eigen::VectorXd z;           ///< 2F [px]
  Eigen::MatrixXd S;           ///< 2F x 2F, R included [px^2]
  /// 2F x 6, how the impulse of the last predict() moves them [px per m/s and rad/s]; without
  /// columns when the state has changed otherwise since. Allowing for more of it adds A dQ A^T to
  /// S.
  Eigen::MatrixXd impulse_px;
};

/// An image point assigned to a feature.
struct FeatureMeasurement {
  FeatureId id = -1;
  Eigen::Vector2d pixel;
  double sigma_px = 0.0;  ///< per axis; 0: FilterOptions::sigma_px
  /// By how much its error's long-run variance exceeds its variance, at least 1: what was known
  /// before the image learns from it as from white noise inflated by so much.
  double variance_inflation = 1.0;
  /// Covariance of its error over sigma_px^2 (trace 2).
  Eigen::Matrix2d noise_shape = Eigen::Matrix2d::Identity();
};

/// Prior of the variance factor that R of all measurements of an image have in common: inverse
/// gamma, of mean 1.
struct NoisePrior {
  /// Degrees of freedom; infinite: R is known.
  double degrees = std::numeric_limits<double>::infinity();
  double minimum_px2 = 0.0;  ///< bound of a typical measurement's variance per axis
};

/// What an update tells of three impulses' variance: the squares of their posterior means, in units
/// of the variance allowed for, and what these sum up to when that is right: the fraction of each
/// impulse's variance that the images resolve, 0 to 3. (Variance component estimation.)
struct ImpulseEstimate {
  double squares = 0.0, degrees = 0.0;
};

/// What an update corrects: all, or the camera alone, for which the uncertainty of the map counts,
/// but of the map nothing changes (consider states: Schmidt 1966).
enum class Corrected { kAll, kCamera };

struct UpdateReport {
  int used = 0;
  int skipped = 0;      ///< unknown id, not finite, or behind the camera
  double nis = 0.0;     ///< normalised innovation squared of all used, 2 * used degrees of freedom
  bool healthy = true;  ///< false: the covariance had to be repaired or the update was refused
  /// Redundancy number of each measurement given (Baarda 1968): the fraction of its variance that
  /// its post-fit residual has, 0 to 1; the state follows the rest. 0: not used.
  std::vector<double> redundancy;
  /// Post-fit residual of each, first order, along axes in which its noise is of equal size and
  /// independent [px]; zero: not used.
  std::vector<Eigen::Vector2d> residual_px;
  /// Estimate of the variance factor common to the measurements, 1 where R is right (see
  /// NoisePrior), and its degrees of freedom.
  double noise_scale = 1.0, noise_degrees = 0.0;
  ImpulseEstimate linear, angular;  ///< of the last predict()
};

/// What a measurement of the motion, of three components, made of the state.
struct MotionFusion {
  double nis = 0.0;  ///< before inflation; three degrees of freedom
  /// By which its covariance was taken times so much, as it lay outside of what is possible.
  double inflation = 1.0;
  double innovation = 0.0;        ///< length of the innovation, in the measurement's unit
  double innovation_sigma = 0.0;  ///< what was expected of it, root mean square
  ImpulseEstimate impulse;        ///< of the last predict(), linear or angular
};

struct MotionReport {
  MotionFusion rotation;
  std::optional<MotionFusion> translation;
  bool healthy = true;  ///< as UpdateReport::healthy
};

/// Variance per axis [(m/s)^2, (rad/s)^2] of the impulses of accelerations over an interval.
Eigen::Matrix<double, 6, 1> impulseVariance(const Accelerations& sigmas, double interval_s);

/// Extended Kalman filter over camera and map with full covariance in error-state form. The map's
/// gauge - rotation of the world and scale - is transported with each correction (as by the
/// invariant error of Barrau & Bonnabel 2015), so that what can not be observed is never learnt.
class Ekf {
 public:
  explicit Ekf(const FilterOptions& options);
  const FilterOptions& options() const { return options_; }
  /// Run-time changes; throws like the constructor.
  void setOptions(const FilterOptions& options);

  /// Empties the map and puts the camera at `camera` with `covariance` of its motion (12 x 12,
  /// CameraError order); its calibration is as uncertain as the options say.
  void reset(const CameraState& camera, const MotionCovariance& covariance);

  /// Takes over a saved state: camera, features by ascending id (their offsets are computed anew)
  /// and the whole covariance in that order; new features will be numbered from `next_id`. Throws
  /// std::invalid_argument, and changes nothing, when these do not fit together.
  void restore(const CameraState& camera, const std::vector<FeatureState>& features,
               const Eigen::MatrixXd& covariance, FeatureId next_id);

  /// The camera is somewhere else, known by other means: its old motion and all that it had in
  /// common with the map are forgotten; the map and what is known of the calibration stay.
  /// `covariance` as for reset().
  void relocateCamera(const CameraState& camera, const MotionCovariance& covariance);

  /// Moves on by `interval_s` >= 0 with constant velocity (eq. 3.6-3.8), with unknown accelerations
  /// of the options' or the given standard deviations.
  void predict(double interval_s) {
    predict(interval_s,
            {options_.sigma_acceleration_mps2, options_.sigma_angular_acceleration_rps2});
  }
  void predict(double interval_s, const Accelerations& sigmas);
  /// The state as if the last predict() had been given these accelerations; nothing when the state
  /// has changed otherwise since.
  void replaceAccelerations(const Accelerations& sigmas);

  /// From now on the state holds the bias of a gyroscope, in every map. On an empty map.
  void estimateGyroBias(double initial_sigma_rps);
  /// Corrects the state by what is known of the motion of the last predict(), of which the impulse
  /// is then known better. A measurement that lies farther off than chance explains (slip) counts
  /// with a covariance inflated until it does not (Chang 2014). Nothing when the state has changed
  /// otherwise since. Lengths must be metric where the measurement has any.
  MotionReport measureMotion(const MotionMeasurement& motion, Corrected corrected);
  /// Variance of the impulse of the last predict() as replaceImpulse() takes it, measureMotion()
  /// included; none when the state has changed otherwise since.
  std::optional<Eigen::Matrix<double, 6, 1>> impulse() const;
  /// As replaceAccelerations(), by variances.
  void replaceImpulse(const Eigen::Matrix<double, 6, 1>& variance);

  /// Landmark process noise: where a corner lies in its patch depends on the view of it. As that
  /// turned in the last `interval_s`, each landmark moved across its ray from the camera by a
  /// random walk of `sigma_px` per axis and root of a radian. After predict(interval_s).
  void addLandmarkNoise(const CameraModel& camera, double interval_s, double sigma_px);

  /// One landmark has moved across its ray from the camera by `sigma_px` per axis. Ignores unknown
  /// ids.
  void loosenLandmark(const CameraModel& camera, FeatureId id, double sigma_px);

  /// Velocities decay to `fraction` of themselves, 0 to 1; what they lose is one standard deviation
  /// more of them (covariance inflation).
  void decayVelocity(double fraction);

  /// New feature seen at `pixel` in the present camera; returns its id, or -1 when the pixel can't
  /// be unprojected. Zero `inverse_depth`, `sigma_inverse_depth` and `sigma_px` (of the pixel, per
  /// axis) take what the options say.
  FeatureId addInverseDepthFeature(const CameraModel& camera, const Eigen::Vector2d& pixel,
                                   double inverse_depth = 0.0, double sigma_inverse_depth = 0.0,
                                   double sigma_px = 0.0);
  /// New feature at a known place, independent of the rest of the state.
  FeatureId addPointFeature(const Eigen::Vector3d& position_world,
                            const Eigen::Matrix3d& covariance);
  void removeFeatures(const std::vector<FeatureId>& ids);
  /// Takes back features that were removed, as points: `features` by ascending id (their offsets
  /// are computed anew), their own covariance, 3 F x 3 F, and that with the state, 3 F x
  /// stateSize(), both in this order. Throws std::invalid_argument, and changes nothing, when these
  /// do not fit together, or for an id that is in the state or was never given.
  void insertFeatures(const std::vector<FeatureState>& features, const Eigen::MatrixXd& own,
                      const Eigen::MatrixXd& cross);
  /// Adds `added`, positive semi-definite and of the state's size, to the covariance.
  void inflate(const Eigen::MatrixXd& added);
  /// Turns features whose depth is well known into points by the linearity index; returns which.
  std::vector<FeatureId> convertToPoints();
  /// Turns these features into points, to first order, however well their depths are known. Ignores
  /// points and unknown ids.
  void convertToPoints(const std::vector<FeatureId>& ids);

  /// `sigma_px`: of the measurements, per axis; 0: FilterOptions::sigma_px. `instead`: S as if the
  /// last predict() had been given these accelerations (until the state changes otherwise).
  PredictedMeasurements predictMeasurements(
      const CameraModel& camera, const std::vector<FeatureId>& ids, double sigma_px = 0.0,
      const std::optional<Accelerations>& instead = std::nullopt) const;
  /// Corrects the state by all measurements at once (RobustUpdate). Where errors are correlated
  /// over time (variance_inflation), map, calibration and what was known of the camera before learn
  /// by the inflated R; once these are known, the impulse of the last predict(), which is
  /// independent of the past, by R.
  /// `start`: where the state is so far off that a linearisation there would be of no use, an error
  /// state (see applyError()) that leads to where it is estimated to be. The first linearisation is
  /// made there, and others follow until they converge; the result counts from the present mean as
  /// ever. Empty: none.
  UpdateReport update(const CameraModel& camera,
                      const std::vector<FeatureMeasurement>& measurements,
                      const NoisePrior& noise = {}, Corrected corrected = Corrected::kAll,
                      const Eigen::VectorXd& start = {});

  /// Takes the present map's scale as the unit: fuses, without moving the mean, that the mean
  /// logarithm of the features' distances is known to `relative_sigma`. Where scale is free this
  /// only chooses the gauge, and keeps what follows from changing the unit.
  void fixScale(double relative_sigma);
  /// Relative standard deviation of the unit that a start chooses. Derivation: it fixes a gauge, so
  /// that any value far below the errors of lengths, of some 1e-2, and far above rounding will do.
  static constexpr double kFreeScaleSigma = 2e-4;

  /// Lengths as a whole are known to `relative_sigma` only: opens the gauge of scale by so much.
  void loosenScale(double relative_sigma);
  /// Relative standard deviation of lengths as a whole: of the mean logarithm of the features'
  /// distances. 0 without features.
  double scaleSigma() const;

  /// Multiplies all lengths (map, position, velocity and their covariances) by `factor` > 0.
  void rescale(double factor);

  const CameraState& camera() const { return camera_; }
  const std::vector<FeatureState>& features() const { return features_; }
  const FeatureState* find(FeatureId id) const;  ///< null when unknown
  FeatureId nextId() const { return next_id_; }  ///< of the next feature that is added
  /// covariance() as restore() takes it: without the gyroscope's bias.
  Eigen::MatrixXd savedCovariance() const;
  /// Symmetric, camera first, then every feature at its offset. A view: copy it to keep it.
  CovarianceMatrix::ConstView covariance() const { return covariance_.view(); }
  int stateSize() const { return covariance_.size(); }
  MotionCovariance cameraCovariance() const {
    return covariance_.view().topLeftCorner<CameraError::kMotionSize, CameraError::kMotionSize>();
  }
  /// 3 x 3 covariance of a feature's position in the world (first order for inverse depth).
  Eigen::Matrix3d positionCovariance(const FeatureState& feature) const;
  /// Standard deviation of rho, for kInverseDepth.
  double sigmaInverseDepth(const FeatureState& feature) const;

 private:
  int indexOf(FeatureId id) const;  ///< into features_; -1 when unknown
  FeatureState& appendFeature(FeatureKind kind);
  void assignOffsets();
  void limitInverseDepths();
  void addAcrossRay(const FeatureState& feature, const Eigen::Matrix3d& across, double distance,
                    double variance_rad2);
  /// P <- M (P - X X^T + D) M^T with M = I + C L^T, the transport of the gauge: C is the change of
  /// its generators, L its functionals, PL = P L; D is `added` for the motion and else zero. X: the
  /// first `columns` columns of `X`, which has kGaugeFreedoms to spare. False when variances had to
  /// be repaired.
  bool correctCovariance(const Eigen::MatrixXd& C, const Eigen::MatrixXd& L,
                         const Eigen::MatrixXd& PL, const MotionCovariance& added, int columns,
                         Eigen::Ref<Eigen::MatrixXd> X);
  /// P <- P - X X^T + D, but for the map's own block.
  bool correctCameraCovariance(const MotionCovariance& added, const Eigen::MatrixXd& X);
  MotionFusion fuseMotion(const Eigen::Matrix<double, 3, Eigen::Dynamic>& H,
                          const Eigen::Vector3d& innovation, const Eigen::Matrix3d& noise,
                          int impulse_row, Corrected corrected, bool* healthy);
  void applyMotion(const Eigen::VectorXd& delta);
  bool repairVariances(const Eigen::VectorXd& before);

  /// Of the last prediction: unknown velocities of `variance` (linear, angular) moved the camera's
  /// motion (CameraError order) by `G` times themselves.
  struct Impulse {
    double interval_s;
    Eigen::Matrix<double, CameraError::kMotionSize, 6> G;
    Eigen::Matrix<double, 6, 1> variance;
    Eigen::Quaterniond q_start;  ///< the camera's, where the interval began
  };

  FilterOptions options_;
  CameraState camera_;
  std::vector<FeatureState> features_;  ///< ascending ids and offsets
  CovarianceMatrix covariance_;
  std::optional<Impulse> impulse_;  ///< none when the state is no longer as predict() left it
  double initial_sigma_gyro_bias_rps_ = 0.0;
  FeatureId next_id_ = 0;
  std::vector<double> workspace_;  ///< of the update; kept to save allocations
};

}  // namespace active_matching_slam
