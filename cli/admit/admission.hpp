/// Checks an offered model against the machine's own history before it runs as the candidate.
#pragma once

#include <cstddef>
#include <string>

#include "config/daemon/daemon_config.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

struct AdmissionRules {
  std::size_t probings_min{3};  ///< minimum number of probings for judging an output by them
};

/// Compares both models over the machine's last days. An output with enough probings is judged by
/// the remainder r = standard deviation of (measured - predicted) at the probings; s is the smaller
/// of the errors that the two models state (left_out_rms_um; 0 if neither states one):
///
///     refused if  r_offered > sqrt(r_in_use^2 + s^2)
///
/// Any other output is refused if neither model states an error, or if the models are too far
/// apart: sd(predicted_offered - predicted_in_use) > 3 sqrt(s_offered^2 + s_in_use^2).
/// @param config  with the offered model as its candidate
/// @param found  result of the comparison, one line
/// @return reason for refusal; empty: admitted
[[nodiscard]] std::string why_not_admitted(const DaemonConfig& config, const RunFile& days,
                                           const AdmissionRules& rules, std::string& found);

}  // namespace thermocomp::cli
