/// The command line of `thermocomp-modelling`, the source of `--help`, manual page and completion.
#pragma once

#include <functional>

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp {

/// @param action  outlives the parsing, which sets it to the requested command; it returns the exit
/// status
void declare_modelling_command_line(CLI::App& app, std::function<int()>& action);

/// fit: sensors and equation from measured runs.
void add_fit_command(CLI::App& app, std::function<int()>& action);

namespace diagnosis {
/// diagnose: errors of a model in measured runs, and their causes.
void add_diagnose_command(CLI::App& app, std::function<int()>& action);
}  // namespace diagnosis
namespace experiments {
/// plan: tests from factors and levels.
void add_plan_command(CLI::App& app, std::function<int()>& action);
}  // namespace experiments
namespace identification {
/// group: places with similar temperature courses.
void add_group_command(CLI::App& app, std::function<int()>& action);
/// tiebar: coefficients of a gate-shaped machine with one or more ties, and the ties with the
/// smallest displacement range for measured temperatures.
void add_tiebar_command(CLI::App& app, std::function<int()>& action);
}  // namespace identification
namespace inspection {
/// inspect: faults of recordings, and identifiable effects.
void add_inspect_command(CLI::App& app, std::function<int()>& action);
}  // namespace inspection
namespace placement {
/// place: placement of sensors.
void add_place_command(CLI::App& app, std::function<int()>& action);
}  // namespace placement
namespace series {
/// series: model of a type from runs of its machines.
void add_series_command(CLI::App& app, std::function<int()>& action);
}  // namespace series
namespace structure {
/// structure: finite elements of a machine's structure.
void add_structure_command(CLI::App& app, std::function<int()>& action);
}  // namespace structure
namespace thermal_test {
/// thermal-test: plans and reports of tests to ISO 230-3.
void add_thermal_test_command(CLI::App& app, std::function<int()>& action);
}  // namespace thermal_test

}  // namespace thermocomp
