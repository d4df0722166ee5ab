/// From measured runs to an answer.
#pragma once

#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/answer/answer.hpp"

namespace thermocomp::diagnosis {

struct ReportData;

/// @param train, test  taken: their memory is free for the search
/// @param train_names, test_names  the runs' arguments as given
/// @param report  if given, receives what the report shows
/// @throws ConfigurationError when a run lacks a column of the model or any measured value
[[nodiscard]] Diagnosis diagnose(const ThermalModel& model, std::vector<RunFile> train,
                                 const std::vector<std::string>& train_names,
                                 std::vector<RunFile> test,
                                 const std::vector<std::string>& test_names,
                                 ReportData* report = nullptr);

}  // namespace thermocomp::diagnosis
