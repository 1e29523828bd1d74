#include <algorithm>
#include <cmath>

#include "joint.h"

namespace active_matching_slam {
namespace {

/// Columns of the Cholesky factor of one path of measurements, 2F values each. Conditionals of one
/// path share it, each using its first `columns`; whoever branches off copies.
using Columns = std::vector<double>;

struct DenseConditional : Conditional {
  std::shared_ptr<Columns> factor;
  int columns = 0;
};

/// column0 -= sum_j factor_j * b0[j], column1 likewise; `rows` values a column.
/// Compiled for several instruction sets; without contraction all give the same bits.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && \
    !defined(__SANITIZE_ADDRESS__)
__attribute__((target_clones("avx512f", "avx2", "default")))
#endif
void subtractColumns(const double* factor, int columns, int rows, const double* b0,
                     const double* b1, double* __restrict column0, double* __restrict column1) {
  for (int j = 0; j < columns; j += 2) {  // columns come in pairs
    const double* f0 = factor + static_cast<std::ptrdiff_t>(j) * rows;
    const double* f1 = f0 + rows;
    const double b00 = b0[j], b01 = b0[j + 1], b10 = b1[j], b11 = b1[j + 1];
    for (int r = 0; r < rows; ++r) {
      column0[r] -= f0[r] * b00 + f1[r] * b01;
      column1[r] -= f0[r] * b10 + f1[r] * b11;
    }
  }
}

class DenseJoint : public Joint {
 public:
  DenseJoint(const Eigen::MatrixXd& S, const Eigen::VectorXd& precision_determinant,
             double noise_variance)
      : Joint(Eigen::Matrix2d::Identity() * noise_variance, precision_determinant), S_(S) {
    auto prior = std::make_shared<DenseConditional>();
    marginalsOf(*prior).resize(static_cast<std::size_t>(size()));
    measuredOf(*prior).assign(static_cast<std::size_t>(size()), 0);
    for (int f = 0; f < size(); ++f) setMarginal(*prior, f, S.block<2, 2>(2 * f, 2 * f));
    prior->factor = std::make_shared<Columns>();
    setPrior(prior);
  }

 private:
  std::shared_ptr<Conditional> derive(const std::shared_ptr<const Conditional>& base,
                                      int feature) const override {
    const auto& given = static_cast<const DenseConditional&>(*base);
    auto derived = std::make_shared<DenseConditional>();
    inherit(*derived, given, feature);
    const int rows = 2 * size();
    // The column of the covariance given what was measured before.
    Eigen::MatrixX2d column = S_.middleCols<2>(2 * feature);
    std::vector<double> b(2 * static_cast<std::size_t>(given.columns));
    const double* factor = given.factor->data();
    for (int j = 0; j < given.columns; ++j)
      for (int r = 0; r < 2; ++r)
        b[static_cast<std::size_t>(r * given.columns + j)] =
            factor[static_cast<std::ptrdiff_t>(j) * rows + 2 * feature + r];
    subtractColumns(factor, given.columns, rows, b.data(), b.data() + given.columns, column.data(),
                    column.data() + rows);
    takeFactor(*derived, given, column, feature);
    shrink(*derived, column);
    return derived;
  }

  /// Appends the two columns of the new measurement, column * chol(S_cc)^-T.
  void takeFactor(DenseConditional& derived, const DenseConditional& given,
                  const Eigen::MatrixX2d& column, int feature) const {
    const auto rows = static_cast<std::size_t>(2 * size());
    const std::size_t used = static_cast<std::size_t>(given.columns) * rows;
    if (given.factor->size() == used) {
      derived.factor = given.factor;
    } else {
      derived.factor = std::make_shared<Columns>(
          given.factor->begin(), given.factor->begin() + static_cast<std::ptrdiff_t>(used));
    }
    const Eigen::Matrix2d& c = given.marginal(feature).covariance;
    const double l00 = std::sqrt(c(0, 0)), l10 = c(1, 0) / l00;
    const double l11 = std::sqrt(std::max(c(1, 1) - l10 * l10, 0.0));
    derived.factor->resize(used + 2 * rows);
    double* v0 = derived.factor->data() + used;
    double* v1 = v0 + rows;
    for (std::size_t r = 0; r < rows; ++r) {
      v0[r] = column(static_cast<Eigen::Index>(r), 0) / l00;
      v1[r] = (column(static_cast<Eigen::Index>(r), 1) - v0[r] * l10) / l11;
    }
    derived.columns = given.columns + 2;
  }

  void shrink(DenseConditional& derived, const Eigen::MatrixX2d& column) const {
    const auto rows = static_cast<std::ptrdiff_t>(2 * size());
    const double* v0 = derived.factor->data() + (derived.columns - 2) * rows;
    const double* v1 = v0 + rows;
    for (int f = 0; f < size(); ++f) {
      if (derived.isMeasured(f)) continue;
      Eigen::Matrix2d covariance = derived.marginal(f).covariance;
      const double a0 = v0[2 * f], a1 = v1[2 * f], b0 = v0[2 * f + 1], b1 = v1[2 * f + 1];
      covariance(0, 0) -= a0 * a0 + a1 * a1;
      covariance(1, 0) -= a0 * b0 + a1 * b1;
      covariance(0, 1) = covariance(1, 0);
      covariance(1, 1) -= b0 * b0 + b1 * b1;
      setMarginal(derived, f, covariance);
      touchedOf(derived).push_back(f);
      crossOf(derived).push_back(column.middleRows<2>(2 * f));
    }
  }

  const Eigen::MatrixXd& S_;
};

}  // namespace

std::unique_ptr<Joint> makeDenseJoint(const Eigen::MatrixXd& S,
                                      const Eigen::VectorXd& precision_determinant,
                                      double noise_variance) {
  return std::make_unique<DenseJoint>(S, precision_determinant, noise_variance);
}

}  // namespace active_matching_slam
