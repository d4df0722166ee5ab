/// Reads the simulator's machine file (strict TOML); reference: config/examples/machine.toml.
#pragma once

#include <filesystem>
#include <string>

#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

/// @throws ConfigurationError with every problem: file, line, key, value, rule
[[nodiscard]] MachineConfig load_machine(const std::filesystem::path& path);
/// @param name  file name for problems
[[nodiscard]] MachineConfig parse_machine(std::string text, std::string name);

}  // namespace thermocomp
