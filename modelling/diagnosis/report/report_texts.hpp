/// What a finding says to the machine's owner, what to do about it, and which experiment would tell
/// it from another cause.
#pragma once

#include <string>

#include "modelling/diagnosis/answer/answer.hpp"

namespace thermocomp::diagnosis {

/// What was found, in a few words, and where.
[[nodiscard]] std::string title_of(const NamedFinding& finding);
[[nodiscard]] std::string title_of(const Alternative& other);
/// One or two sentences with the finding's own figures.
[[nodiscard]] std::string sentence_of(const NamedFinding& finding);
[[nodiscard]] std::string what_to_do(const NamedFinding& finding);
/// The experiment that tells one explanation from another.
[[nodiscard]] std::string experiment_between(const Alternative& one, const Alternative& other);

}  // namespace thermocomp::diagnosis
