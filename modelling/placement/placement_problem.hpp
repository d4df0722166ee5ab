/// Data for judging a sensor placement: sensitivities of the outputs, temperature fields of the
/// load cases, and possible places in each block.
#pragma once

#include <string>
#include <vector>

#include "modelling/structure/heat_model.hpp"
#include "modelling/structure/solve/statics.hpp"
#include "modelling/structure/structure_model.hpp"

namespace thermocomp::placement {

using structure::Index;
using structure::length;
using structure::Vec3;
using structure::operator+;
using structure::operator-;
using structure::operator*;
using Numbers = std::vector<double>;

/// Displacement of an output; on a guideway, at positions along the axis.
struct Curve {
  std::string name;
  std::size_t first_row{0};
  std::vector<double> at;  ///< -1..1 along the guideway; {0} without one
};

struct Field {
  std::size_t load_case{0};
  double time_s{0.0};
  Numbers rise_K;           ///< theta1, shape (nodes)
  Numbers displacement_um;  ///< delta1 = S theta1, shape (rows)
};

struct BlockOfSensors {
  std::string name;
  std::vector<Index> nodes;
  std::vector<Index> candidates;  ///< possible nodes of a sensor
  double from_support_m{0.0};     ///< distance of the block's centre from that of the supports
};

/// Blocks whose rises are changed together in the method of tendency patterns.
struct Pattern {
  std::string name;
  std::vector<bool> blocks;    ///< shape (blocks)
  Numbers percents;            ///< values of r to try
  bool shrinks_as_one{false};  ///< at a bound all blocks get a smaller r; else each is clamped
};

struct LoadCase {
  std::string name;
  bool left_out{false};
};

struct PlacementProblem {
  std::vector<BlockOfSensors> blocks;
  std::vector<Pattern> patterns;  ///< of the structure file; empty: derived
  std::vector<LoadCase> load_cases;
  std::vector<Vec3> nodes_m;
  std::vector<Curve> curves;
  Numbers row_weight;                    ///< sum 1 over each curve's rows; shape (rows)
  std::vector<Numbers> sensitivity_um;   ///< S, shape (rows)(nodes) [um/K]
  std::vector<Numbers> block_matrix_um;  ///< P1, shape (rows)(blocks) [um/K]
  std::vector<Field> used;               ///< of the load cases used for the placement
  std::vector<Field> left_out;

  [[nodiscard]] std::size_t rows() const noexcept { return row_weight.size(); }
};

/// @throws ConfigurationError: no load case to use, blocks without a possible place
[[nodiscard]] PlacementProblem make_problem(const structure::StructureSpec& spec,
                                            const structure::Structure& structure,
                                            const structure::Statics& statics,
                                            std::vector<structure::RiseField> fields);

/// P1 theta. @param rise_K  shape (blocks). @return shape (rows) [um]
[[nodiscard]] Numbers block_displacement_um(const PlacementProblem& problem, const Numbers& rise_K);

/// Root of the weighted mean square over rows; a curve has the weight of a single output.
[[nodiscard]] double rms_um(const PlacementProblem& problem, const Numbers& rows_um);

[[nodiscard]] Numbers block_means_K(const PlacementProblem& problem, const Numbers& rise_K);

struct ErrorFigures {
  double rms_um{0.0};
  double peak_um{0.0};
};
/// @param estimates_um  shape (fields)(rows)
[[nodiscard]] ErrorFigures errors_of(const PlacementProblem& problem,
                                     const std::vector<Field>& fields,
                                     const std::vector<Numbers>& estimates_um);
/// Displacements by P1 from the readings of one sensor per block.
/// @param sensors  one node per block
[[nodiscard]] std::vector<Numbers> estimates_um(const PlacementProblem& problem,
                                                const std::vector<Field>& fields,
                                                const std::vector<Index>& sensors);

}  // namespace thermocomp::placement
