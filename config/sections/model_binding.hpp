/// Whether the daemon's file and the model fit together.
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
/// is read from the controller, every axis' output exists, and the model has the covariance that
/// the configuration needs.
/// @param model_file  named where the model is what does not fit
void check_binding(const BindingTables& tables, const EstimatorConfig& config,
                   const ThermalModel& model, const std::string& model_file);

}  // namespace thermocomp::sections
