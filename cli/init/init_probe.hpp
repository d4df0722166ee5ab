/// Bus access of `thermocomp init`, with the reads of `thermocomp scan`.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/init/init_ask.hpp"
#include "cli/init/init_draft.hpp"
#include "cli/scan/scan_report.hpp"

namespace thermocomp::cli {

/// One line (name, maker, model) for each Modbus preset that a configuration in this folder may use
/// and that contains the word.
[[nodiscard]] std::vector<std::string> preset_lines(const std::filesystem::path& folder,
                                                    const std::string& word);

/// Reads every channel and controller value of the draft. @throws ConfigurationError, Failure
[[nodiscard]] ScanReport probe(const InitDraft& draft, const std::filesystem::path& folder);

/// Checks the draft as the daemon would. @throws Failure with every problem
void check_draft(const InitDraft& draft, const std::filesystem::path& folder);

/// Fills in the preset's channels if the module has none; removes those without a temperature.
/// @return one line for each channel. @throws Failure
std::vector<std::string> try_module(const InitDraft& draft, InitModule& module,
                                    const std::filesystem::path& folder);

[[nodiscard]] MachineQueries eyes_of(const std::filesystem::path& folder);

}  // namespace thermocomp::cli
