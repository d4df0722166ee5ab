/// Temperatures of the model's columns from readings, and the reference of their rise.
#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/sensing/block_bank.hpp"
#include "estimator/sensing/lost_blocks.hpp"
#include "estimator/sensing/suspicion.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// Temperatures: the model file's numbers, else each column's first good value. Signals: zero with
/// such numbers, which mean a machine at rest; a sampled reference defines zero displacement in the
/// present state, so its signals are those of that moment.
///
/// A first good value is provisional for `young`: if a jump of its sensor begins in that time and
/// is confirmed, the value was wrong and the column's reference is taken anew. (Waiting for a
/// steady machine instead would leave one that is started warm without compensation.)
class Reference {
 public:
  static constexpr nanoseconds young = std::chrono::minutes(10);

  explicit Reference(const ThermalModel& model);

  /// Takes references that are missing and measured now.
  [[nodiscard]] ReferenceState step(nanoseconds now, const Temperatures& temps,
                                    const Signals& signals) noexcept;
  /// Displacement is zero now. The signals are taken at the next step.
  /// @pre all temperatures are good
  void take(std::span<const double> temps_degC) noexcept;

  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return temps_degC_; }
  [[nodiscard]] std::span<const double> signals() const noexcept { return signals_; }

  /// Before the first step, by name; missing or non-finite values change nothing.
  void restore(const std::map<std::string, double>& temps_degC,
               const std::map<std::string, double>& signals);
  /// After a reload, with plans of plan_names(). New numbers in the model file are deliberate and
  /// replace the reference; otherwise it stays.
  void adopt(const Reference& previous, const std::vector<int>& columns,
             const std::vector<int>& signals) noexcept;
  /// Takes missing references from an estimator with the same model.
  void complete(const Reference& same) noexcept;
  void visit_temperatures(StateArchive& archive) { archive(temps_degC_, sampled_at_); }
  void visit_signals(StateArchive& archive) { archive(signals_); }

 private:
  const std::vector<double> of_model_file_;  ///< one per input, or empty
  const std::vector<std::string> columns_;
  const std::vector<std::string> signal_names_;

  std::vector<double> temps_degC_;
  std::vector<nanoseconds> sampled_at_;  ///< one per column; min(): not a first value
  std::vector<double> signals_;
};

/// Screening and smoothing per sensor, blocks, and estimates of blocks without a good sensor.
class Sensing {
 public:
  /// @throws InvalidValue when a column has no block or a block no sensor
  Sensing(const EstimatorConfig& config, const ThermalModel& model);

  /// @param readings  one per sensor, order of the configuration (checked)
  [[nodiscard]] Temperatures step(nanoseconds now, std::span<const Reading> readings) noexcept;

  /// Uses the excluded sensors after all, since their estimates are too uncertain.
  /// @return the temperatures of this step, computed again
  [[nodiscard]] Temperatures use_all(nanoseconds now) noexcept;
  void accept(std::size_t sensor) noexcept;
  /// A new reference: the present readings are right, and suspicions end.
  void end_suspicions() noexcept;

  void report(std::span<SensorReport> sensors) const noexcept;
  [[nodiscard]] const BlockBank& blocks() const noexcept { return blocks_; }
  [[nodiscard]] const LostBlocks& lost() const noexcept { return lost_; }
  [[nodiscard]] bool all_good() const noexcept;

  /// Before the first step: temperatures at the end of the previous run, by column, and the values
  /// of sensors before an unconfirmed jump.
  void restore(const std::map<std::string, double>& temps_degC,
               const std::map<std::string, double>& jumped_from_degC);
  void plan_adoption(const Sensing& previous);
  void adopt(const Sensing& previous) noexcept;
  void visit_state(StateArchive& archive) {
    archive(blocks_, lost_);
    if (suspicion_) archive(*suspicion_);
  }

 private:
  void weigh_waiting() noexcept;
  [[nodiscard]] std::span<const std::uint8_t> suspect(nanoseconds now) noexcept;
  [[nodiscard]] Temperatures join(nanoseconds now, std::span<const std::uint8_t> left_out) noexcept;

  const std::vector<std::string> columns_;
  BlockBank blocks_;
  LostBlocks lost_;
  std::optional<Suspicion> suspicion_;
  std::vector<double> screened_K_;     ///< scratch, one per sensor
  std::vector<double> expected_degC_;  ///< scratch, one per column
  std::vector<double> expected_sd_K_;  ///< scratch, one per column
};

}  // namespace thermocomp
