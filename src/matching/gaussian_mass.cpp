#include "gaussian_mass.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>

#include "active_matching_slam/matching/search_ellipse.h"

namespace active_matching_slam {
namespace {

/// Beyond this many sigma from the mean lies less than 5e-8 of a Gaussian in the plane.
constexpr double kNothingBeyond = 5.8;
constexpr double kRadius = 3.0;  // of a search ellipse, in sigma
/// Nodes of the trapezoidal rule for the error of 1e-7, found by trial over all shapes.
constexpr double kNodesBase = 6.0, kNodesFactor = 3.6;

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

/// Multiplies by the inverse of the lower Cholesky factor of a covariance.
class Whitener {
 public:
  explicit Whitener(const Eigen::Matrix2d& c)
      : l00_(std::sqrt(c(0, 0))),
        inverse00_(1.0 / l00_),
        l10_(c(0, 1) * inverse00_),
        l11_(std::sqrt(c(1, 1) - l10_ * l10_)),
        inverse11_(1.0 / l11_) {}
  Eigen::Vector2d operator()(const Eigen::Vector2d& p) const {
    const double x = p.x() * inverse00_;
    return {x, (p.y() - l10_ * x) * inverse11_};
  }
  Eigen::Vector2d column0() const { return {l00_, l10_}; }
  Eigen::Vector2d column1() const { return {0.0, l11_}; }

 private:
  double l00_, inverse00_, l10_, l11_, inverse11_;
};

/// (1 - exp(-q/2)) / q
double kernel(double q) { return q < 1e-6 ? 0.5 - 0.125 * q : -std::expm1(-0.5 * q) / q; }

/// Cosines and sines of equal steps round the circle, for each number of nodes in use.
struct Circle {
  int nodes;
  std::vector<double> cosine, sine;
};
constexpr int kMostNodes = 768;

/// The circle of the fewest nodes not below `wanted`, a multiple of 8.
const Circle& circleOf(double wanted) {
  static const std::vector<Circle> circles = [] {
    std::vector<Circle> all;
    for (const int n : {8, 16, 24, 32, 40, 48, 64, 80, 96, 128, 192, 256, 384, kMostNodes}) {
      Circle circle{n, {}, {}};
      for (int i = 0; i < n; ++i) {
        circle.cosine.push_back(std::cos(2.0 * M_PI * i / n));
        circle.sine.push_back(std::sin(2.0 * M_PI * i / n));
      }
      all.push_back(std::move(circle));
    }
    return all;
  }();
  for (const Circle& circle : circles)
    if (circle.nodes >= wanted) return circle;
  return circles.back();
}

/// |y|^2 = q0 + qc cos t + qs sin t + qc2 cos 2t + qs2 sin 2t and y x dy = (j0 + jc cos t + js sin
/// t) dt along an ellipse.
struct ContourIntegrand {
  double q0, qc, qs, qc2, qs2, j0, jc, js;
};

/// Sum over the nodes of kernel(|y|^2) * (y x dy / dt), to 1e-10 relative. Compiled for several
/// instruction sets; without contraction, and with eight partial sums, all give the same bits.
#if defined(__GNUC__) && !defined(__clang__)
__attribute__((optimize("no-trapping-math",
                        "fp-contract=off")))  // or the choice of the series keeps it scalar
#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__)
__attribute__((target_clones("avx512f", "avx2", "default")))
#endif
#endif
double
sumOverNodes(const ContourIntegrand& f, const double* cosine, const double* sine, int nodes) {
  constexpr double kLog2E = 1.4426950408889634, kShift = 6755399441055744.0;  // 1.5 * 2^52
  constexpr double kLn2High = 6.93147180369123816490e-01, kLn2Low = 1.90821492927058770002e-10;
  double value[kMostNodes];
  for (int i = 0; i < nodes; ++i) {
    const double c = cosine[i], s = sine[i];
    const double q = f.q0 + f.qc * c + f.qs * s + f.qc2 * (c * c - s * s) + 2.0 * f.qs2 * c * s;
    // exp(x) = 2^k exp(r), |r| <= ln(2) / 2
    const double half = -0.5 * q, x = half > -700.0 ? half : -700.0;
    const double shifted = x * kLog2E + kShift, k = shifted - kShift;
    const double r = (x - k * kLn2High) - k * kLn2Low;
    double p = 1.0 / 3628800;
    p = p * r + 1.0 / 362880;
    p = p * r + 1.0 / 40320;
    p = p * r + 1.0 / 5040;
    p = p * r + 1.0 / 720;
    p = p * r + 1.0 / 120;
    p = p * r + 1.0 / 24;
    p = p * r + 1.0 / 6;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    std::uint64_t bits;
    std::memcpy(&bits, &shifted, sizeof bits);
    bits = (bits << 52) + 0x3FF0000000000000u;
    double power;
    std::memcpy(&power, &bits, sizeof power);
    const double series = 0.5 - q * (0.125 - q * (1.0 / 48.0 - q * (1.0 / 384.0)));
    const double quotient = (1.0 - p * power) / q;
    const double kernel = q < 0.02 ? series : quotient;
    value[i] = (f.j0 + f.jc * c + f.js * s) * kernel;
  }
  double partial[8] = {};
  for (int i = 0; i < nodes; i += 8)
    for (int j = 0; j < 8; ++j) partial[j] += value[i + j];
  return ((partial[0] + partial[4]) + (partial[2] + partial[6])) +
         ((partial[1] + partial[5]) + (partial[3] + partial[7]));
}

/// The ellipse in whitened coordinates, d + b0 cos t + b1 sin t.
struct WhitenedEllipse {
  Eigen::Vector2d d, b0, b1;
  double long_axis, short_axis;

  WhitenedEllipse(const Eigen::Vector2d& offset, const Eigen::Vector2d& axis0,
                  const Eigen::Vector2d& axis1)
      : d(offset), b0(axis0), b1(axis1) {
    const double sum = b0.squaredNorm() + b1.squaredNorm(), area = cross(b0, b1);
    const double root = std::sqrt(std::max(sum * sum - 4.0 * area * area, 0.0));
    long_axis = std::sqrt(0.5 * (sum + root));
    short_axis = area / long_axis;
  }
  /// 0 or 1 where the mass is that to 5e-8, else -1.
  double obviousMass() const {
    const double distance2 = d.squaredNorm(), reach = long_axis + kNothingBeyond;
    if (distance2 > reach * reach) return 0.0;
    // The mean in units of the ellipse's own radius.
    const double area = cross(b0, b1);
    const double x = cross(d, b1), y = cross(b0, d);
    const double r = std::sqrt(x * x + y * y) / area;
    if (short_axis * (r - 1.0) > kNothingBeyond) return 0.0;
    if (short_axis * (1.0 - r) > kNothingBeyond) return 1.0;
    return -1.0;
  }
};

constexpr int kLegendre = 8;
constexpr std::array<double, kLegendre / 2> kLegendreNode = {
    0.18343464249564980, 0.52553240991632899, 0.79666647741362674, 0.96028985649753623};
constexpr std::array<double, kLegendre / 2> kLegendreWeight = {
    0.36268378337836198, 0.31370664587788729, 0.22238103445337447, 0.10122853629037626};

/// Integral of f over [t0, t1] in `pieces` parts.
template <typename F>
double integrate(double t0, double t1, int pieces, F f) {
  const double half = 0.5 * (t1 - t0) / pieces;
  double sum = 0.0;
  for (int p = 0; p < pieces; ++p) {
    const double middle = t0 + (2 * p + 1) * half;
    for (std::size_t i = 0; i < kLegendreNode.size(); ++i)
      sum += kLegendreWeight[i] *
             (f(middle - half * kLegendreNode[i]) + f(middle + half * kLegendreNode[i]));
  }
  return sum * half;
}

/// Beyond this many sigma nothing is left to find: for a sum over pixels, and of the exponential in
/// a contour's integrand.
constexpr double kFarthest = 6.5;

/// Arc d + b0 cos t + b1 sin t, in whitened coordinates.
struct Arc {
  const WhitenedEllipse& e;
  double speed() const { return e.long_axis; }  ///< at most
  Eigen::Vector2d point(double t) const { return e.d + e.b0 * std::cos(t) + e.b1 * std::sin(t); }
  /// kernel(|y|^2) (y x dy / dt)
  double integrand(double t) const {
    const double c = std::cos(t), s = std::sin(t);
    const Eigen::Vector2d y = e.d + e.b0 * c + e.b1 * s;
    return cross(y, e.b1 * c - e.b0 * s) * kernel(y.squaredNorm());
  }
};

/// y0 + t step, the same.
struct Segment {
  Eigen::Vector2d y0, step;
  double speed() const { return step.norm(); }
  Eigen::Vector2d point(double t) const { return y0 + t * step; }
  double integrand(double t) const {
    const Eigen::Vector2d y = point(t);
    return cross(y, step) * kernel(y.squaredNorm());
  }
};

/// Integral of a long curve's integrand, bisected down to parts of `longest` in t. Far from the
/// mean the kernel is 1 / |y|^2, and what is left of the integral is the angle that the part spans
/// there.
template <typename Curve>
double integrateAlong(const Curve& curve, double t0, double t1, double longest) {
  const double middle = 0.5 * (t0 + t1), reach = 0.5 * (t1 - t0) * curve.speed();
  if (curve.point(middle).norm() - reach > kFarthest) {
    const Eigen::Vector2d a = curve.point(t0), b = curve.point(t1);
    return std::atan2(cross(a, b), a.dot(b));
  }
  if (t1 - t0 <= longest)
    return integrate(t0, t1, 1, [&curve](double t) { return curve.integrand(t); });
  return integrateAlong(curve, t0, middle, longest) + integrateAlong(curve, middle, t1, longest);
}

/// The same of any, of which parts of `longest` are short enough for quadrature.
template <typename Curve>
double contourIntegral(const Curve& curve, double t0, double t1, double longest) {
  constexpr double kShort = 16.0;  // parts; Cost: with fewer, to look for far ones does not pay
  const double parts = std::max(std::ceil((t1 - t0) / longest), 1.0);
  if (parts > kShort) return integrateAlong(curve, t0, t1, longest);
  return integrate(t0, t1, static_cast<int>(parts),
                   [&curve](double t) { return curve.integrand(t); });
}

/// Whether a sigma along any direction is below 0.4 px.
bool isNarrow(const Eigen::Matrix2d& c) {
  constexpr double kNarrow2 = 0.16;
  const double trace = c(0, 0) + c(1, 1), det = c(0, 0) * c(1, 1) - c(0, 1) * c(0, 1);
  return trace < 2.0 * kNarrow2 || det - kNarrow2 * trace + kNarrow2 * kNarrow2 < 0.0;
}

/// Integral over the unit squares of a row of pixels, from left to right border: rows by
/// quadrature, along a row by the error function.
double massOfNarrowRow(double v, double left, double right, const Eigen::Vector2d& mean,
                       const Eigen::Matrix2d& c) {
  const double sigma_v = std::sqrt(c(1, 1)), tilt = c(0, 1) / c(1, 1);
  const double scale = 1.0 / std::sqrt(2.0 * (c(0, 0) - tilt * c(0, 1)));
  const double low = std::max(v - 0.5, mean.y() - kFarthest * sigma_v);
  const double high = std::min(v + 0.5, mean.y() + kFarthest * sigma_v);
  if (!(low < high)) return 0.0;
  // Steps fine enough for the row's Gaussian and for the slant of a thin ridge.
  const double finest = std::min(sigma_v, 1.0 / (1e-3 + scale * std::abs(tilt)));
  const int pieces = static_cast<int>(std::clamp((high - low) / finest + 1.0, 1.0, 64.0));
  const double sum = integrate(low, high, pieces, [&](double y) {
    const double d = (y - mean.y()) / sigma_v, middle = mean.x() + tilt * (y - mean.y());
    return std::exp(-0.5 * d * d) *
           (std::erf((right - middle) * scale) - std::erf((left - middle) * scale));
  });
  return 0.5 * sum / (sigma_v * std::sqrt(2.0 * M_PI));
}

double massOfNarrowPixel(const Eigen::Vector2d& m, const Eigen::Vector2d& mean,
                         const Eigen::Matrix2d& covariance) {
  return massOfNarrowRow(m.y(), m.x() - 0.5, m.x() + 0.5, mean, covariance);
}

/// Sum of p over a run of pixels, for Gaussians narrower than pixels resolve.
class NarrowRuns {
 public:
  NarrowRuns(const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance)
      : mean_(mean),
        covariance_(covariance),
        reach_u_(kFarthest * std::sqrt(covariance(0, 0)) + 0.5),
        reach_v_(kFarthest * std::sqrt(covariance(1, 1)) + 0.5) {}

  double operator()(const PixelRun& run) const {
    if (std::abs(run.v - mean_.y()) > reach_v_) return 0.0;
    const double first = std::max<double>(run.begin_u, std::ceil(mean_.x() - reach_u_));
    const double last = std::min<double>(run.end_u - 1, std::floor(mean_.x() + reach_u_));
    return first <= last ? massOfNarrowRow(run.v, first - 0.5, last + 0.5, mean_, covariance_)
                         : 0.0;
  }

 private:
  Eigen::Vector2d mean_;
  Eigen::Matrix2d covariance_;
  double reach_u_, reach_v_;
};

/// The same for all others: density(u, v) = row(v) exp(-(u - middle(v))^2 / (2 variance)).
class WideRuns {
 public:
  WideRuns(const Eigen::Vector2d& mean, const Eigen::Matrix2d& c)
      : mean_(mean),
        yy_(c(1, 1)),
        variance_(c(0, 0) - c(0, 1) * c(0, 1) / yy_),
        sigma_(std::sqrt(variance_)),
        tilt_(c(0, 1) / yy_),
        scale_(1.0 / (2.0 * M_PI * sigma_ * std::sqrt(yy_))),
        half_(0.5 / variance_),
        step_(std::exp(-2.0 * half_)),
        step4_(step_ * step_ * step_ * step_),
        step12_(std::exp(-12.0 * half_)),
        step16_((step4_ * step4_) * (step4_ * step4_)) {}

  double operator()(const PixelRun& run) const {
    constexpr double kReach2 = kFarthest * kFarthest;
    const double dv = run.v - mean_.y(), dv2 = dv * dv / yy_;
    if (dv2 >= kReach2) return 0.0;
    const double middle = mean_.x() + tilt_ * dv, half = sigma_ * std::sqrt(kReach2 - dv2);
    const double first = std::ceil(middle - half), last = std::floor(middle + half);
    if (last < run.begin_u || first > run.end_u - 1) return 0.0;
    // A sum over all integers is the integral, to 2 exp(-2 pi^2 variance).
    if (variance_ >= 1.0 && first > run.begin_u && last < run.end_u - 1)
      return scale_ * std::exp(-0.5 * dv2) * sigma_ * std::sqrt(2.0 * M_PI);
    const int begin = std::max(run.begin_u, static_cast<int>(first));
    const int end = std::min(run.end_u, static_cast<int>(last) + 1);
    // Four interleaved recurrences e(u + 4) = e(u) r(u), r(u + 4) = r(u) exp(-32 half).
    double e[4], r[4], partial[4] = {0.0, 0.0, 0.0, 0.0};
    const double x = begin - middle;
    double ratio = std::exp(-(2.0 * x + 1.0) * half_);
    const double ratio2 = ratio * ratio;
    double ratio4 = ratio2 * ratio2 * step12_;
    e[0] = std::exp(-0.5 * dv2 - x * x * half_);
    r[0] = ratio4;
    for (int i = 1; i < 4; ++i) {
      e[i] = e[i - 1] * ratio;
      ratio *= step_;
      ratio4 *= step4_;
      r[i] = ratio4;
    }
    int u = begin;
    for (; u + 4 <= end; u += 4) {
      for (int i = 0; i < 4; ++i) {
        partial[i] += e[i];
        e[i] *= r[i];
        r[i] *= step16_;
      }
    }
    double total = partial[0] + partial[1] + partial[2] + partial[3];
    for (int i = 0; u < end; ++u, ++i) total += e[i];
    return scale_ * total;
  }

 private:
  Eigen::Vector2d mean_;
  double yy_, variance_, sigma_, tilt_, scale_, half_, step_, step4_, step12_, step16_;
};

template <typename OfRun>
double massOnMask(const PixelMask& mask, const OfRun& ofRun) {
  double sum = 0.0;
  mask.forEachRun([&](const PixelRun& run) { sum += ofRun(run); });
  return sum;
}

template <typename OfRun>
double massOnList(const std::vector<PixelRun>& runs, std::size_t first, const OfRun& ofRun) {
  double sum = 0.0;
  for (std::size_t i = first; i < runs.size(); ++i) sum += ofRun(runs[i]);
  return sum;
}

}  // namespace

double massInEllipse(const SearchEllipse& ellipse, const Eigen::Vector2d& mean,
                     const Eigen::Matrix2d& covariance) {
  const Whitener of_ellipse(ellipse.covariance), whiten(covariance);
  const WhitenedEllipse e(whiten(ellipse.center - mean), kRadius * whiten(of_ellipse.column0()),
                          kRadius * whiten(of_ellipse.column1()));
  const double obvious = e.obviousMass();
  if (obvious >= 0.0) return obvious;
  ContourIntegrand f;
  f.q0 = e.d.squaredNorm() + 0.5 * (e.b0.squaredNorm() + e.b1.squaredNorm());
  f.qc = 2.0 * e.d.dot(e.b0);
  f.qs = 2.0 * e.d.dot(e.b1);
  f.qc2 = 0.5 * (e.b0.squaredNorm() - e.b1.squaredNorm());
  f.qs2 = e.b0.dot(e.b1);
  f.j0 = cross(e.b0, e.b1);
  f.jc = cross(e.d, e.b1);
  f.js = -cross(e.d, e.b0);
  // The Fourier coefficients of the integrand fall off like those of exp(-|y|^2 / 2).
  const double swing =
      std::sqrt(f.qc * f.qc + f.qs * f.qs) + 4.0 * std::sqrt(f.qc2 * f.qc2 + f.qs2 * f.qs2);
  const Circle& circle = circleOf(kNodesBase + kNodesFactor * std::sqrt(swing));
  const double sum = sumOverNodes(f, circle.cosine.data(), circle.sine.data(), circle.nodes);
  return std::clamp(sum / circle.nodes, 0.0, 1.0);
}

ClippedEllipse::ClippedEllipse(const SearchEllipse& ellipse, const PixelBox& box)
    : center_(ellipse.center) {
  const Whitener of_ellipse(ellipse.covariance);
  axis0_ = kRadius * of_ellipse.column0();
  axis1_ = kRadius * of_ellipse.column1();
  const double low[2] = {box.min_u - 0.5, box.min_v - 0.5};
  const double high[2] = {box.max_u + 0.5, box.max_v + 0.5};
  std::vector<double> crossings;
  // Part of each side inside the ellipse, and where the ellipse crosses the side's line.
  for (int axis = 0; axis < 2; ++axis) {
    const double amplitude = std::hypot(axis0_(axis), axis1_(axis));
    const double phase = std::atan2(axis1_(axis), axis0_(axis));
    for (const bool upper : {false, true}) {
      const double side = upper ? high[axis] : low[axis];
      const double ratio = (side - center_(axis)) / amplitude;
      if (!(std::abs(ratio) < 1.0)) continue;
      const double swing = std::acos(ratio);
      double ends[2];
      for (const int k : {0, 1}) {
        const double t = phase + (k == 0 ? -swing : swing);
        crossings.push_back(t - 2.0 * M_PI * std::floor(t / (2.0 * M_PI)));
        ends[k] =
            center_(1 - axis) + axis0_(1 - axis) * std::cos(t) + axis1_(1 - axis) * std::sin(t);
      }
      const double begin = std::max(std::min(ends[0], ends[1]), low[1 - axis]);
      const double end = std::min(std::max(ends[0], ends[1]), high[1 - axis]);
      if (!(begin < end)) continue;
      Eigen::Vector2d a, b;
      a(axis) = b(axis) = side;
      a(1 - axis) = begin;
      b(1 - axis) = end;
      // Counter-clockwise: right side and low row forwards, left side and high row backwards.
      if ((axis == 0) != upper) std::swap(a, b);
      segments_.emplace_back(a, b);
    }
  }
  std::sort(crossings.begin(), crossings.end());
  if (crossings.empty()) crossings.push_back(0.0);
  for (std::size_t i = 0; i < crossings.size(); ++i) {
    const double t0 = crossings[i];
    const double t1 = i + 1 < crossings.size() ? crossings[i + 1] : crossings[0] + 2.0 * M_PI;
    const double t = 0.5 * (t0 + t1);
    const Eigen::Vector2d p = center_ + axis0_ * std::cos(t) + axis1_ * std::sin(t);
    if (t1 > t0 && p.x() > low[0] && p.x() < high[0] && p.y() > low[1] && p.y() < high[1])
      arcs_.emplace_back(t0, t1);
  }
}

double ClippedEllipse::area() const {
  double twice = 0.0;
  for (const auto& [t0, t1] : arcs_) twice += cross(axis0_, axis1_) * (t1 - t0);
  for (const auto& [a, b] : segments_) twice += cross(a - center_, b - center_);
  return std::max(0.5 * twice, 0.0);
}

double ClippedEllipse::mass(const Eigen::Vector2d& mean, const Eigen::Matrix2d& covariance) const {
  if (arcs_.empty() && segments_.empty()) return 0.0;
  const Whitener whiten(covariance);
  const WhitenedEllipse e(whiten(center_ - mean), whiten(axis0_), whiten(axis1_));
  if (e.obviousMass() == 0.0) return 0.0;
  // Sigma; radians. Cost: the quadrature of a part errs by less than 1e-7 of the whole.
  constexpr double kPart = 2.0, kPartOfTurn = 0.8;
  double sum = 0.0;
  const double longest = std::min(kPart / e.long_axis, kPartOfTurn);
  for (const auto& [t0, t1] : arcs_) sum += contourIntegral(Arc{e}, t0, t1, longest);
  for (const auto& [a, b] : segments_) {
    const Segment segment{whiten(a - mean), whiten(b - a)};
    sum += contourIntegral(segment, 0.0, 1.0, std::min(kPart / segment.speed(), 1.0));
  }
  return std::clamp(sum / (2.0 * M_PI), 0.0, 1.0);
}

double massOfPixel(const Eigen::Vector2d& m, const Eigen::Vector2d& mean,
                   const Eigen::Matrix2d& covariance) {
  if (isNarrow(covariance)) return massOfNarrowPixel(m, mean, covariance);
  const double det = covariance(0, 0) * covariance(1, 1) - covariance(0, 1) * covariance(0, 1);
  return std::exp(-0.5 * mahalanobisSquared({mean, covariance}, m)) / (2.0 * M_PI * std::sqrt(det));
}

double massOnPixels(const PixelMask& mask, const Eigen::Vector2d& mean,
                    const Eigen::Matrix2d& covariance) {
  return isNarrow(covariance) ? massOnMask(mask, NarrowRuns(mean, covariance))
                              : massOnMask(mask, WideRuns(mean, covariance));
}

double massOnRuns(const std::vector<PixelRun>& runs, std::size_t first, const Eigen::Vector2d& mean,
                  const Eigen::Matrix2d& covariance) {
  return isNarrow(covariance) ? massOnList(runs, first, NarrowRuns(mean, covariance))
                              : massOnList(runs, first, WideRuns(mean, covariance));
}

}  // namespace active_matching_slam
