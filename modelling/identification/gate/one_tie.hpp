/// A single tie between two columns: best height and design curves.
#pragma once

#include <string>

#include "modelling/identification/gate/tied_columns.hpp"

namespace thermocomp::identification {

/// km / kc: stiffness of a column at the tie, divided by that of the tie.
/// @pre there is one tie
[[nodiscard]] double stiffness_ratio(const TiedColumns& columns);

/// Tie height from 0.2 l to 3 l with the smallest |Ki - Kc ratio|, ratio = theta_C / (theta_A -
/// theta_B).
struct BestHeight {
  double tie_height_mm{0.0};
  double displacement_um_per_K{0.0};  ///< Ki - Kc ratio there
};
/// @pre there is one tie
[[nodiscard]] BestHeight best_tie_height(const TiedColumns& columns, double ratio);

/// Ki and Kc over l / l4, relative to the published Ki without a tie and to alpha_c lc, for this
/// machine and for other tie stiffnesses (beta = 3 I lc / (Ac l^3) at one material).
/// @pre there is one tie
[[nodiscard]] std::string design_curves_svg(const TiedColumns& columns);

}  // namespace thermocomp::identification
