/// What a placement of sensors is judged on: sensitivities of the outputs, temperature fields of
/// the load cases, and where in each block a sensor can stand.
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

/// An output, or one that a guideway carries: its displacement at positions along the axis.
struct Curve {
  std::string name;
  std::size_t first_row{0};
  std::vector<double> at;  ///< -1..1 along the guideway; {0} where there is none
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
  std::vector<Index> candidates;  ///< where a sensor can stand
  double from_support_m{0.0};     ///< from the block's middle to the middle of what is held
};

/// Blocks whose rise is changed together in the method of tendency patterns.
struct Pattern {
  std::string name;
  std::vector<bool> blocks;    ///< shape (blocks)
  Numbers percents;            ///< r, each tried
  bool shrinks_as_one{false};  ///< all blocks get one smaller r at a bound; else cut each
};

struct LoadCase {
  std::string name;
  bool left_out{false};
};

struct PlacementProblem {
  std::vector<BlockOfSensors> blocks;
  std::vector<Pattern> patterns;  ///< of the structure file; none: derived ones
  std::vector<LoadCase> load_cases;
  std::vector<Vec3> nodes_m;
  std::vector<Curve> curves;
  Numbers row_weight;                    ///< a curve's rows together weigh 1; shape (rows)
  std::vector<Numbers> sensitivity_um;   ///< S, shape (rows)(nodes) [um/K]
  std::vector<Numbers> block_matrix_um;  ///< P1, shape (rows)(blocks) [um/K]
  std::vector<Field> used;               ///< of the load cases that the placement serves
  std::vector<Field> left_out;

  [[nodiscard]] std::size_t rows() const noexcept { return row_weight.size(); }
};

/// @throws ConfigurationError: no load case to use, blocks without a place for a sensor
[[nodiscard]] PlacementProblem make_problem(const structure::StructureSpec& spec,
                                            const structure::Structure& structure,
                                            const structure::Statics& statics,
                                            std::vector<structure::RiseField> fields);

/// P1 theta. @param rise_K  shape (blocks). @return shape (rows) [um]
[[nodiscard]] Numbers block_displacement_um(const PlacementProblem& problem, const Numbers& rise_K);

/// sqrt of the weighted mean of squares over rows; the same for a curve and a single output.
[[nodiscard]] double rms_um(const PlacementProblem& problem, const Numbers& rows_um);

/// The mean of a block's nodes in a field.
[[nodiscard]] Numbers block_means_K(const PlacementProblem& problem, const Numbers& rise_K);

/// Error of the estimated displacement over fields.
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
