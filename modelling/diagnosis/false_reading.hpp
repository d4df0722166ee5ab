/// What the model makes of a false reading.
#pragma once

#include "modelling/diagnosis/measured_runs.hpp"
#include "modelling/diagnosis/panel.hpp"

namespace thermocomp::diagnosis {

/// Whether terms of the model take the input besides its coefficient.
[[nodiscard]] bool has_terms_of(const ThermalModel& model, std::size_t input);

/// The displacement that the model predicts too much of an output because an input reads too high:
///
///   K e + sum of g (LP(e) - e) over the lags + sum of g LP(e) over what is added to the
///   coefficient
///
/// for each column e of errors [K] over all rows of the run; of terms those that are linear in the
/// reading alone.
/// @param errors_K  shape (rows, m); becomes displacement [um]
void answer_to_errors(const MeasuredData& data, const MeasuredRun& run, std::size_t output,
                      std::size_t input, Panel& errors_K);

/// The coefficients of all places that move like the input: single ones of a fit to such places
/// mean nothing, their sum does.
/// @param alike  by input, whether it moves like this one
[[nodiscard]] double coefficient_of_group(const ThermalModel& model, std::size_t output,
                                          const std::vector<bool>& alike);

}  // namespace thermocomp::diagnosis
