/// Diagnosis of measured runs; `thermocomp diagnose`.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/answer/answer.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp::diagnosis {

struct ReportData;

/// @param train, test  by value: their memory is released before the search
/// @param train_names, test_names  the runs' arguments as given
/// @param report    if given, receives the data of the report
/// @param progress  if given, called during the search
/// @throws ConfigurationError when a run lacks a column of the model or any measured value
[[nodiscard]] Diagnosis diagnose(const ThermalModel& model, std::vector<RunFile> train,
                                 const std::vector<std::string>& train_names,
                                 std::vector<RunFile> test,
                                 const std::vector<std::string>& test_names,
                                 ReportData* report = nullptr,
                                 const std::function<void()>& progress = nullptr);

/// @param action  set when the command line asks for this command; returns the exit status
void add_diagnose_command(CLI::App& app, std::function<int()>& action);

}  // namespace thermocomp::diagnosis
