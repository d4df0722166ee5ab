/// Thermo-elastic statics: K u = F theta.
#pragma once

#include <memory>
#include <span>
#include <string>
#include <vector>

#include "modelling/structure/elements/matrices.hpp"
#include "modelling/structure/solve/linear_solver.hpp"
#include "modelling/structure/solve/reduction.hpp"

namespace thermocomp::structure {

/// Linear function of the displacement: sum of weight . u over nodes.
struct Functional {
  struct Entry {
    Index node{0};
    Vec3 weight{};
  };
  std::vector<Entry> entries;

  void add(std::span<const Weighted> point, const Vec3& direction);
  /// @param displacement_m  shape (3 nodes)
  [[nodiscard]] double of(std::span<const double> displacement_m) const;
};

/// One factorisation (or set-up) serves any number of temperature fields and outputs.
/// Source: JP6507619B2, delta = K^-1 F T; the adjoint form S = (K^-1 E)^T F is ours.
class Statics {
 public:
  /// @pre mesh, materials and reduction must outlive this
  /// @throws FactorisationError
  Statics(const Mesh& mesh, std::span<const Material> material_of_part, const Reduction& reduction,
          std::span<const Coupling> couplings, const SolverChoice& choice = {});

  /// Displacements [m], shape (3 nodes), from the rise of every node [K], shape (nodes).
  [[nodiscard]] std::vector<double> displacement_m(std::span<const double> rise_K) const;
  /// Likewise from forces [N], shape (3 nodes).
  [[nodiscard]] std::vector<double> displacement_under_m(std::span<const double> force_N) const;
  /// Adjoint solution: derivative of each output by the temperature of every node [m/K], shape
  /// (outputs)(nodes). One solve per output, independent of the numbers of nodes and blocks.
  [[nodiscard]] std::vector<std::vector<double>> sensitivities(
      std::span<const Functional> outputs) const;

  [[nodiscard]] const LinearSolver& solver() const noexcept { return *solver_; }

 private:
  const Mesh& mesh_;
  std::span<const Material> material_of_part_;
  const Reduction& reduction_;
  std::unique_ptr<LinearSolver> solver_;
};

/// Stress at nodes [Pa] as xx, yy, zz, xy, yz, zx: mean of the values of all elements of one part
/// at the node. Shape (nodes).
using Stress = std::array<double, 6>;
[[nodiscard]] std::vector<Stress> nodal_stresses_Pa(const Mesh& mesh,
                                                    std::span<const Material> material_of_part,
                                                    std::span<const double> displacement_m,
                                                    std::span<const double> rise_K);

/// Rigid motions that no support, tie or coupling resists, one line per body. Empty: none.
[[nodiscard]] std::vector<std::string> free_motions(const Mesh& mesh, const Reduction& reduction,
                                                    std::span<const Coupling> couplings);

}  // namespace thermocomp::structure
