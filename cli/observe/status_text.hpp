/// Formats the daemon's answers for a terminal.
#pragma once

#include <string>

#include "status/status.hpp"

namespace thermocomp::cli {

/// `thermocomp status`: aligned `Key : value` lines.
[[nodiscard]] std::string status_text(const Status& status, bool colours);

/// "z leaves 1.8 of 3.1 um over 14 probings, better with 97 %".
[[nodiscard]] std::string score_text(const CandidateStatus& candidate);
/// The same after the file's name.
[[nodiscard]] std::string candidate_text(const CandidateStatus& candidate);

/// `thermocomp sensors`: one line per sensor.
[[nodiscard]] std::string sensors_text(const SensorsAnswer& answer, bool colours);

}  // namespace thermocomp::cli
