/// Assembles element matrices over a mesh: stiffness, thermal load, conduction, capacity.
#pragma once

#include <array>
#include <span>
#include <string>
#include <vector>

#include "modelling/structure/elements/sparse.hpp"
#include "modelling/structure/mesh/mesh.hpp"

namespace thermocomp::structure {

struct Material {
  std::string name;
  double youngs_modulus_Pa{0.0};
  double poisson_ratio{0.0};
  double expansion_per_K{0.0};
  double conductivity_W_per_m_K{0.0};
  double density_kg_per_m3{0.0};
  double heat_capacity_J_per_kg_K{0.0};
};

/// Coupling at one point: energy = sum_c strength_c (sum_i weight_i u_ic)^2 / 2. Used for springs
/// to the ground and between faces, convection, contact conductance.
struct Coupling {
  static constexpr std::size_t nodes_max = 16;  ///< two faces
  std::array<Index, nodes_max> nodes{};
  std::array<double, nodes_max> weight{};
  std::size_t count{0};
  Vec3 strength{};  ///< N/m in x, y, z; for heat, W/K in the first

  void add(std::span<const Index> face_nodes, std::span<const double> values, double sign);
};

/// K: 3 unknowns per node, plus couplings [N/m].
/// @param material_of_part  shape (parts)
[[nodiscard]] SparseSymmetric stiffness_matrix(const Mesh& mesh,
                                               std::span<const Material> material_of_part,
                                               std::span<const Coupling> couplings);

/// f = F theta; theta is the rise of every node, interpolated by the element's shape functions
/// (quadratic in tet10 and hex20) and integrated exactly in straight elements.
/// @param rise_K  shape (nodes). @return shape (3 nodes) [N]
[[nodiscard]] std::vector<double> thermal_load(const Mesh& mesh,
                                               std::span<const Material> material_of_part,
                                               std::span<const double> rise_K);

/// F^T v: shape (nodes) from shape (3 nodes).
[[nodiscard]] std::vector<double> thermal_load_transposed(
    const Mesh& mesh, std::span<const Material> material_of_part, std::span<const double> v);

/// One unknown per node: conduction plus couplings [W/K] and capacity [J/K], with equal patterns.
struct HeatMatrices {
  SparseSymmetric conduction;
  SparseSymmetric capacity;
};
[[nodiscard]] HeatMatrices heat_matrices(const Mesh& mesh,
                                         std::span<const Material> material_of_part,
                                         std::span<const Coupling> couplings);

/// Integral of each node's shape function [m^3]; shape (nodes).
[[nodiscard]] std::vector<double> nodal_volumes(const Mesh& mesh);

}  // namespace thermocomp::structure
