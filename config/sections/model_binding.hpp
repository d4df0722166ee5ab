/// Checks the daemon's file and the model against each other.
#pragma once

#include <string>
#include <vector>

#include "config/toml/toml_reader.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp::sections {

struct BindingTables {
  TomlTable root;
  std::vector<TomlTable> blocks;  ///< order of EstimatorConfig::blocks
  std::vector<TomlTable> axes;
};

/// Checks that every temperature column of the model has exactly one block, every signal it names
/// is read from the controller, every axis' output exists, and a required covariance is present.
/// @param model_file  file name in problems of the model
void check_binding(const BindingTables& tables, const EstimatorConfig& config,
                   const ThermalModel& model, const std::string& model_file);

}  // namespace thermocomp::sections
