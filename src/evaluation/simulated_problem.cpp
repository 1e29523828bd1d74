#include "active_matching_slam/evaluation/simulated_problem.h"

#include <cmath>
#include <stdexcept>
#include <string>

#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

void requirePositive(const char* name, double value) {
  if (!(value > 0.0))
    throw std::invalid_argument(std::string(name) + " is " + std::to_string(value) +
                                ", must be above 0");
}

}  // namespace

ProblemSimulator::ProblemSimulator(const SimulatedProblemOptions& options, std::uint64_t seed)
    : options_(options), random_(seed) {
  requirePositive("width", options.width);
  requirePositive("height", options.height);
  requirePositive("rate_hz", options.rate_hz);
  requirePositive("focal_per_width", options.focal_per_width);
  requirePositive("nearest_m", options.nearest_m);
  requirePositive("noise_sigma_px", options.noise_sigma_px);
  requirePositive("repeat_px", options.repeat_px);
  if (options.features < 0)
    throw std::invalid_argument("features is " + std::to_string(options.features) +
                                ", must be 0 or more");
}

double ProblemSimulator::uniform(double low, double high) {
  return low + (high - low) * static_cast<double>(random_() >> 11) * 0x1p-53;
}

double ProblemSimulator::normal() {
  // Box-Muller, the same on every standard library.
  const double radius = std::sqrt(-2.0 * std::log(uniform(0x1p-53, 1.0)));
  return radius * std::cos(2.0 * M_PI * uniform(0.0, 1.0));
}

SimulatedProblem ProblemSimulator::next() {
  const SimulatedProblemOptions& o = options_;
  const double dt = 1.0 / o.rate_hz, focal = o.focal_per_width * o.width;
  const double sigma_r = std::hypot(o.pose_sigma_m, o.acceleration * dt * dt);
  const double sigma_q = std::hypot(o.pose_sigma_rad, o.angular_acceleration * dt * dt);
  Eigen::Matrix<double, 6, 1> sigma, error;
  sigma << sigma_r, sigma_r, sigma_r, sigma_q, sigma_q, sigma_q;
  for (int i = 0; i < 6; ++i) error(i) = sigma(i) * normal();

  SimulatedProblem problem;
  const int size = o.features;
  Eigen::MatrixXd H(2 * size, 6);
  problem.prior.z.resize(2 * size);
  problem.prior.noise_variance_px2 = o.noise_sigma_px * o.noise_sigma_px;
  problem.prior.rates.assign(static_cast<std::size_t>(size), {o.true_positive, o.false_positive});
  std::vector<double> map_sigma;
  for (int f = 0; f < size; ++f) {
    problem.prior.ids.push_back(f);
    const double u = uniform(20.0, o.width - 20.0), v = uniform(20.0, o.height - 20.0);
    const double depth = 1.0 / uniform(1.0 / o.farthest_m, 1.0 / o.nearest_m);
    const double x = (u - 0.5 * o.width) / focal, y = (v - 0.5 * o.height) / focal;
    problem.prior.z.segment<2>(2 * f) << u, v;
    H.middleRows<2>(2 * f) << -focal / depth, 0.0, focal * x / depth, focal * x * y,
        -focal * (1.0 + x * x), focal * y, 0.0, -focal / depth, focal * y / depth,
        focal * (1.0 + y * y), -focal * x * y, -focal * x;
    map_sigma.push_back(o.map_sigma_m * focal / depth);
  }
  const Eigen::MatrixXd scaled = H * sigma.asDiagonal();
  problem.prior.S.noalias() = scaled * scaled.transpose();
  for (int f = 0; f < size; ++f) {
    const double own = map_sigma[static_cast<std::size_t>(f)];
    problem.prior.S.diagonal().segment<2>(2 * f).array() +=
        own * own + problem.prior.noise_variance_px2;
    const Eigen::Vector2d truth =
        problem.prior.z.segment<2>(2 * f) + H.middleRows<2>(2 * f) * error +
        std::hypot(own, o.noise_sigma_px) * Eigen::Vector2d(normal(), normal());
    problem.true_pixel.push_back(truth);
    addClutter(problem, f, truth);
  }
  return problem;
}

/// All responses to a feature, in random order: itself, its copies, and clutter.
void ProblemSimulator::addClutter(SimulatedProblem& problem, int feature,
                                  const Eigen::Vector2d& truth) {
  const SimulatedProblemOptions& o = options_;
  struct Answer {
    Eigen::Vector2d pixel;
    double score;
    bool is_true;
  };
  std::vector<Answer> answers;
  if (uniform(0.0, 1.0) < o.true_positive) answers.push_back({truth, uniform(0.85, 1.0), true});
  const SearchEllipse gate{problem.prior.mean(feature), problem.prior.covariance(feature)};
  const double reach_u = 4.0 * std::sqrt(gate.covariance(0, 0));
  const double reach_v = 4.0 * std::sqrt(gate.covariance(1, 1));
  if (uniform(0.0, 1.0) < o.repeated_fraction) {
    const int steps_u = static_cast<int>(2.0 * reach_u / o.repeat_px);
    const int steps_v = static_cast<int>(2.0 * reach_v / o.repeat_px);
    for (int i = -steps_u; i <= steps_u; ++i)
      for (int j = -steps_v; j <= steps_v; ++j) {
        if (i == 0 && j == 0) continue;
        const Eigen::Vector2d jitter = 0.5 * o.noise_sigma_px * Eigen::Vector2d(normal(), normal());
        const Eigen::Vector2d p = truth + o.repeat_px * Eigen::Vector2d(i, j) + jitter;
        if (uniform(0.0, 1.0) < 0.3) answers.push_back({p, uniform(0.8, 1.0), false});
      }
  }
  // Poisson clutter, by exponential gaps.
  const double expected = 4.0 * reach_u * reach_v * o.false_positive;
  for (double at = -std::log(uniform(0x1p-53, 1.0)); at < expected;
       at -= std::log(uniform(0x1p-53, 1.0)))
    answers.push_back(
        {gate.center + Eigen::Vector2d(uniform(-reach_u, reach_u), uniform(-reach_v, reach_v)),
         uniform(0.75, 0.95), false});
  for (std::size_t i = answers.size(); i > 1; --i)
    std::swap(answers[i - 1], answers[static_cast<std::size_t>(random_() % i)]);
  problem.points.emplace_back();
  problem.scores.emplace_back();
  problem.true_point.push_back(-1);
  for (std::size_t i = 0; i < answers.size(); ++i) {
    problem.points.back().push_back(answers[i].pixel);
    problem.scores.back().push_back(answers[i].score);
    if (answers[i].is_true) problem.true_point.back() = static_cast<int>(i);
  }
}

}  // namespace active_matching_slam
