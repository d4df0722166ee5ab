/// The daemon's answers as a person reads them. Pure: JSON in, text out.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// `thermocomp status`: aligned `Key : value` lines. @param status  result of the method `status`
[[nodiscard]] std::string status_text(const nlohmann::json& status, bool colours);

/// `thermocomp sensors`: a line a sensor. @param sensors  result of the method `sensors`
[[nodiscard]] std::string sensors_text(const nlohmann::json& sensors, bool colours);

/// Why `status` exits with 1, one line each; empty: it exits with 0.
/// @param strict  also what does not stop the compensation: a bound reached, a read-back that
///                disagrees, a lost sensor or unit, an outside domain, a history that is not
///                written
[[nodiscard]] std::vector<std::string> why_not(const nlohmann::json& status, bool strict);

}  // namespace thermocomp::cli
