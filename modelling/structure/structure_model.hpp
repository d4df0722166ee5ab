/// Structure file with its meshes: blocks of nodes, supports and outputs.
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

/// Called with the next step of long work.
using Progress = std::function<void(std::string_view)>;

struct Structure {
  Mesh mesh;
  std::vector<Material> material_of_part;
  Reduction reduction;            ///< of the displacements
  std::vector<Coupling> springs;  ///< to the ground and between parts
  std::vector<std::string> block_names;
  std::vector<Index> block_of_node;
  /// The outputs in order, then one row per position for each output of each guideway.
  std::vector<Functional> rows;
};

/// Reads the meshes and applies the file's sections to them.
/// @throws ConfigurationError with all problems of a kind at once: unreadable meshes, inverted
///         elements; regions without nodes or faces, blocks without nodes, nodes without a block,
///         points outside their part; unsupported bodies
[[nodiscard]] Structure build_structure(const StructureSpec& spec, const Progress& progress);

/// Model from block temperatures to displacements: sensitivities summed over each block's nodes.
/// @param sensitivities_m_per_K  shape (rows)(nodes), see Statics::sensitivities()
/// Source: JP6507619B2, {delta_part} = [P1_part]{T_block}.
[[nodiscard]] ThermalModel block_model(
    const StructureSpec& spec, const Structure& structure,
    const std::vector<std::vector<double>>& sensitivities_m_per_K);

/// Report of size, contribution of each block, conditioning.
/// @param all  also rows along the guideways, nodes of each block and singular values
[[nodiscard]] std::string structure_report(const Structure& structure, const Statics& statics,
                                           const ThermalModel& model, bool all = false);

}  // namespace thermocomp::structure
