/// The daemon's answers as a person reads them. Pure: JSON in, text out.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

namespace thermocomp::cli {

/// Whether offsets reach the machine now: mode "compensating", and every axis driven.
[[nodiscard]] bool is_compensating(const nlohmann::json& status);

/// `thermocomp status`: aligned `Key : value` lines. @param status  result of the method `status`
[[nodiscard]] std::string status_text(const nlohmann::json& status, bool colours);

/// `thermocomp sensors`: a line a sensor. @param sensors  result of the method `sensors`
[[nodiscard]] std::string sensors_text(const nlohmann::json& sensors, bool colours);

/// A duration for people: "7 s", "12 min 5 s", "3 h 20 min", "5 d 2 h"; "-" for NaN.
[[nodiscard]] std::string duration_text(double seconds);

}  // namespace thermocomp::cli
