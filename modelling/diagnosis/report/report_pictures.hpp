/// The pictures of the report: what was measured beside what the models say, and what moved it.
#pragma once

#include <string>

#include "modelling/diagnosis/report/report_data.hpp"

namespace thermocomp::diagnosis {

/// One output of a run: measured, model and extended model; under it what they leave, the operating
/// signals and the temperatures, over one axis of time.
[[nodiscard]] std::string course_picture(const ReportRun& run, const ReportData& report,
                                         std::size_t output, const std::string& unit);
/// What the model leaves over the temperatures that it goes with most.
[[nodiscard]] std::string scatter_pictures(const ReportRun& run, const ReportData& report,
                                           std::size_t output);
/// A bar an output: what the model's error is made of. Empty where that is not known.
[[nodiscard]] std::string headroom_picture(const Diagnosis& diagnosis);

}  // namespace thermocomp::diagnosis
