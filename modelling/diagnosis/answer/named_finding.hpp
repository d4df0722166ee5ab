/// A finding as it is told: names, alternatives, evidence.
#pragma once

#include "modelling/diagnosis/answer/answer.hpp"

namespace thermocomp::diagnosis {

/// Everything but the gain on test runs.
/// @param data  whose outputs and runs the finding is of
[[nodiscard]] NamedFinding named_finding(const Finding& finding, const MeasuredData& data,
                                         std::vector<Parameter> parameters);

/// "effect", "none" or "unexplained".
[[nodiscard]] std::string verdict_of(const SearchResult& result);

}  // namespace thermocomp::diagnosis
