/// Solvers of K u = f for statics; thermocomp-petsc solves systems too large for a factorisation.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>

#include "modelling/structure/mesh/mesh.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

class LinearSolver {
 public:
  LinearSolver() = default;
  virtual ~LinearSolver() = default;
  LinearSolver(const LinearSolver&) = delete;
  LinearSolver& operator=(const LinearSolver&) = delete;

  /// Solves A x = b in place for several right sides, shape (right sides x size).
  /// @throws FactorisationError
  virtual void solve(std::span<double> right_sides) const = 0;
  /// One or two lines for the report.
  [[nodiscard]] virtual std::string report() const = 0;
};

enum class Backend {
  cholmod,  ///< one factorisation in this computer's memory
  petsc     ///< conjugate gradients with algebraic multigrid, on one or more MPI ranks
};
struct SolverChoice {
  Backend backend{Backend::cholmod};
  int ranks{2};
};

/// Keeps the system in a file in its own folder (below TMPDIR), so that this process need not hold
/// the matrix; each solve() starts the program once for all right sides.
class PetscSolver : public LinearSolver {
 public:
  /// @param matrix  of the free unknowns; not used afterwards
  /// @throws FactorisationError if the program or mpirun is missing, or the file cannot be written
  PetscSolver(const SparseSymmetric& matrix, const Mesh& mesh, const Reduction& reduction,
              int ranks);
  ~PetscSolver() override;

  void solve(std::span<double> right_sides) const override;
  [[nodiscard]] std::string report() const override;

 private:
  std::filesystem::path program_;
  std::filesystem::path folder_;
  int ranks_;
  Index size_;
  mutable std::string output_;  ///< output of the program: iterations and residuals
};

}  // namespace thermocomp::structure
