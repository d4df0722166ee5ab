/// What a finding says to the machine's owner, what to do about it, and which experiment would tell
/// it from another cause.
#pragma once

#include <string>

#include "modelling/diagnosis/diagnosis.hpp"

namespace thermocomp::diagnosis {

/// One or two sentences with the finding's own figures.
[[nodiscard]] std::string sentence_of(const NamedFinding& finding);
/// Whether no output gains by it on the test runs.
[[nodiscard]] bool fails_on_test_runs(const NamedFinding& finding);
[[nodiscard]] std::string what_to_do(const NamedFinding& finding);
/// The experiment that tells the finding from one of its alternatives.
[[nodiscard]] std::string experiment_for(const NamedFinding& finding, const Alternative& other);

}  // namespace thermocomp::diagnosis
