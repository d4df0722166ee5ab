/// From measured runs to an answer; `thermocomp diagnose`.
#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/answer/answer.hpp"
#include "modelling/diagnosis/network/heat_network.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::diagnosis {

struct ReportData;
struct ThermalRuns;

/// Receives the test runs, the network as the file has it and the network with what was found.
using NetworkView = std::function<void(const ThermalRuns&, const HeatNetwork&, const HeatNetwork&)>;

/// @param train, test  taken: their memory is free for the search
/// @param train_names, test_names  the runs' arguments as given
/// @param report    if given, receives what the report shows
/// @param progress  if given, called while the search goes on
/// @throws ConfigurationError when a run lacks a column of the model or any measured value
[[nodiscard]] Diagnosis diagnose(const ThermalModel& model, std::vector<RunFile> train,
                                 const std::vector<std::string>& train_names,
                                 std::vector<RunFile> test,
                                 const std::vector<std::string>& test_names,
                                 ReportData* report = nullptr,
                                 const std::function<void()>& progress = nullptr);

/// The same of a thermal network, or a finite-element model reduced to one: temperatures are
/// compared, in kelvin.
/// @return figures of every sensor that the training runs have; `extended` is empty, since the
///         corrected values stand in the findings' parameters
/// @param view  if given, called at the end
/// @throws ConfigurationError when a run lacks the room, a signal of the network or every sensor
[[nodiscard]] Diagnosis diagnose_thermal(
    const ThermalPlant& plant, const std::vector<RunFile>& train,
    const std::vector<std::string>& train_names, const std::vector<RunFile>& test,
    const std::vector<std::string>& test_names, ReportData* report = nullptr,
    const std::function<void()>& progress = nullptr, const NetworkView& view = nullptr);

/// Films, conductances, capacities and heats are multiplied by their factor, missing sources and
/// lags of thermocouples are added; what no key carries stands in comments at the top. Comments of
/// the file are not kept. A signal that only a missing source needs is added, constantly 0.
/// @param path  a machine file that load_thermal_plant() accepts
/// @return the file's text; nothing where the machine is a body, whose matrices are not edited
/// @throws toml::parse_error when the file has become unreadable since
[[nodiscard]] std::optional<std::string> corrected_machine(
    const std::filesystem::path& path, const std::vector<NamedFinding>& findings);

/// @param action  set when the command line asks for this command; returns the exit status
void add_diagnose_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::diagnosis
