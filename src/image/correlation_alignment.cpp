#include "correlation_alignment.h"

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <cmath>

namespace active_matching_slam {
namespace {

/// Of the values of a pixel: 1, second and first image, and what turn and shift do to the second.
enum { kOne, kSecond, kFirst, kTurn, kU, kV, kValues };
using Gram = Eigen::Matrix<double, kValues, kValues>;
using RowValues = Eigen::Array<float, Eigen::Dynamic, kValues>;

/// Values of the pixels of row `y` that the warp takes into the second image. Returns their number.
int valuesOfRow(const cv::Mat& first, const cv::Mat& second, const cv::Mat& used,
                const RigidWarp& warp, int y, RowValues* values) {
  const auto c = static_cast<float>(std::cos(warp.angle_rad));
  const auto s = static_cast<float>(std::sin(warp.angle_rad));
  const float* of_first = first.ptr<float>(y);
  const auto row = static_cast<float>(y);
  const float u0 = static_cast<float>(warp.u) - s * row, v0 = static_cast<float>(warp.v) + c * row;
  const auto most_u = static_cast<float>(second.cols - 1);
  const auto most_v = static_cast<float>(second.rows - 1);
  int n = 0;
  for (int x = 0; x < first.cols; ++x) {
    const auto column = static_cast<float>(x);
    const float u = u0 + c * column, v = v0 + s * column;
    if (!(u >= 0.0f && v >= 0.0f && u < most_u && v < most_v)) continue;
    const int iu = static_cast<int>(u), iv = static_cast<int>(v);
    const float fu = u - static_cast<float>(iu), fv = v - static_cast<float>(iv);
    if (!used.empty() && used.at<std::uint8_t>(iv + (fv >= 0.5f), iu + (fu >= 0.5f)) == 0) continue;
    const float* above = second.ptr<float>(iv) + iu;
    const float* below = second.ptr<float>(iv + 1) + iu;
    const float along_above = above[1] - above[0], along_below = below[1] - below[0];
    const float at_above = above[0] + fu * along_above, at_below = below[0] + fu * along_below;
    const float d_u = along_above + fv * (along_below - along_above), d_v = at_below - at_above;
    (*values)(n, kSecond) = at_above + fv * d_v;
    (*values)(n, kFirst) = of_first[x];
    (*values)(n, kTurn) = d_v * (c * column - s * row) - d_u * (s * column + c * row);
    (*values)(n, kU) = d_u;
    (*values)(n, kV) = d_v;
    ++n;
  }
  return n;
}

/// Sums of the products of all values.
Gram gramOf(const cv::Mat& first, const cv::Mat& second, const cv::Mat& used, const RigidWarp& warp,
            RowValues* values) {
  Gram gram = Gram::Zero();
  for (int y = 0; y < first.rows; ++y) {
    const int n = valuesOfRow(first, second, used, warp, y, values);
    const auto rows = values->topRows(n).matrix();
    for (int a = 0; a < kValues; ++a)
      for (int b = 0; b <= a; ++b) gram(a, b) += static_cast<double>(rows.col(a).dot(rows.col(b)));
  }
  const Gram whole = gram.selfadjointView<Eigen::Lower>();
  return whole;
}

}  // namespace

double alignByCorrelation(const cv::Mat& first, const cv::Mat& second, const cv::Mat& used,
                          const AlignmentEnd& end, RigidWarp* warp) {
  RowValues values(first.cols, static_cast<int>(kValues));
  values.col(kOne) = 1.0f;
  double correlation = -1.0, before = -2.0;
  for (int step = 0; step < end.most_steps && std::abs(correlation - before) >= end.least_gain;
       ++step) {
    const Gram gram = gramOf(first, second, used, *warp, &values);
    // Less the means.
    const Gram central = gram - gram.col(kOne) * gram.row(kOne) / gram(kOne, kOne);
    before = correlation;
    correlation =
        central(kFirst, kSecond) / std::sqrt(central(kFirst, kFirst) * central(kSecond, kSecond));
    if (!std::isfinite(correlation)) return 0.0;
    const Eigen::Vector3d of_second = central.block<3, 1>(kTurn, kSecond);
    const Eigen::Vector3d of_first = central.block<3, 1>(kTurn, kFirst);
    const Eigen::LDLT<Eigen::Matrix3d> hessian(gram.block<3, 3>(kTurn, kTurn).eval());
    const Eigen::Vector3d projected = hessian.solve(of_second);
    const double gain = central(kFirst, kSecond) - of_first.dot(projected);
    if (!(gain > 0.0)) return 0.0;
    const double lambda = (central(kSecond, kSecond) - of_second.dot(projected)) / gain;
    const Eigen::Vector3d moved = hessian.solve(lambda * of_first - of_second);
    if (!moved.allFinite()) return 0.0;
    warp->angle_rad += moved[0];
    warp->u += moved[1];
    warp->v += moved[2];
  }
  return std::max(correlation, 0.0);
}

}  // namespace active_matching_slam
