/// A structure file with its meshes: nodes in blocks, what holds them, and what is asked for.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/thermal_model.hpp"
#include "modelling/structure/files/structure_spec.hpp"
#include "modelling/structure/solve/reduction.hpp"
#include "modelling/structure/solve/statics.hpp"

namespace thermocomp::structure {

/// Told what begins, in long work.
using Progress = std::function<void(std::string_view)>;

struct Structure {
  Mesh mesh;
  std::vector<Material> material_of_part;
  Reduction reduction;            ///< of the displacements
  std::vector<Coupling> springs;  ///< to the ground and between parts
  std::vector<std::string> block_names;
  std::vector<Index> block_of_node;
  /// The outputs in their order, then for each guideway and each of its outputs one row per
  /// position.
  std::vector<Functional> rows;
};

/// Reads the meshes and binds everything the file says to them.
/// @throws ConfigurationError with all problems of a kind at once: meshes that cannot be read,
///         inverted elements; regions without nodes or faces, blocks without nodes, nodes without
///         a block, points outside their part; bodies that nothing holds
[[nodiscard]] Structure build_structure(const StructureSpec& spec, const Progress& progress);

/// Block temperatures to displacements: each block's columns of the sensitivity added up.
/// @param sensitivities_m_per_K  shape (rows)(nodes), see Statics::sensitivities()
/// Source: JP6507619B2, {delta_part} = [P1_part]{T_block}.
[[nodiscard]] ThermalModel block_model(
    const StructureSpec& spec, const Structure& structure,
    const std::vector<std::vector<double>>& sensitivities_m_per_K);

/// What a person wants to know of the result: size, what each block contributes, conditioning.
/// @param all  rows along the guideways, nodes of each block and singular values too
[[nodiscard]] std::string structure_report(const Structure& structure, const Statics& statics,
                                           const ThermalModel& model, bool all = false);

}  // namespace thermocomp::structure
