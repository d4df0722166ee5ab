/// Symmetric sparse matrices by columns, and their Cholesky factors (CHOLMOD).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

#include "modelling/structure/mesh/element_shape.hpp"

namespace thermocomp::structure {

/// The lower triangle, diagonal included, rows increasing in every column.
struct SparseSymmetric {
  std::vector<Index> column_start;  ///< shape (size + 1)
  std::vector<Index> row;
  std::vector<double> value;

  [[nodiscard]] Index size() const { return static_cast<Index>(column_start.size()) - 1; }
  /// @param neighbours  for each column the rows it may have, in any order, repetitions allowed;
  ///                    rows above the diagonal are left out
  [[nodiscard]] static SparseSymmetric with_pattern(
      Index size, const std::function<void(Index, std::vector<Index>&)>& neighbours);
  /// @pre row >= column and the place is in the pattern (checked)
  void add(Index row_index, Index column, double amount);
  /// y = A x, over the whole matrix.
  void multiply(std::span<const double> x, std::span<double> y) const;
};

/// a A + b B.
/// @pre equal patterns
[[nodiscard]] SparseSymmetric combination(double a, const SparseSymmetric& A, double b,
                                          const SparseSymmetric& B);

/// A matrix that has no Cholesky factor, or none that this computer can hold.
class FactorisationError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// A factor as the library that made it holds it.
class CholeskyFactor {
 public:
  CholeskyFactor() = default;
  virtual ~CholeskyFactor() = default;
  CholeskyFactor(const CholeskyFactor&) = delete;
  CholeskyFactor& operator=(const CholeskyFactor&) = delete;

  virtual void solve(std::span<double> right_sides) = 0;
  virtual double reciprocal_condition() = 0;
  [[nodiscard]] virtual double size_MB() const = 0;
};

/// A = L L^T, supernodal, ordered by nested dissection (METIS).
class Cholesky {
 public:
  /// @throws FactorisationError: not positive definite, or not enough memory; std::runtime_error
  ///         where thermocomp-cholmod.so cannot be loaded
  explicit Cholesky(const SparseSymmetric& matrix);

  /// Solves A x = b in place for right sides one after the other, shape (right sides x size).
  void solve(std::span<double> right_sides) const;
  /// Least diagonal of the factor over the greatest, squared; small where A is near to singular.
  [[nodiscard]] double reciprocal_condition() const;
  [[nodiscard]] double factor_MB() const;

 private:
  Index size_;
  std::unique_ptr<CholeskyFactor> factor_;  ///< of no matrix without rows
};

/// What thermocomp-cholmod.so offers to the program that loads it. Only that module is linked with
/// CHOLMOD: it brings a BLAS and eight further libraries, which take more of the time of a start
/// than all else, and few commands have a matrix to factorise.
/// Program and module come from one build; what is thrown on one side is caught on the other.
struct CholmodFunctions {
  /// @pre the matrix has a row
  /// @throws FactorisationError as the constructor of Cholesky
  std::unique_ptr<CholeskyFactor> (*factorise)(const SparseSymmetric& matrix);
};

}  // namespace thermocomp::structure

/// The one name that is looked up.
extern "C" const thermocomp::structure::CholmodFunctions thermocomp_cholmod_functions;
