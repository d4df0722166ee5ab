/// Models of several kinds side by side, from nothing to a bank of lags, judged alike.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "modelling/identification/families/families_fit.hpp"

namespace thermocomp::identification {

/// One rule for none, static_few and lag_bank, on what is left out: whole runs; of one run
/// stretches and halves; of two or three runs stretches too. Out is what does worse than no model
/// anywhere it was judged; of the others the one that leaves least, of those alike to 1 % the
/// simplest; and no model unless one leaves a tenth less. lagged_few and physical are judged where
/// they are forced.
/// @param forced    instead of it
/// @param progress  is told the share of the work done
/// @throws std::runtime_error when the forced family has no answer
[[nodiscard]] FamiliesFit fit_families(const MeasuredTests& tests, const FitOptions& options,
                                       std::optional<Family> forced,
                                       const std::function<void(double)>& progress);

/// All families, and what the chosen one says of itself.
[[nodiscard]] std::string families_text(const MeasuredTests& tests, const FamiliesFit& fit);
/// One page with the table, curves of measured and left-out prediction, and the warnings.
[[nodiscard]] std::string families_html(const MeasuredTests& tests, const FamiliesFit& fit);
/// fit_json() where the chosen model is an equation of few sensors, with "families" and "family".
[[nodiscard]] std::string families_json(const MeasuredTests& tests, const FamiliesFit& fit);

}  // namespace thermocomp::identification
