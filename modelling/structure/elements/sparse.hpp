/// Symmetric sparse matrices by columns, and their Cholesky factors (CHOLMOD).
#pragma once

#include <functional>
#include <memory>
#include <span>
#include <stdexcept>
#include <vector>

#include "modelling/structure/mesh/element_shape.hpp"

namespace thermocomp::structure {

/// Lower triangle with diagonal; rows increase in every column.
struct SparseSymmetric {
  std::vector<Index> column_start;  ///< shape (size + 1)
  std::vector<Index> row;
  std::vector<double> value;

  [[nodiscard]] Index size() const { return static_cast<Index>(column_start.size()) - 1; }
  /// @param neighbours  gives the possible rows of a column, in any order and with repetitions;
  ///                    rows above the diagonal are ignored
  [[nodiscard]] static SparseSymmetric with_pattern(
      Index size, const std::function<void(Index, std::vector<Index>&)>& neighbours);
  /// @pre row >= column, and the place is in the pattern (checked)
  void add(Index row_index, Index column, double amount);
  /// y = A x with both triangles.
  void multiply(std::span<const double> x, std::span<double> y) const;
};

/// a A + b B.
/// @pre equal patterns
[[nodiscard]] SparseSymmetric combination(double a, const SparseSymmetric& A, double b,
                                          const SparseSymmetric& B);

/// The matrix has no Cholesky factor, or none that fits into memory.
class FactorisationError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Factor in the library's own form.
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
  /// @throws FactorisationError: not positive definite, or not enough memory; std::runtime_error if
  ///         thermocomp-cholmod.so cannot be loaded
  explicit Cholesky(const SparseSymmetric& matrix);

  /// Solves A x = b in place for several right sides, shape (right sides x size).
  void solve(std::span<double> right_sides) const;
  /// (Smallest / largest diagonal of the factor)^2; small if A is nearly singular.
  [[nodiscard]] double reciprocal_condition() const;
  [[nodiscard]] double factor_MB() const;

 private:
  Index size_;
  std::unique_ptr<CholeskyFactor> factor_;  ///< nullptr for an empty matrix
};

/// Functions of thermocomp-cholmod.so. Only this module links CHOLMOD, which loads a BLAS and eight
/// further libraries: most of a start's time, and few commands factorise a matrix. Program and
/// module come from one build, so exceptions can cross between them.
struct CholmodFunctions {
  /// @pre the matrix is not empty
  /// @throws FactorisationError as the constructor of Cholesky
  std::unique_ptr<CholeskyFactor> (*factorise)(const SparseSymmetric& matrix);
};

}  // namespace thermocomp::structure

/// The only symbol that is looked up.
extern "C" const thermocomp::structure::CholmodFunctions thermocomp_cholmod_functions;
