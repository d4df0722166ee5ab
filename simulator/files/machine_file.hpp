/// The machine file of the simulator: TOML, strict; config/examples/machine.toml is its reference.
#pragma once

#include <filesystem>
#include <string>

#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

/// @throws ConfigurationError with every problem, by file, line, key, value and rule
[[nodiscard]] MachineConfig load_machine(const std::filesystem::path& path);
/// @param name stands for the file in problems
[[nodiscard]] MachineConfig parse_machine(std::string text, std::string name);

}  // namespace thermocomp
