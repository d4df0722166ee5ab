/// A finding as it is told: names, alternatives, evidence.
#pragma once

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

}  // namespace thermocomp::diagnosis
