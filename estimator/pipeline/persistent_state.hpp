/// What of an estimator survives a restart, said once.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/report.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// What survives a restart by name (the state file).
struct PersistentState {
  bool enabled{true};
  std::map<std::string, double> reference_degC;  ///< by temperature column
  /// The numbers that the model file gave as reference at the time, by input; none: first sample.
  /// Other numbers in the file at a restart are deliberate, and replace the stored ones.
  std::map<std::string, double> model_reference_degC;
  std::map<std::string, double> reference_signals;  ///< operating signals then, by column
  std::map<std::string, double> offset_um;          ///< by axis, last sent
  /// By axis, of those whose offset sent stays so near to the one that is saved [um]: what they
  /// start from where nothing better is known.
  std::map<std::string, double> corridor_um;
  std::map<std::string, double> sign;         ///< by axis: what an offset meant
  std::string controller;                     ///< to which the offsets were sent; empty: not known
  std::map<std::string, double> recorded_um;  ///< by axis, of the last-sent record; in no file
  std::map<std::string, double> temp_degC;    ///< in use then, by temperature column
  /// By sensor that had jumped: what it showed before, so that a restart does not confirm the jump.
  std::map<std::string, double> jumped_from_degC;
  std::map<std::string, double> held_degC;     ///< InputReport::held_degC, by column
  std::map<std::string, double> held_signals;  ///< SignalReport::held, by column
  /// RunningCorrection::persistent(), "z.gain1" and so on.
  std::map<std::string, double> correction;
};

/// The numbers that a model file gives as reference, by input.
[[nodiscard]] std::map<std::string, double> reference_numbers(const ThermalModel& model);

/// See Estimator::persistent_state().
/// @param report  of the estimator with this configuration and model (sizes are checked)
[[nodiscard]] PersistentState make_persistent_state(const EstimatorConfig& config,
                                                    const ThermalModel& model,
                                                    const Report& report);

/// Whether something differs that must be written at once: switch, references, what was learned
/// and held, and an offset that has gone a quarter of the way that it may go from a saved one.
/// Other offsets and temperatures move all the time; they may wait.
[[nodiscard]] bool must_be_saved(const PersistentState& now, const PersistentState& saved);

/// What lets an estimator know that `saved` is on disk: one command an axis that stays beside it.
[[nodiscard]] std::vector<Command> saved_commands(const EstimatorConfig& config,
                                                  const PersistentState& saved);

}  // namespace thermocomp
