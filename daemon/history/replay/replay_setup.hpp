/// From the texts that the history keeps to what an estimator is built from.
#pragma once

#include <functional>

#include "daemon/history/reading/history_reader.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// What the estimator of a segment is built from.
struct ReplaySetup {
  EstimatorConfig estimator;
  ThermalModel model;
  bool dry_run{false};  ///< nothing was written to the controller
};
/// Texts -> configuration and model. The default parses them as the daemon does.
using SetupParser = std::function<ReplaySetup(const SegmentSetup&)>;
[[nodiscard]] ReplaySetup parse_setup(const SegmentSetup& setup);

}  // namespace thermocomp
