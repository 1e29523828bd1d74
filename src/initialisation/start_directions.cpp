#include "start_directions.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <cstddef>

namespace active_matching_slam {
namespace {

constexpr int kDirections = 120;  ///< over the hemisphere: some 13 degrees apart
constexpr double kAround = 0.9;   ///< cosine: 25 degrees
constexpr std::size_t kMostReadings = 3;
constexpr int kTurnIterations = 4;
/// Sine of the angle to the move below which an image point tells no turn and no depth.
constexpr double kLeastSine = 0.05;
constexpr double kMostDepthRatio = 3.0;  ///< to `inverse_depth`, of a depth to begin from

/// Of a feature, in the first camera's frame, both of length 1.
struct RayPair {
  int feature = 0;
  Eigen::Vector3d first, last;
  double information = 1.0;  ///< per squared radian, in that of `BundleOptions::outlier_px`
};

std::vector<RayPair> rayPairs(const CameraModel& model, const BundleOptions& options,
                              const Bundle& turned) {
  const Eigen::Matrix3d R = turned.cameras.back().q_world_camera.toRotationMatrix();
  const double scale = model.calibration().fx / options.outlier_px;
  std::vector<RayPair> pairs;
  for (const BundleObservation& o : turned.observations.back())
    if (const auto ray = model.unproject(o.pixel))
      pairs.push_back({o.feature, turned.features[o.feature].bearing_world, R * ray->normalized(),
                       std::pow(scale / o.noise, 2)});
  return pairs;
}

/// A direction of the move, with the small turn [rad] that goes best with it.
struct Move {
  Eigen::Vector3d direction, turn;
  double cost = 0.0;  ///< Cauchy's, of what points miss their epipolar lines by
};

/// t . (f x (q + w x q)) = 0 is linear in the turn w. Over |f x t| it is an angle.
Move moveAlong(const Eigen::Vector3d& t, const std::vector<RayPair>& pairs) {
  Move move{t, Eigen::Vector3d::Zero()};
  for (int iteration = 0; iteration < kTurnIterations; ++iteration) {
    Eigen::Matrix3d left = 1e-9 * Eigen::Matrix3d::Identity();
    Eigen::Vector3d right = Eigen::Vector3d::Zero();
    move.cost = 0.0;
    for (const RayPair& pair : pairs) {
      const double squared_sine = pair.first.cross(t).squaredNorm();
      if (squared_sine < kLeastSine * kLeastSine) continue;
      const double weight = pair.information / squared_sine;
      const double miss = t.dot(pair.first.cross(pair.last));
      const Eigen::Vector3d by_turn = pair.first.dot(pair.last) * t - t.dot(pair.last) * pair.first;
      const double squared = weight * std::pow(miss + by_turn.dot(move.turn), 2);
      move.cost += std::log1p(squared);
      const double robust = weight / (1.0 + squared);
      left += robust * by_turn * by_turn.transpose();
      right -= robust * miss * by_turn;
    }
    move.turn = left.ldlt().solve(right);
  }
  return move;
}

/// Spread evenly (Fibonacci's lattice); a move and its opposite cost the same.
std::vector<Move> movesOverHemisphere(const std::vector<RayPair>& pairs) {
  const double golden_angle = M_PI * (3.0 - std::sqrt(5.0));
  std::vector<Move> moves;
  for (int n = 0; n < kDirections; ++n) {
    const double z = (n + 0.5) / kDirections, radius = std::sqrt(1.0 - z * z);
    moves.push_back(moveAlong(
        {radius * std::cos(n * golden_angle), radius * std::sin(n * golden_angle), z}, pairs));
  }
  return moves;
}

/// Those that cost less than all around them, the best first.
std::vector<Move> bestMoves(const std::vector<Move>& moves) {
  std::vector<Move> best;
  for (const Move& move : moves)
    if (std::none_of(moves.begin(), moves.end(), [&move](const Move& other) {
          return other.cost < move.cost && std::abs(other.direction.dot(move.direction)) > kAround;
        }))
      best.push_back(move);
  std::sort(best.begin(), best.end(), [](const Move& a, const Move& b) { return a.cost < b.cost; });
  if (best.size() > kMostReadings) best.resize(kMostReadings);
  return best;
}

/// Towards or away, how far and how deep, by how far points went along their epipolar lines.
Bundle readingOf(const Move& move, const CameraModel& model, const BundleOptions& options,
                 const std::vector<RayPair>& pairs, Bundle reading) {
  struct Depth {
    int feature;
    double times_distance;  ///< inverse depth times the distance that the camera went
  };
  std::vector<Depth> depths;
  double along = 0.0, expected = 0.0;
  for (const RayPair& pair : pairs) {
    // The last ray is first - inverse depth * move, turned back.
    const Eigen::Vector3d last = pair.last + move.turn.cross(pair.last);
    const Eigen::Vector3d across = move.direction - pair.first * pair.first.dot(move.direction);
    const double sine = across.norm();
    if (sine < kLeastSine) continue;
    const double went = across.dot(pair.first - last) / sine;
    depths.push_back({pair.feature, went / sine});
    along += sine * went;
    expected += sine * sine;
  }
  if (along == 0.0) return reading;
  const double mean = along / expected;
  for (const Depth& depth : depths)
    reading.features[depth.feature].inverse_depth =
        options.inverse_depth *
        std::clamp(depth.times_distance / mean, 1.0 / kMostDepthRatio, kMostDepthRatio);
  const std::size_t last = reading.cameras.size() - 1;
  for (std::size_t k = 1; k <= last; ++k) {
    reading.cameras[k].position_world = static_cast<double>(k) / static_cast<double>(last) * mean /
                                        options.inverse_depth * move.direction;
    alignRotation(model, static_cast<int>(k), &reading);
  }
  return reading;
}

}  // namespace

std::vector<Bundle> readingsByDirection(const CameraModel& model, const BundleOptions& options,
                                        const Bundle& turned) {
  const std::vector<RayPair> pairs = rayPairs(model, options, turned);
  std::vector<Bundle> readings;
  for (const Move& move : bestMoves(movesOverHemisphere(pairs)))
    readings.push_back(readingOf(move, model, options, pairs, turned));
  return readings;
}

}  // namespace active_matching_slam
