#include <algorithm>
#include <cmath>

#include "joint.h"

namespace active_matching_slam {
namespace {

/// Columns of the Cholesky factor of one path of measurements, two values for each feature kept.
/// Conditionals of one path share it, each using its first `columns`; whoever branches off copies.
struct Factor {
  std::vector<int> kept;  ///< features that were not measured yet when it was made, ascending
  std::vector<double> values;
};

struct DenseConditional : ConditionalJoint {
  std::shared_ptr<Factor> factor;
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
             const Eigen::VectorXd& noise_variances)
      : Joint(noise_variances, precision_determinant), S_(S) {
    auto prior = std::make_shared<DenseConditional>();
    marginalsOf(*prior).resize(static_cast<std::size_t>(size()));
    measuredOf(*prior).assign(static_cast<std::size_t>(size()), 0);
    for (int f = 0; f < size(); ++f) setMarginal(*prior, f, S.block<2, 2>(2 * f, 2 * f));
    prior->factor = std::make_shared<Factor>();
    for (int f = 0; f < size(); ++f) prior->factor->kept.push_back(f);
    setPrior(prior);
  }

 private:
  std::shared_ptr<ConditionalJoint> derive(const std::shared_ptr<const ConditionalJoint>& base,
                                           int feature) const override {
    const auto& given = static_cast<const DenseConditional&>(*base);
    auto derived = std::make_shared<DenseConditional>();
    inherit(*derived, given, feature);
    derived->factor = factorFor(given);
    const std::vector<int>& kept = derived->factor->kept;
    const auto rows = static_cast<Eigen::Index>(2 * kept.size());
    // The column of the covariance given what was measured before.
    Eigen::MatrixX2d column(rows, 2);
    for (std::size_t i = 0; i < kept.size(); ++i)
      column.middleRows<2>(2 * static_cast<Eigen::Index>(i)) =
          S_.block<2, 2>(2 * kept[i], 2 * feature);
    const auto own = static_cast<std::ptrdiff_t>(
        2 * (std::lower_bound(kept.begin(), kept.end(), feature) - kept.begin()));
    std::vector<double> b(2 * static_cast<std::size_t>(given.columns));
    const double* factor = derived->factor->values.data();
    for (int j = 0; j < given.columns; ++j)
      for (int r = 0; r < 2; ++r)
        b[static_cast<std::size_t>(r * given.columns + j)] = factor[j * rows + own + r];
    subtractColumns(factor, given.columns, static_cast<int>(rows), b.data(),
                    b.data() + given.columns, column.data(), column.data() + rows);
    append(*derived, given, column, feature);
    shrink(*derived, column);
    return derived;
  }

  /// The factor of `given`, to be appended to: its own if it ends there, else a copy, without the
  /// rows of measured features when those have become many.
  std::shared_ptr<Factor> factorFor(const DenseConditional& given) const {
    const Factor& all = *given.factor;
    const auto columns = static_cast<std::size_t>(given.columns);
    const std::size_t rows = 2 * all.kept.size();
    const std::size_t unmeasured = 2 * static_cast<std::size_t>(size()) - columns;
    const bool is_sparse = 4 * unmeasured < 3 * rows && columns > 8;
    if (!is_sparse && all.values.size() == columns * rows) return given.factor;
    auto copy = std::make_shared<Factor>();
    if (!is_sparse) {
      copy->kept = all.kept;
      copy->values.assign(all.values.begin(),
                          all.values.begin() + static_cast<std::ptrdiff_t>(columns * rows));
      return copy;
    }
    std::vector<std::size_t> places;
    for (std::size_t i = 0; i < all.kept.size(); ++i) {
      if (given.isMeasured(all.kept[i])) continue;
      places.push_back(2 * i);
      copy->kept.push_back(all.kept[i]);
    }
    copy->values.reserve(2 * places.size() * (columns + 16));
    for (std::size_t j = 0; j < columns; ++j)
      for (const std::size_t place : places) {
        const double* value = &all.values[j * rows + place];
        copy->values.insert(copy->values.end(), value, value + 2);
      }
    return copy;
  }

  /// Appends the two columns of the new measurement, column * chol(S_cc)^-T.
  static void append(DenseConditional& derived, const DenseConditional& given,
                     const Eigen::MatrixX2d& column, int feature) {
    std::vector<double>& values = derived.factor->values;
    const auto rows = static_cast<std::size_t>(column.rows());
    const std::size_t used = values.size();
    const Eigen::Matrix2d& c = given.marginal(feature).covariance;
    const double l00 = std::sqrt(c(0, 0)), l10 = c(1, 0) / l00;
    const double l11 = std::sqrt(std::max(c(1, 1) - l10 * l10, 0.0));
    values.resize(used + 2 * rows);
    double* v0 = values.data() + used;
    double* v1 = v0 + rows;
    for (std::size_t r = 0; r < rows; ++r) {
      v0[r] = column(static_cast<Eigen::Index>(r), 0) / l00;
      v1[r] = (column(static_cast<Eigen::Index>(r), 1) - v0[r] * l10) / l11;
    }
    derived.columns = given.columns + 2;
  }

  void shrink(DenseConditional& derived, const Eigen::MatrixX2d& column) const {
    const std::vector<int>& kept = derived.factor->kept;
    const Eigen::Index rows = column.rows();
    const double* v0 = derived.factor->values.data() + (derived.columns - 2) * rows;
    const double* v1 = v0 + rows;
    touchedOf(derived).reserve(kept.size());
    crossOf(derived).reserve(kept.size());
    for (std::size_t i = 0; i < kept.size(); ++i) {
      const int f = kept[i];
      if (derived.isMeasured(f)) continue;
      const auto r = static_cast<Eigen::Index>(2 * i);
      Eigen::Matrix2d covariance = derived.marginal(f).covariance;
      const double a0 = v0[r], a1 = v1[r], b0 = v0[r + 1], b1 = v1[r + 1];
      covariance(0, 0) -= a0 * a0 + a1 * a1;
      covariance(1, 0) -= a0 * b0 + a1 * b1;
      covariance(0, 1) = covariance(1, 0);
      covariance(1, 1) -= b0 * b0 + b1 * b1;
      setMarginal(derived, f, covariance);
      touchedOf(derived).push_back(f);
      crossOf(derived).push_back(column.middleRows<2>(r));
    }
  }

  const Eigen::MatrixXd& S_;
};

}  // namespace

std::unique_ptr<Joint> makeDenseJoint(const Eigen::MatrixXd& S,
                                      const Eigen::VectorXd& precision_determinant,
                                      const Eigen::VectorXd& noise_variances) {
  return std::make_unique<DenseJoint>(S, precision_determinant, noise_variances);
}

}  // namespace active_matching_slam
