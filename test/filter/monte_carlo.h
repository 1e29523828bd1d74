#pragma once

#include <Eigen/Cholesky>
#include <cmath>
#include <map>
#include <vector>

#include "active_matching_slam/filter/ekf.h"
#include "active_matching_slam/initialisation/initialiser.h"
#include "filter/chi_square.h"
#include "filter/example_filter.h"

namespace active_matching_slam {

enum class SimulatedMotion {
  kRandomAcceleration,  ///< the filter's own model, held near its start by a weak spring
  kHandHeld             ///< sums of sinusoids, as a hand sways and shakes
};

/// A camera among abstract points, without images: truth, measurements and filter.
struct SimulationOptions {
  FilterOptions filter;
  SimulatedMotion motion = SimulatedMotion::kHandHeld;
  bool metric = true;  ///< starts from known points; else from an exactly known pose
  double rate_hz = 30.0;
  double seconds = 10.0;
  double sigma_px = 1.0;       ///< of the measurements made
  int measured_features = 25;  ///< wanted in a frame
  int map_features = 50;       ///< at most
  double speed = 1.0;          ///< of the hand
  /// Depths of new points: from the filter's prior, or all points on a wall at this distance [m].
  double wall_m = 0.0;
  /// Random walk of the points across their rays, per axis and root of a radian of view.
  double landmark_noise_px = 0.0;
};

struct SimulatedFrame {
  double nees = 0.0;  ///< of position and rotation, 6 degrees of freedom
  double nees_position = 0.0, nees_rotation = 0.0;
  double position_error_m = 0.0;
  double rotation_error_rad = 0.0;
  double nis = 0.0;  ///< per degree of freedom
  int measured = 0;
  bool healthy = true;
};

class Simulation {
 public:
  Simulation(const SimulationOptions& options, unsigned seed)
      : options_(options), model_(exampleCalibration()), random_(seed), filter_(matched(options)) {
    for (int axis = 0; axis < 6; ++axis) {
      for (int i = 0; i < 3; ++i) {
        const double hz = options.speed * random_.uniform(i == 0 ? 0.1 : 0.4, i == 0 ? 0.3 : 1.2);
        const double amplitude = (axis < 3 ? 0.25 : 0.2) / (i == 0 ? 1.0 : 5.0);
        waves_[axis][i] = {amplitude * random_.uniform(0.5, 1.0), 2.0 * M_PI * hz,
                           random_.uniform(0.0, 2.0 * M_PI)};
      }
    }
    start();
  }

  SimulatedFrame step() {
    const double dt = 1.0 / options_.rate_hz;
    const Eigen::Vector3d before = truth_.position_world;
    move(dt);
    moveLandmarks(before);
    filter_.predict(dt);
    filter_.addLandmarkNoise(model_, dt, options_.filter.landmark_noise_px);
    std::vector<FeatureMeasurement> measurements;
    for (const FeatureState& feature : filter_.features()) {
      const auto pixel = seen(points_.at(feature.id));
      if (!pixel || !projectFeature(model_, filter_.camera(), feature)) continue;
      if (static_cast<int>(measurements.size()) == 2 * options_.measured_features) break;
      measurements.push_back({feature.id, *pixel + noise(), options_.sigma_px});
    }
    const UpdateReport report = filter_.update(model_, measurements);
    initialise(measurements);
    SimulatedFrame frame = judge();
    frame.measured = report.used;
    frame.nis = report.nis / std::max(1, 2 * report.used);
    frame.healthy = report.healthy;
    maintainMap(measurements);
    return frame;
  }

  const Ekf& filter() const { return filter_; }
  const CameraState& truth() const { return truth_; }
  const Eigen::Vector3d& truePoint(FeatureId id) const { return points_.at(id); }

 private:
  struct Wave {
    double amplitude, omega, phase;
  };

  /// Errors here are independent from image to image: none of the covariance's inflation, and a
  /// first commit when it would be with correlated ones.
  static InitialiserOptions forWhiteErrors() {
    InitialiserOptions options;
    options.log_odds *= options.correlation_inflation;
    options.correlation_inflation = 1.0;
    return options;
  }

  static FilterOptions matched(const SimulationOptions& options) {
    FilterOptions filter = options.filter;
    filter.sigma_px = options.sigma_px;
    return filter;
  }

  Eigen::Vector2d noise() {
    const double u = random_.normal(options_.sigma_px), v = random_.normal(options_.sigma_px);
    return Eigen::Vector2d(u, v);
  }

  std::optional<Eigen::Vector2d> seen(const Eigen::Vector3d& point_world) const {
    const Eigen::Vector3d p = truth_.poseWorldCamera().inverse() * point_world;
    if (p.z() < 0.1) return std::nullopt;
    const auto pixel = model_.project(p);
    return pixel && model_.isInImage(*pixel, 5.0) ? pixel : std::nullopt;
  }

  double wave(int axis, int derivative) const {
    double sum = 0.0;
    for (const Wave& w : waves_[axis]) {
      const double phase = w.omega * time_ + w.phase;
      sum +=
          derivative == 0 ? w.amplitude * std::sin(phase) : w.amplitude * w.omega * std::cos(phase);
    }
    return sum;
  }

  void initialise(const std::vector<FeatureMeasurement>& measurements) {
    initialiser_.add(model_, {++frame_, frame_ / options_.rate_hz, measurements}, filter_,
                     static_cast<int>(filter_.features().size()));
    if (const auto state = initialiser_.step(model_, filter_))
      filter_.restore(state->camera, state->features, state->covariance, filter_.nextId());
  }

  void setHandHeldTruth() {
    const auto rotationAt = [this](double time) {
      const double kept = time_;
      time_ = time;
      const Eigen::Vector3d v(wave(3, 0), wave(4, 0), wave(5, 0));
      time_ = kept;
      return rotationFromVector(v);
    };
    truth_.position_world << wave(0, 0), wave(1, 0), wave(2, 0);
    truth_.velocity_world << wave(0, 1), wave(1, 1), wave(2, 1);
    truth_.q_world_camera = rotationAt(time_);
    truth_.angular_velocity_camera =
        vectorFromRotation(rotationAt(time_ - 1e-4).conjugate() * rotationAt(time_ + 1e-4)) / 2e-4;
    if (options_.metric) return;
    // Without a target the world begins where the camera does.
    if (time_ == 0.0) origin_ = truth_;
    const Eigen::Quaterniond q_start_world = origin_.q_world_camera.conjugate();
    truth_.position_world = q_start_world * (truth_.position_world - origin_.position_world);
    truth_.velocity_world = q_start_world * truth_.velocity_world;
    truth_.q_world_camera = q_start_world * truth_.q_world_camera;
  }

  void move(double dt) {
    time_ += dt;
    if (options_.motion == SimulatedMotion::kHandHeld) {
      setHandHeldTruth();
      return;
    }
    const Eigen::Vector3d theta = vectorFromRotation(truth_.q_world_camera);
    const FilterOptions& f = options_.filter;
    const Eigen::Vector3d a = random_.vector(f.sigma_acceleration_mps2);
    const Eigen::Vector3d alpha = random_.vector(f.sigma_angular_acceleration_rps2);
    truth_.velocity_world +=
        dt * (a - spring_ * truth_.position_world - damping_ * truth_.velocity_world);
    truth_.angular_velocity_camera +=
        dt * (alpha - spring_ * theta - damping_ * truth_.angular_velocity_camera);
    truth_.position_world += dt * truth_.velocity_world;
    truth_.q_world_camera =
        truth_.q_world_camera * rotationFromVector(dt * truth_.angular_velocity_camera);
  }

  void moveLandmarks(const Eigen::Vector3d& before) {
    if (options_.landmark_noise_px == 0.0) return;
    for (auto& [id, point] : points_) {
      const Eigen::Vector3d from = point - before, to = point - truth_.position_world;
      const double turned_rad = std::acos(std::min(1.0, from.normalized().dot(to.normalized())));
      const double sigma_m =
          options_.landmark_noise_px / model_.calibration().fx * std::sqrt(turned_rad) * to.norm();
      point += to.normalized().cross(random_.vector(sigma_m));
    }
  }

  void start() {
    if (options_.motion == SimulatedMotion::kHandHeld) setHandHeldTruth();
    Eigen::Matrix<double, 12, 1> sigma;
    sigma << Eigen::Vector3d::Constant(options_.metric ? 0.02 : 0.0),
        Eigen::Vector3d::Constant(options_.metric ? 0.01 : 0.0),
        Eigen::Vector3d::Constant(options_.filter.initial_sigma_velocity_mps),
        Eigen::Vector3d::Constant(options_.filter.initial_sigma_angular_velocity_rps);
    Eigen::VectorXd error = Eigen::VectorXd::Zero(CameraError::kSize);
    for (int i = 0; i < CameraError::kMotionSize; ++i) error[i] = random_.normal(sigma[i]);
    CameraState guess = truth_;
    std::vector<FeatureState> none;
    applyError(error, guess, none);
    filter_.reset(guess, sigma.cwiseAbs2().asDiagonal());
    if (options_.metric) {
      for (int i = 0; i < 6; ++i) {
        const Eigen::Vector3d point =
            truth_.poseWorldCamera() *
            (random_.uniform(0.8, 1.5) * *model_.unproject(random_.pixel()));
        const FeatureId id = filter_.addPointFeature(point + random_.vector(1e-3),
                                                     1e-6 * Eigen::Matrix3d::Identity());
        points_[id] = point;
      }
      known_ = 6;
    }
    addFeatures(options_.measured_features, !options_.metric);
  }

  /// As expected by the filter's prior, or of a point on the wall.
  double inverseDepth(const Eigen::Vector3d& bearing) {
    if (options_.wall_m > 0.0) {
      const Eigen::Vector3d ray = truth_.q_world_camera * bearing;
      return ray.z() / (options_.wall_m - truth_.position_world.z());
    }
    const FilterOptions& f = options_.filter;
    double rho = 0.0;
    while (rho < 0.1) rho = f.initial_inverse_depth + random_.normal(f.initial_sigma_inverse_depth);
    return rho;
  }

  void addFeatures(int count, bool fix_scale = false) {
    std::vector<Eigen::Vector2d> pixels;
    std::vector<double> depths;
    double mean = 0.0;
    for (int i = 0; i < count; ++i) {
      pixels.push_back(random_.pixel());
      depths.push_back(inverseDepth(*model_.unproject(pixels.back())));
      mean += depths.back() / count;
    }
    for (int i = 0; i < count; ++i) {
      const double rho =
          fix_scale ? depths[i] * options_.filter.initial_inverse_depth / mean : depths[i];
      const FeatureId id = filter_.addInverseDepthFeature(model_, pixels[i] + noise());
      if (id >= 0) points_[id] = truth_.poseWorldCamera() * (*model_.unproject(pixels[i]) / rho);
    }
    if (fix_scale) {
      std::vector<FeatureMeasurement> first;
      for (const FeatureState& feature : filter_.features())
        first.push_back(
            {feature.id, projectFeature(model_, filter_.camera(), feature)->pixel, 0.0});
      initialiser_.begin({0, 0.0, first});
    }
    // The unit of length is what makes the mean inverse depth of the first features the expected
    // one.
    if (fix_scale) filter_.fixScale(1e-4);
  }

  void maintainMap(const std::vector<FeatureMeasurement>& measurements) {
    filter_.convertToPoints();
    const int missing = options_.measured_features - static_cast<int>(measurements.size());
    if (missing > 0) addFeatures(missing);
    std::vector<FeatureId> gone;
    int excess = static_cast<int>(filter_.features().size()) - options_.map_features;
    for (const FeatureState& feature : filter_.features()) {
      if (excess <= 0) break;
      if (feature.id < known_ || seen(points_.at(feature.id))) continue;
      gone.push_back(feature.id);
      --excess;
    }
    filter_.removeFeatures(gone);
  }

  SimulatedFrame judge() const {
    Eigen::Matrix<double, 6, 1> error;
    error << truth_.position_world - filter_.camera().position_world,
        vectorFromRotation(truth_.q_world_camera * filter_.camera().q_world_camera.conjugate());
    const Eigen::Matrix<double, 6, 6> P = filter_.cameraCovariance().topLeftCorner<6, 6>();
    SimulatedFrame frame;
    frame.nees = error.dot(P.ldlt().solve(error));
    frame.nees_position =
        error.head<3>().dot(P.topLeftCorner<3, 3>().ldlt().solve(error.head<3>()));
    frame.nees_rotation =
        error.tail<3>().dot(P.bottomRightCorner<3, 3>().ldlt().solve(error.tail<3>()));
    frame.position_error_m = error.head<3>().norm();
    frame.rotation_error_rad = error.tail<3>().norm();
    return frame;
  }

  static constexpr double spring_ = 4.0, damping_ = 4.0;

  SimulationOptions options_;
  CameraModel model_;
  Random random_;
  Ekf filter_;
  Initialiser initialiser_{forWhiteErrors()};
  CameraState truth_, origin_;
  double time_ = 0.0;
  int frame_ = 0;
  Wave waves_[6][3];
  std::map<FeatureId, Eigen::Vector3d> points_;
  FeatureId known_ = 0;
};

struct MonteCarloResult {
  double frames_within = 0.0;  ///< share of frames whose mean NEES lies within its 95 % bounds
  double frames_above = 0.0;   ///< share above: overconfident
  double mean_nees = 0.0, mean_nees_position = 0.0, mean_nees_rotation = 0.0;
  double mean_nis = 0.0;  ///< per degree of freedom
  double rms_position_m = 0.0, rms_rotation_rad = 0.0;
  double mean_measured = 0.0;
  int unhealthy = 0;
};

inline MonteCarloResult runMonteCarlo(const SimulationOptions& options, int runs) {
  const int frames = static_cast<int>(options.seconds * options.rate_hz);
  std::vector<double> nees(frames, 0.0);
  MonteCarloResult result;
  for (int run = 0; run < runs; ++run) {
    Simulation simulation(options, 1000 + run);
    for (int frame = 0; frame < frames; ++frame) {
      const SimulatedFrame f = simulation.step();
      const double share = 1.0 / (runs * static_cast<double>(frames));
      nees[frame] += f.nees / runs;
      result.mean_nees += f.nees * share;
      result.mean_nees_position += f.nees_position * share;
      result.mean_nees_rotation += f.nees_rotation * share;
      result.mean_nis += f.nis * share;
      result.rms_position_m += f.position_error_m * f.position_error_m * share;
      result.rms_rotation_rad += f.rotation_error_rad * f.rotation_error_rad * share;
      result.mean_measured += f.measured * share;
      if (!f.healthy) ++result.unhealthy;
    }
  }
  result.rms_position_m = std::sqrt(result.rms_position_m);
  result.rms_rotation_rad = std::sqrt(result.rms_rotation_rad);
  const auto [low, high] = meanChiSquareBounds(runs, 6);
  for (const double mean : nees) {
    result.frames_within += (mean >= low && mean <= high) / static_cast<double>(frames);
    result.frames_above += (mean > high) / static_cast<double>(frames);
  }
  return result;
}

}  // namespace active_matching_slam
