#include "active_matching_slam/simulation/motions.h"

#include <algorithm>
#include <cmath>

#include "active_matching_slam/simulation/random.h"

namespace active_matching_slam {
namespace {

constexpr double kDegree = M_PI / 180.0;
/// Time over which the motion gathers way.
constexpr double kRampS = 1.0;

enum Axis { kX, kY, kZ, kYaw, kPitch, kRoll };

struct WarpedTime {
  double s;
  double rate;  ///< ds/dt
};

/// Time that starts at rest: its rate is the quintic smoothstep, so motions are C3.
WarpedTime warp(double t_s) {
  if (t_s <= 0.0) return {0.0, 0.0};
  if (t_s >= kRampS) return {t_s - 0.5 * kRampS, 1.0};
  const double x = t_s / kRampS, x3 = x * x * x;
  return {kRampS * x3 * x * (2.5 + x * (x - 3.0)), x3 * (10.0 + x * (6.0 * x - 15.0))};
}

/// Noise between two frequencies with a flat spectrum of *velocity*: that of a hand.
void addHandNoise(HarmonicSum& sum, double rms_velocity, double low_hz, double high_hz,
                  Random& random) {
  constexpr int kTerms = 7;
  for (int i = 0; i < kTerms; ++i) {
    const double fraction = (i + random.uniform()) / kTerms;
    const double rate = 2.0 * M_PI * low_hz * std::pow(high_hz / low_hz, fraction);
    sum.add(rms_velocity * std::sqrt(2.0 / kTerms) / rate, rate, random.uniform(0.0, 2.0 * M_PI));
  }
}

void addHand(Motion::Components& c, double rms_m_s, double rms_rad_s, double low_hz, double high_hz,
             Random& random) {
  for (int axis : {kX, kY, kZ}) addHandNoise(c[axis], rms_m_s, low_hz, high_hz, random);
  addHandNoise(c[kYaw], rms_rad_s, low_hz, high_hz, random);
  addHandNoise(c[kPitch], 0.8 * rms_rad_s, low_hz, high_hz, random);
  addHandNoise(c[kRoll], 0.6 * rms_rad_s, low_hz, high_hz, random);
}

/// A loop of the given period: out to one side, back through the start, out to the other, looking
/// about meanwhile.
void addLookAround(Motion::Components& c, double size_m, double yaw_rad, double period_s,
                   Random& random) {
  const double rate = 2.0 * M_PI / period_s;
  const double side = random.sign();
  const auto vary = [&random](double value) { return value * random.uniform(0.85, 1.15); };
  c[kX].add(side * vary(0.55 * size_m), rate, 0.0);
  c[kY].add(random.sign() * vary(0.13 * size_m), 2.0 * rate, random.uniform(-0.4, 0.4));
  c[kZ].add(vary(0.25 * size_m), rate, random.uniform(-0.3, 0.3) + 0.5 * M_PI);
  c[kZ].add(vary(0.08 * size_m), 2.0 * rate, random.uniform(0.0, 2.0 * M_PI));
  c[kYaw].add(-side * vary(yaw_rad), rate, 0.35 * random.sign());
  c[kYaw].add(vary(0.3 * yaw_rad), 2.0 * rate, random.uniform(0.0, 2.0 * M_PI));
  c[kPitch].add(vary(8.0 * kDegree), 2.0 * rate, random.uniform(0.0, 2.0 * M_PI));
  c[kRoll].add(vary(5.0 * kDegree), rate, random.uniform(0.0, 2.0 * M_PI));
}

/// There and back between 0 and `distance`, at most at `speed` and never faster than in 4 s.
void addThereAndBack(HarmonicSum& sum, double distance_m, double speed_m_s) {
  const double rate = std::min(2.0 * speed_m_s / std::max(std::abs(distance_m), 1e-9), 0.5 * M_PI);
  sum.add(0.5 * distance_m, rate, -0.5 * M_PI);
}

double farther(double low, double high) { return high >= -low ? high : low; }

/// Shrinks the motion along an axis until it cannot leave [low, high].
void keepWithin(HarmonicSum& sum, double low, double high) {
  double factor = 1.0;
  if (sum.lowest() < low) factor = std::min(factor, low / sum.lowest());
  if (sum.highest() > high) factor = std::min(factor, high / sum.highest());
  if (factor < 1.0) sum.scale(factor);
}

/// Of a circle to the right; the largest within reach where there is no way round.
double loopRadius_m(const Stage& stage) {
  if (stage.loop_radius_m > 0.0) return stage.loop_radius_m;
  return std::min({0.5 * stage.reach_max_m.x(), stage.reach_max_m.z(), -stage.reach_min_m.z()});
}

Motion::Components components(const std::string& name, const Stage& stage, Random& random) {
  Motion::Components c;
  const double size = stage.size_m;
  if (name == "slow") {
    addLookAround(c, size, 26.0 * kDegree, 14.75, random);
    addHand(c, 0.012 * size, 0.016, 0.3, 2.0, random);
  } else if (name == "jerky") {
    addLookAround(c, 0.75 * size, 22.0 * kDegree, 9.5, random);
    addHand(c, 0.16 * size, 0.36, 0.35, 1.5, random);
  } else if (name == "sideways") {
    addThereAndBack(c[kX], farther(stage.reach_min_m.x(), stage.reach_max_m.x()), 0.4 * size);
    addHand(c, 0.008 * size, 0.008, 0.3, 2.0, random);
  } else if (name == "forward") {
    addThereAndBack(c[kZ], farther(stage.reach_min_m.z(), stage.reach_max_m.z()), 0.6 * size);
    addHand(c, 0.01 * size, 0.012, 0.3, 2.0, random);
  } else if (name == "sweep") {
    addThereAndBack(c[kZ], farther(stage.reach_min_m.z(), stage.reach_max_m.z()), 0.2 * size);
    // 80 degrees sin(rate t) sin(growth t): farther to either side each time, then less far again.
    const double rate = 2.0 * M_PI / 4.0, growth = 2.0 * M_PI / 34.0;
    c[kYaw].add(40.0 * kDegree, rate - growth, 0.5 * M_PI);
    c[kYaw].add(40.0 * kDegree, rate + growth, -0.5 * M_PI);
    addHand(c, 0.01 * size, 0.012, 0.3, 2.0, random);
  } else if (name == "circle") {
    const double rate = 2.0 * M_PI / 6.0, radius = 0.3 * size;
    c[kX].add(radius, rate, 0.0);
    c[kY].add(radius, rate, 0.5 * M_PI);
    c[kYaw].add(-4.0 * kDegree, rate, 0.0);
    c[kPitch].add(4.0 * kDegree, rate, 0.5 * M_PI);
  } else if (name == "loop") {
    const double radius = loopRadius_m(stage);
    const double rate = 0.9 * size / radius;
    c[kX].add(-radius, rate, 0.5 * M_PI);
    c[kZ].add(radius, rate, 0.0);
    c[kYaw].addRate(rate);
    // Looks to either side meanwhile.
    c[kYaw].add(15.0 * kDegree, 2.0 * M_PI / 4.7, 0.0);
    // A hand that keeps its place: what it strays must not shrink the circle.
    addHandNoise(c[kY], 0.012 * size, 0.3, 2.0, random);
    addHandNoise(c[kPitch], 0.012, 0.3, 2.0, random);
    addHandNoise(c[kRoll], 0.009, 0.3, 2.0, random);
  } else if (name == "shake") {
    addHand(c, 0.1 * size, 0.45, 1.8, 4.0, random);
  }  // still: nothing moves
  return c;
}

}  // namespace

void HarmonicSum::add(double amplitude, double rate_rad_s, double phase_rad) {
  terms_.push_back({amplitude, rate_rad_s, phase_rad});
}

void HarmonicSum::startAt(double start) { constant_ += start - value(0.0); }

void HarmonicSum::scale(double factor) {
  constant_ *= factor;
  rate_ *= factor;
  for (Term& term : terms_) term.amplitude *= factor;
}

double HarmonicSum::value(double s) const {
  double sum = constant_ + rate_ * s;
  for (const Term& term : terms_) sum += term.amplitude * std::sin(term.rate * s + term.phase);
  return sum;
}

double HarmonicSum::derivative(double s) const {
  double sum = rate_;
  for (const Term& term : terms_)
    sum += term.amplitude * term.rate * std::cos(term.rate * s + term.phase);
  return sum;
}

double HarmonicSum::totalAmplitude() const {
  double sum = 0.0;
  for (const Term& term : terms_) sum += std::abs(term.amplitude);
  return sum;
}

Motion::Motion(const Eigen::Isometry3d& T_world_start, const Components& components)
    : T_world_start_(T_world_start), components_(components) {
  for (HarmonicSum& component : components_) component.startAt(0.0);
}

MotionSample Motion::at(double t_s) const {
  using Eigen::AngleAxisd;
  using Eigen::Vector3d;
  const WarpedTime time = warp(t_s);
  std::array<double, 6> value, rate;
  for (int i = 0; i < 6; ++i) {
    value[i] = components_[i].value(time.s);
    rate[i] = components_[i].derivative(time.s) * time.rate;
  }
  const Eigen::Matrix3d R_yaw = AngleAxisd(value[kYaw], Vector3d::UnitY()).toRotationMatrix();
  const Eigen::Matrix3d R_pitch = AngleAxisd(value[kPitch], Vector3d::UnitX()).toRotationMatrix();
  const Eigen::Matrix3d R_roll = AngleAxisd(value[kRoll], Vector3d::UnitZ()).toRotationMatrix();

  MotionSample sample;
  Eigen::Isometry3d T_start_camera = Eigen::Isometry3d::Identity();
  T_start_camera.linear() = R_yaw * R_pitch * R_roll;
  T_start_camera.translation() = Vector3d(value[kX], value[kY], value[kZ]);
  sample.T_world_camera = T_world_start_ * T_start_camera;
  sample.velocity_world = T_world_start_.linear() * Vector3d(rate[kX], rate[kY], rate[kZ]);
  // Each rate turns about its own axis, carried into the camera by the rotations applied after it.
  sample.angular_velocity_camera =
      R_roll.transpose() * (R_pitch.transpose() * Vector3d(0.0, rate[kYaw], 0.0) +
                            Vector3d(rate[kPitch], 0.0, 0.0)) +
      Vector3d(0.0, 0.0, rate[kRoll]);
  return sample;
}

const std::vector<NamedChoice>& motionChoices() {
  static const std::vector<NamedChoice> choices = {
      {"slow", "calm hand that looks around and comes back to the start every 15 s"},
      {"jerky", "hasty hand: turns and jerks up to about 1.5 rad/s"},
      {"sideways", "steady move to the side and back"},
      {"forward", "steady move ahead and back"},
      {"sweep", "slow move ahead and back, looking ever farther to one side and the other"},
      {"circle", "a circle every 6 s, looking at its middle"},
      {"loop", "a walk round in a circle, to the right, looking ahead and to either side"},
      {"still", "a camera that does not move"},
      {"shake", "vibration at 2 to 4 Hz in one place"},
  };
  return choices;
}

Motion createMotion(const std::string& name, const Stage& stage, std::uint64_t seed) {
  checkChoice("motion", name, motionChoices());
  Random random = Random(seed).fork(0x4D4F5645);
  Motion::Components c = components(name, stage, random);
  for (HarmonicSum& component : c) component.startAt(0.0);
  const bool has_way = name == "loop" && stage.loop_radius_m > 0.0;
  for (int axis : {kX, kY, kZ})
    if (!has_way || axis == kY)
      keepWithin(c[axis], stage.reach_min_m[axis], stage.reach_max_m[axis]);
  return Motion(stage.T_world_start, c);
}

}  // namespace active_matching_slam
