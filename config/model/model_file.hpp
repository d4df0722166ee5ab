/// The model file: TOML, `format = 1`; shapes and names are checked against each other. For its
/// tables see the example config/examples/small_machine_model.toml.
#pragma once

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "config/text/problems.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] ThermalModel load_model(const std::filesystem::path& path);
/// @param name  file name in problems
[[nodiscard]] ThermalModel parse_model(const std::string& text, const std::string& name);

/// The readable part and the problems. Never throws. With problems the model only serves further
/// checks: `inputs` and `outputs` hold the given names.
struct ModelReading {
  ThermalModel model;
  std::vector<Problem> problems;
  bool names_known{false};  ///< inputs and outputs are lists of names
};
[[nodiscard]] ModelReading read_model_text(const std::string& text, const std::string& name);

/// Approximate number of multiplications per evaluation of the model, hence per cycle.
[[nodiscard]] double model_operations(const ThermalModel& model);

/// The model as a file: parse_model(write_model(m)) equals m, every number bit for bit.
/// @pre the model is valid
[[nodiscard]] std::string write_model(const ThermalModel& model);

/// The `[covariance]` table only. @pre the model has a covariance
[[nodiscard]] std::string write_covariance(const ThermalModel& model);

/// SHA-256 of the bytes, 64 hexadecimal digits in lower case.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace thermocomp
