/// What solves K u = f for statics.
#pragma once

#include <memory>
#include <span>
#include <string>

namespace thermocomp::structure {

class LinearSolver {
 public:
  LinearSolver() = default;
  virtual ~LinearSolver() = default;
  LinearSolver(const LinearSolver&) = delete;
  LinearSolver& operator=(const LinearSolver&) = delete;

  /// Solves A x = b in place for right sides one after the other, shape (right sides x size).
  /// @throws FactorisationError
  virtual void solve(std::span<double> right_sides) const = 0;
  /// One or two lines for the report.
  [[nodiscard]] virtual std::string report() const = 0;
};

enum class Backend {
  cholmod,  ///< one factorisation, on this machine's memory
  petsc     ///< conjugate gradients with algebraic multigrid, on one or more MPI ranks
};
struct SolverChoice {
  Backend backend{Backend::cholmod};
  int ranks{2};
};

}  // namespace thermocomp::structure
