/// The model file: TOML, `format = 1`; shapes and names are checked against each other. Its tables
/// are described by the commented example config/examples/small_machine_model.toml.
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
/// @param name stands for the file in problems
[[nodiscard]] ThermalModel parse_model(const std::string& text, const std::string& name);

/// What could be read, and what is wrong with it. Never throws. With problems the model is good
/// only for further checks: `inputs` and `outputs` hold the names that stand there.
struct ModelReading {
  ThermalModel model;
  std::vector<Problem> problems;
  bool names_known{false};  ///< inputs and outputs were lists of names
};
[[nodiscard]] ModelReading read_model_text(const std::string& text, const std::string& name);

/// Multiplications of one evaluation of the model, roughly: what it costs in each step of a cycle.
[[nodiscard]] double model_operations(const ThermalModel& model);

/// The model as a file: parse_model(write_model(m)) is m, every number bit for bit.
/// @pre the model keeps the rules of the file
[[nodiscard]] std::string write_model(const ThermalModel& model);

/// Its `[covariance]` table alone. @pre the model has a covariance
[[nodiscard]] std::string write_covariance(const ThermalModel& model);

/// SHA-256 of the bytes, 64 hexadecimal digits in small letters.
[[nodiscard]] std::string sha256_hex(std::string_view bytes);

}  // namespace thermocomp
