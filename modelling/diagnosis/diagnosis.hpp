/// Diagnosis of measured runs.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/answer/answer.hpp"

namespace thermocomp::diagnosis {

struct ReportData;

/// @param train, test  by value: their memory is released before the search
/// @param report    if given, receives the data of the report
/// @param progress  if given, called during the search
/// @throws ConfigurationError when a run lacks a column of the model or any measured value
[[nodiscard]] Diagnosis diagnose(const ThermalModel& model, std::vector<RunFile> train,
                                 std::vector<RunFile> test, ReportData* report = nullptr,
                                 const std::function<void()>& progress = nullptr);

}  // namespace thermocomp::diagnosis
