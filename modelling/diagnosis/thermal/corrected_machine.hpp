/// The machine file with the values that a thermal diagnosis found.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "modelling/diagnosis/answer/answer.hpp"

namespace thermocomp::diagnosis {

/// Films, conductances, capacities and heats are multiplied by their factor, missing sources and
/// lags of thermocouples are added; what no key carries stands in comments at the top. Comments of
/// the file are not kept. A signal that only a missing source needs is added, constantly 0.
/// @param path  a machine file that load_thermal_plant() accepts
/// @return the file's text; nothing where the machine is a body, whose matrices are not edited
/// @throws toml::parse_error when the file has become unreadable since
[[nodiscard]] std::optional<std::string> corrected_machine(
    const std::filesystem::path& path, const std::vector<NamedFinding>& findings);

}  // namespace thermocomp::diagnosis
