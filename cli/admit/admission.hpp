/// Whether an offered model may run beside the one in use: what this computer alone can check.
#pragma once

#include <cstddef>
#include <string>

#include "config/daemon/daemon_config.hpp"
#include "config/runs/run_file.hpp"

namespace thermocomp::cli {

struct AdmissionRules {
  std::size_t probings_min{3};  ///< of an output, from which on they decide
};

/// Both models over the machine's own last days. An output that was probed often enough decides by
/// the remainder r = standard deviation of (measured - predicted) at the probings: with s the
/// smaller of the errors that the two models state (left_out_rms_um; 0 where neither states any),
///
///     refused if  r_offered > sqrt(r_in_use^2 + s^2)
///
/// Another output is refused where the models differ by more than they can:
/// sd(predicted_offered - predicted_in_use) > 3 sqrt(s_offered^2 + s_in_use^2), or where neither
/// states an error.
/// @param config  with the offered model as its candidate
/// @return why it is refused; empty: it is not
/// @param found  what was compared, in one line
[[nodiscard]] std::string why_not_admitted(const DaemonConfig& config, const RunFile& days,
                                           const AdmissionRules& rules, std::string& found);

}  // namespace thermocomp::cli
