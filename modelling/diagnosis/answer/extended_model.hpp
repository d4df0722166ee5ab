/// Explanations as terms of the model file, and as parameters with intervals.
#pragma once

#include <optional>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/rank/search.hpp"

namespace thermocomp::diagnosis {

[[nodiscard]] std::vector<Parameter> parameters_of(const Finding& finding,
                                                   const MeasuredData& data);
/// @return the term that the daemon evaluates; nullopt for what it cannot: faults of one run, a
///         shift in time, a disturbance without an input
[[nodiscard]] std::optional<TermSpec> term_of(const Finding& finding, const MeasuredData& data);

}  // namespace thermocomp::diagnosis
