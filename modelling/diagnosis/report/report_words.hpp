/// Numbers and parameters as a person reads them.
#pragma once

#include <string>

#include "modelling/diagnosis/answer/answer.hpp"

namespace thermocomp::diagnosis {

/// Two digits, three where the first is a 1: "53", "0.0040", "1810".
[[nodiscard]] std::string figure(double value);
/// In s, min or h: "40 s", "53 min", "2.5 h".
[[nodiscard]] std::string duration(double seconds);
/// "z_um": "z"; "um" where a name has no more.
[[nodiscard]] std::string name_of_column(const std::string& column);
/// "time constant 53 min (51 to 55 min)"; of several outputs one after the other. What the values
/// are per is the subject's unit.
[[nodiscard]] std::string parameter_words(const std::string& cause, const Parameter& parameter,
                                          const std::string& subject);

}  // namespace thermocomp::diagnosis
