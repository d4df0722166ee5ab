/// The diagnosis for the owner of the machine: one HTML page that needs nothing but itself.
#pragma once

#include <string>

#include "modelling/diagnosis/report/report_data.hpp"

namespace thermocomp::diagnosis {

/// What was found, what to do about it, how far the model could get, and the courses as pictures.
[[nodiscard]] std::string report_html(const Diagnosis& diagnosis, const ReportData& report);

}  // namespace thermocomp::diagnosis
