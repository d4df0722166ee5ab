/// What `thermocomp init` finds out on the buses, with the reads of `thermocomp scan`.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/init/init_ask.hpp"
#include "cli/init/init_draft.hpp"
#include "cli/scan/scan_report.hpp"

namespace thermocomp::cli {

/// A line for each preset for Modbus that a configuration in this folder may use: name, maker and
/// model; of them those that have this word.
[[nodiscard]] std::vector<std::string> preset_lines(const std::filesystem::path& folder,
                                                    const std::string& word);

/// Reads everything that the draft describes: every channel, and the controller's side.
/// @throws ConfigurationError, Failure
[[nodiscard]] ScanReport probe(const InitDraft& draft, const std::filesystem::path& folder);

/// Whether the daemon would take the draft as it is. @throws Failure with every problem
void check_draft(const InitDraft& draft, const std::filesystem::path& folder);

/// Fills in the channels of the module's preset where it has none, and takes those away that give
/// no temperature.
/// @return what was read, a line a channel. @throws Failure
std::vector<std::string> try_module(const InitDraft& draft, InitModule& module,
                                    const std::filesystem::path& folder);

[[nodiscard]] InitEyes eyes_of(const std::filesystem::path& folder);

}  // namespace thermocomp::cli
