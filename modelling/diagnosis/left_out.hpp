/// How well an explanation predicts rows that it was not fitted to.
#pragma once

#include "modelling/diagnosis/evidence.hpp"

namespace thermocomp::diagnosis {

/// Each block of rows is left out in turn; shape and gains come from the other blocks.
/// @return 1 - RMS with the explanation / RMS without, over all left-out rows of the outputs that
///         it acts on, each run's offset taken from the rows that stayed
[[nodiscard]] double gain_on_left_out_blocks(const Explanation& explanation,
                                             const StackedRows& rows,
                                             const std::vector<OutputEvidence>& outputs);

/// The same in the rows of the fit, for a fault that is located within one run.
[[nodiscard]] double gain_on_fitted_rows(const Explanation& explanation, const StackedRows& rows,
                                         const std::vector<OutputEvidence>& outputs);

}  // namespace thermocomp::diagnosis
