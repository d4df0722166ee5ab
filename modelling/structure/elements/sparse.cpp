#include "modelling/structure/elements/sparse.hpp"

#include <algorithm>
#include <limits>

#include "estimator/checks.hpp"
#include "modelling/structure/modules/module_loader.hpp"

namespace thermocomp::structure {

SparseSymmetric SparseSymmetric::with_pattern(
    Index size, const std::function<void(Index, std::vector<Index>&)>& neighbours) {
  SparseSymmetric matrix;
  matrix.column_start.assign(1, 0);
  matrix.column_start.reserve(std::size_t{size} + 1);
  std::vector<Index> rows;
  for (Index column = 0; column < size; ++column) {
    rows.assign(1, column);
    neighbours(column, rows);
    std::sort(rows.begin(), rows.end());
    const auto last = std::unique(rows.begin(), rows.end());
    const auto first = std::lower_bound(rows.begin(), last, column);
    matrix.row.insert(matrix.row.end(), first, last);
    if (matrix.row.size() > std::size_t{std::numeric_limits<int>::max()}) {
      throw FactorisationError("the model is too large: more than 2^31 entries in its matrix");
    }
    matrix.column_start.push_back(static_cast<Index>(matrix.row.size()));
  }
  matrix.value.assign(matrix.row.size(), 0.0);
  return matrix;
}

void SparseSymmetric::add(Index row_index, Index column, double amount) {
  const auto first = row.begin() + column_start[column];
  const auto last = row.begin() + column_start[column + 1];
  const auto place = std::lower_bound(first, last, row_index);
  THERMOCOMP_ENSURE(place != last && *place == row_index);
  value[static_cast<std::size_t>(place - row.begin())] += amount;
}

void SparseSymmetric::multiply(std::span<const double> x, std::span<double> y) const {
  std::fill(y.begin(), y.end(), 0.0);
  for (Index column = 0; column < size(); ++column) {
    double sum = value[column_start[column]] * x[column];  // the diagonal comes first
    for (Index k = column_start[column] + 1; k < column_start[column + 1]; ++k) {
      sum += value[k] * x[row[k]];
      y[row[k]] += value[k] * x[column];
    }
    y[column] += sum;
  }
}

SparseSymmetric combination(double a, const SparseSymmetric& A, double b,
                            const SparseSymmetric& B) {
  THERMOCOMP_ENSURE(A.row == B.row);
  SparseSymmetric sum = A;
  for (std::size_t i = 0; i < sum.value.size(); ++i) {
    sum.value[i] = a * A.value[i] + b * B.value[i];
  }
  return sum;
}

namespace {

constexpr Module cholmod_module{"thermocomp-cholmod.so", "factorises matrices",
                                "thermocomp_cholmod_functions", "CHOLMOD (Debian 12: libcholmod3)"};

const CholmodFunctions& cholmod() {
  // Retried if loading failed.
  static const auto& functions =
      *static_cast<const CholmodFunctions*>(functions_of(cholmod_module));
  return functions;
}

}  // namespace

Cholesky::Cholesky(const SparseSymmetric& matrix) : size_(matrix.size()) {
  if (size_ > 0) factor_ = cholmod().factorise(matrix);
}

void Cholesky::solve(std::span<double> right_sides) const {
  if (size_ == 0) return;
  THERMOCOMP_ENSURE(right_sides.size() % size_ == 0);
  factor_->solve(right_sides);
}

double Cholesky::reciprocal_condition() const {
  return size_ == 0 ? 1.0 : factor_->reciprocal_condition();
}

double Cholesky::factor_MB() const {
  return size_ == 0 ? 0.0 : factor_->size_MB();
}

}  // namespace thermocomp::structure
