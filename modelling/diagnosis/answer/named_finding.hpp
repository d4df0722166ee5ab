/// A finding as it is told: names, parameters with intervals, alternatives, evidence; as a term of
/// the model file.
#pragma once

#include <optional>

#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/rank/search.hpp"

namespace thermocomp::diagnosis {

/// Of the RMS of left-out rows, of the output that gains most.
[[nodiscard]] double share_of_remainder(const Explanation& explanation);

/// Everything but the gain on test runs.
/// @param data  whose outputs and runs the finding is of
[[nodiscard]] NamedFinding named_finding(const Finding& finding, const MeasuredData& data,
                                         std::vector<Parameter> parameters);

/// "effect", "none" or "unexplained".
[[nodiscard]] std::string verdict_of(const SearchResult& result);

[[nodiscard]] std::vector<Parameter> parameters_of(const Finding& finding,
                                                   const MeasuredData& data);
/// @return the term that the daemon evaluates; nullopt for what it cannot: faults of one run, a
///         shift in time, a disturbance without an input
[[nodiscard]] std::optional<TermSpec> term_of(const Finding& finding, const MeasuredData& data);

}  // namespace thermocomp::diagnosis
