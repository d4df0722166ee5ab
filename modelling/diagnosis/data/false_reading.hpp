/// What the model makes of a false reading.
#pragma once

#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/data/panel.hpp"

namespace thermocomp::diagnosis {

/// The displacement that the model predicts too much of an output because an input reads too high,
/// f(T + e) - f(T) for each column e of errors [K] over all rows of the run, f being the
/// estimator's own arithmetic with the terms that name the input: matrix, guideways, lags, banks of
/// lags. A play of the whole output is left out. Where a term is not linear in the reading (its
/// square, a play), the answer to a multiple of e is only nearly that multiple.
/// @param errors_K  shape (rows, m)
/// @return displacement [um], the same shape
[[nodiscard]] Panel answer_to_errors(const MeasuredData& data, const MeasuredRun& run,
                                     std::size_t output, std::size_t input, Panel errors_K);

/// The same of an input that has read 1 K too high since long before the first run [um/K].
/// @pre the model has no guideways
[[nodiscard]] double settled_um_per_K(const MeasuredData& data, std::size_t output,
                                      std::size_t input);

}  // namespace thermocomp::diagnosis
