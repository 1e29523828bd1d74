#include "active_matching_slam/information/gaussian_information.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "active_matching_slam/information/pair_dependence.h"

namespace active_matching_slam {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;
using MatrixRef = Eigen::Ref<const MatrixXd>;

void checkSquare(const MatrixRef& matrix, const char* name, int divisor = 1) {
  if (matrix.rows() == matrix.cols() && matrix.rows() % divisor == 0) return;
  throw std::invalid_argument(std::string(name) + " is " + std::to_string(matrix.rows()) + " x " +
                              std::to_string(matrix.cols()) + ", allowed: square" +
                              (divisor == 2 ? " with an even number of rows" : ""));
}

/// Lower Cholesky factor, or empty when the matrix is not finite or has no digits left that show it
/// positive definite.
std::optional<MatrixXd> choleskyFactor(const MatrixRef& matrix) {
  constexpr double kSmallestFraction = 1e-14;  // conditional variance over variance
  if (!matrix.allFinite()) return std::nullopt;
  MatrixXd factor = matrix;
  Eigen::LLT<Eigen::Ref<MatrixXd>> llt(factor);
  if (llt.info() != Eigen::Success) return std::nullopt;
  for (Eigen::Index i = 0; i < factor.rows(); ++i) {
    if (!(factor(i, i) * factor(i, i) > kSmallestFraction * matrix(i, i))) return std::nullopt;
  }
  return factor;
}

double logDeterminantBits(const MatrixXd& cholesky_factor) {
  return 2.0 * cholesky_factor.diagonal().array().log().sum() / std::log(2.0);
}

/// Inverts a lower triangular matrix in place, by halves: [A 0; B C]^-1 = [A' 0; -C' B A', C'].
void invertLower(Eigen::Ref<MatrixXd> lower) {
  constexpr Eigen::Index kSmall = 16;
  const Eigen::Index n = lower.rows();
  if (n <= kSmall) {
    for (Eigen::Index j = 0; j < n; ++j) {
      lower(j, j) = 1.0 / lower(j, j);
      for (Eigen::Index i = j + 1; i < n; ++i) {
        double sum = lower(i, j) * lower(j, j);
        for (Eigen::Index k = j + 1; k < i; ++k) sum += lower(i, k) * lower(k, j);
        lower(i, j) = -sum / lower(i, i);
      }
    }
    return;
  }
  const Eigen::Index half = n / 2, rest = n - half;
  auto below = lower.bottomLeftCorner(rest, half);
  const auto a = lower.topLeftCorner(half, half).triangularView<Eigen::Lower>();
  const auto c = lower.bottomRightCorner(rest, rest).triangularView<Eigen::Lower>();
  a.solveInPlace<Eigen::OnTheRight>(below);
  c.solveInPlace(below);
  below *= -1.0;
  invertLower(lower.topLeftCorner(half, half));
  invertLower(lower.bottomRightCorner(rest, rest));
}

std::vector<Whitening> whitenings(const MatrixRef& S) {
  std::vector<Whitening> result(S.rows() / 2);
  for (std::size_t i = 0; i < result.size(); ++i) {
    result[i] = Whitening::of(S(2 * i, 2 * i), S(2 * i + 1, 2 * i), S(2 * i + 1, 2 * i + 1));
  }
  return result;
}

/// Features to reckon with: usable alone, and finite with all those taken before.
std::vector<int> usableFeatures(const MatrixRef& S) {
  const std::vector<Whitening> alone = whitenings(S);
  const bool finite = S.allFinite();
  std::vector<int> kept;
  for (int i = 0; i < static_cast<int>(alone.size()); ++i) {
    bool usable = alone[i].usable;
    for (std::size_t k = 0; !finite && usable && k < kept.size(); ++k) {
      usable = S.block<2, 2>(2 * i, 2 * kept[k]).allFinite();
    }
    if (usable) kept.push_back(i);
  }
  return kept;
}

/// Factors `S`, growing its diagonal by as little as makes that possible.
std::optional<MatrixXd> regularisedFactor(MatrixXd& S, double& regularisation) {
  std::optional<MatrixXd> factor = choleskyFactor(S);
  if (factor) return factor;
  const VectorXd diagonal = S.diagonal();
  for (int exponent = -12; exponent <= 0; exponent += 2) {
    regularisation = std::pow(10.0, exponent);
    S.diagonal() = (1.0 + regularisation) * diagonal;
    factor = choleskyFactor(S);
    if (factor) return factor;
  }
  return std::nullopt;
}

double determinant2(const Eigen::Matrix2d& m) { return m(0, 0) * m(1, 1) - m(1, 0) * m(1, 0); }

}  // namespace

MatrixXd selectFeatures(const MatrixRef& S, const std::vector<int>& features) {
  const Eigen::Index n = static_cast<Eigen::Index>(features.size());
  if (2 * n == S.rows()) return S;
  MatrixXd selected(2 * n, 2 * n);
  for (Eigen::Index k = 0; k < n; ++k) {
    for (Eigen::Index i = 0; i < n; ++i) {
      selected.block<2, 2>(2 * i, 2 * k) = S.block<2, 2>(2 * features[i], 2 * features[k]);
    }
  }
  return selected;
}

std::optional<double> entropyBits(const MatrixRef& covariance) {
  checkSquare(covariance, "covariance");
  const std::optional<MatrixXd> factor = choleskyFactor(covariance);
  if (!factor) return std::nullopt;
  const double per_dimension = std::log2(2.0 * M_PI) + 1.0 / std::log(2.0);
  return 0.5 * (covariance.rows() * per_dimension + logDeterminantBits(*factor));
}

std::optional<double> partitionInformationBits(const MatrixRef& covariance,
                                               const std::vector<int>& part) {
  checkSquare(covariance, "covariance");
  const int n = static_cast<int>(covariance.rows());
  std::vector<char> in_part(n, 0);
  std::vector<int> order;
  for (int index : part) {
    if (index < 0 || index >= n || in_part[index]) {
      throw std::invalid_argument("part has index " + std::to_string(index) + ", allowed: 0 to " +
                                  std::to_string(n - 1) + ", each once");
    }
    in_part[index] = 1;
    order.push_back(index);
  }
  for (int i = 0; i < n; ++i) {
    if (!in_part[i]) order.push_back(i);
  }
  MatrixXd ordered(n, n);
  for (int k = 0; k < n; ++k) {
    for (int i = 0; i < n; ++i) ordered(i, k) = covariance(order[i], order[k]);
  }
  // With `part` first, the factor of P holds that of P_aa and that of the Schur complement of P_aa.
  const std::optional<MatrixXd> factor = choleskyFactor(ordered);
  if (!factor) return std::nullopt;
  const int rest = n - static_cast<int>(part.size());
  const std::optional<MatrixXd> rest_factor = choleskyFactor(ordered.bottomRightCorner(rest, rest));
  if (!rest_factor) return std::nullopt;
  const double bits =
      logDeterminantBits(*rest_factor) - logDeterminantBits(factor->bottomRightCorner(rest, rest));
  return std::max(0.0, 0.5 * bits);
}

VectorXd stateInformationBits(const MatrixRef& state_covariance, const MatrixRef& cross_covariance,
                              const MatrixRef& S) {
  checkSquare(state_covariance, "state_covariance");
  checkSquare(S, "S", 2);
  if (cross_covariance.rows() != state_covariance.rows() || cross_covariance.cols() != S.cols()) {
    throw std::invalid_argument("cross_covariance is " + std::to_string(cross_covariance.rows()) +
                                " x " + std::to_string(cross_covariance.cols()) +
                                ", allowed: " + std::to_string(state_covariance.rows()) + " x " +
                                std::to_string(S.cols()));
  }
  const std::vector<Whitening> points = whitenings(S);
  VectorXd bits = VectorXd::Zero(static_cast<Eigen::Index>(points.size()));
  const std::optional<MatrixXd> factor = choleskyFactor(state_covariance);
  if (!factor) return bits;
  const MatrixXd half = factor->triangularView<Eigen::Lower>().solve(cross_covariance);
  for (Eigen::Index i = 0; i < bits.size(); ++i) {
    if (!points[i].usable) continue;
    const Eigen::Matrix<double, Eigen::Dynamic, 2> C =
        half.middleCols<2>(2 * i) * points[i].matrix().transpose();
    const double odds =
        dependenceOdds(C.col(0).squaredNorm(), C.col(0).dot(C.col(1)), C.col(1).squaredNorm());
    if (std::isfinite(odds)) bits(i) = oddsToBits(odds);
  }
  return bits;
}

FeatureInformation featureInformation(const MatrixRef& S) {
  checkSquare(S, "S", 2);
  const Eigen::Index features = S.rows() / 2;
  FeatureInformation result;
  result.bits = VectorXd::Zero(features);
  result.precision_determinant = VectorXd::Zero(features);
  result.usable.assign(features, 0);
  const std::vector<int> kept = usableFeatures(S);
  MatrixXd selected = selectFeatures(S, kept);
  std::optional<MatrixXd> factor = regularisedFactor(selected, result.regularisation);
  if (!factor) return result;
  // S^-1 = X^T X with X the inverse of the factor: its 2 x 2 diagonal blocks are all that is
  // needed.
  invertLower(*factor);
  for (std::size_t k = 0; k < kept.size(); ++k) {
    const Eigen::Index column = static_cast<Eigen::Index>(2 * k);
    const auto tall = factor->middleCols<2>(column).bottomRows(factor->rows() - column);
    const Eigen::Index rows = tall.rows();
    const double l11 = tall.col(1).tail(rows - 1).squaredNorm();
    const double l10 = tall.col(0).tail(rows - 1).dot(tall.col(1).tail(rows - 1));
    const double l00 = tall.col(0).squaredNorm();
    const Eigen::Matrix2d S_ii = selected.block<2, 2>(column, column);
    result.precision_determinant(kept[k]) = l00 * l11 - l10 * l10;
    result.bits(kept[k]) =
        informationBits(determinant2(S_ii), result.precision_determinant(kept[k]));
    result.usable[kept[k]] = 1;
  }
  return result;
}

double informationBits(double covariance_determinant, double precision_determinant) {
  const double ratio = covariance_determinant * precision_determinant;
  return ratio > 1.0 ? 0.5 * std::log2(ratio) : 0.0;
}

double pairInformationBits(const MatrixRef& S, int i, int k) {
  checkSquare(S, "S", 2);
  const int features = static_cast<int>(S.rows()) / 2;
  if (i < 0 || k < 0 || i >= features || k >= features) {
    throw std::invalid_argument("pair (" + std::to_string(i) + ", " + std::to_string(k) +
                                "), allowed: 0 to " + std::to_string(features - 1));
  }
  if (i == k) return 0.0;
  const Eigen::Matrix2d S_ik = S.block<2, 2>(2 * std::min(i, k), 2 * std::max(i, k));
  const Whitening first = Whitening::of(S.block<2, 2>(2 * std::min(i, k), 2 * std::min(i, k)));
  const Whitening second = Whitening::of(S.block<2, 2>(2 * std::max(i, k), 2 * std::max(i, k)));
  const double odds = dependenceOdds(first, second, S_ik(0, 0), S_ik(1, 0), S_ik(0, 1), S_ik(1, 1));
  return std::isfinite(odds) ? oddsToBits(odds) : 0.0;
}

MatrixXd pairInformationMatrix(const MatrixRef& S) {
  checkSquare(S, "S", 2);
  const std::vector<Whitening> points = whitenings(S);
  const int features = static_cast<int>(points.size());
  MatrixXd bits = MatrixXd::Zero(features, features);
  for (int k = 0; k < features; ++k) {
    for (int i = 0; i < k; ++i) {
      const double odds = dependenceOdds(points[i], points[k], S(2 * i, 2 * k), S(2 * i + 1, 2 * k),
                                         S(2 * i, 2 * k + 1), S(2 * i + 1, 2 * k + 1));
      if (std::isfinite(odds)) bits(i, k) = bits(k, i) = oddsToBits(odds);
    }
  }
  return bits;
}

double ellipseArea(const Eigen::Matrix2d& covariance) {
  const double determinant = determinant2(covariance);
  return determinant > 0.0 && covariance(0, 0) > 0.0 ? 9.0 * M_PI * std::sqrt(determinant) : 0.0;
}

double informationEfficiency(double bits, double area_px) {
  return area_px > 0.0 ? bits / area_px : 0.0;
}

}  // namespace active_matching_slam
