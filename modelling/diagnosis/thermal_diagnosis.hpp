/// Diagnosis of a machine file's thermal network by measured temperatures.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/network/heat_network.hpp"
#include "modelling/diagnosis/network/network_simulation.hpp"

namespace thermocomp::diagnosis {

struct ReportData;

/// Receives the test runs, the network of the file and the network with the findings.
using NetworkView = std::function<void(const ThermalRuns&, const HeatNetwork&, const HeatNetwork&)>;

/// Diagnosis of a thermal network, or of a finite-element model reduced to one, by temperatures in
/// kelvin.
/// @return figures of every sensor in the training runs; `extended` is empty, since the findings'
///         parameters hold the corrected values
/// @param view  if given, called at the end
/// @throws ConfigurationError when a run lacks the room, a signal of the network or every sensor
[[nodiscard]] Diagnosis diagnose_thermal(const ThermalPlant& plant,
                                         const std::vector<RunFile>& train,
                                         const std::vector<RunFile>& test,
                                         ReportData* report = nullptr,
                                         const std::function<void()>& progress = nullptr,
                                         const NetworkView& view = nullptr);

/// Multiplies films, conductances, capacities and heats by their factors, and adds missing sources
/// and lags of thermocouples. Findings without a key become comments at the top; comments of the
/// file are lost. A signal used only by a missing source is added with the constant value 0.
/// @param path  a machine file that load_thermal_plant() accepts
/// @return the file's text; none for a body, whose matrices are not edited
/// @throws toml::parse_error if the file has become unreadable
[[nodiscard]] std::optional<std::string> corrected_machine(
    const std::filesystem::path& path, const std::vector<NamedFinding>& findings);

}  // namespace thermocomp::diagnosis
