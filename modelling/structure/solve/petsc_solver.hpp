/// Linear systems too large for a factorisation, by the program thermocomp-petsc under mpirun.
#pragma once

#include <filesystem>
#include <string>

#include "modelling/structure/mesh/mesh.hpp"
#include "modelling/structure/solve/linear_solver.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

/// The system waits in a file of a folder of its own (below TMPDIR), so that this process need not
/// hold the matrix; each solve() starts the program once for all its right sides.
class PetscSolver : public LinearSolver {
 public:
  /// @param matrix  of the free unknowns; no longer needed afterwards
  /// @throws FactorisationError where the program or mpirun is missing, or the file cannot be
  /// written
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
  mutable std::string said_;  ///< by the program: iterations and residuals
};

}  // namespace thermocomp::structure
