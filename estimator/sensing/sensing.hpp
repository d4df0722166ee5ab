/// Readings to the temperatures of the model's columns: the way through this folder.
#pragma once

#include <map>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/sensing/block_bank.hpp"
#include "estimator/sensing/lost_blocks.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Screening and smoothing a sensor, blocks, and an estimate for blocks that have no good sensor.
class Sensing {
 public:
  /// @throws InvalidValue when a column has no block or a block no sensor
  Sensing(const EstimatorConfig& config, const ThermalModel& model);

  /// @param readings  one a sensor, order of the configuration (checked)
  [[nodiscard]] Temperatures step(nanoseconds now, std::span<const Reading> readings) noexcept;

  [[nodiscard]] const BlockBank& blocks() const noexcept { return blocks_; }
  [[nodiscard]] const LostBlocks& lost() const noexcept { return lost_; }
  [[nodiscard]] bool all_good() const noexcept;

  /// Before the first step: temperatures at the end of the life before, by column.
  void restore(const std::map<std::string, double>& temps_degC);
  void plan_adoption(const Sensing& previous);
  void adopt(const Sensing& previous) noexcept;
  void visit_state(StateArchive& archive) { archive(blocks_, lost_); }

 private:
  const std::vector<std::string> columns_;
  BlockBank blocks_;
  LostBlocks lost_;
};

}  // namespace thermocomp
