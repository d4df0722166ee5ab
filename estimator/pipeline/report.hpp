/// State after a step, for operators and the history; and the part of it that survives a restart.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "estimator/axes/mismatch.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/sensing/sensor.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct InputReport {  ///< a temperature column of the model
  double temp_degC{not_a_number};
  double reference_degC{not_a_number};
  bool good{false};
  bool estimated{false};           ///< lost, and temp_degC is an estimate from the others
  double sd_K{0.0};                ///< standard deviation of the estimate
  double held_degC{not_a_number};  ///< update = each_cycle: temperature that is compensated for
};

struct SignalReport {  ///< an operating signal or position of the model
  double value{not_a_number};
  double reference{not_a_number};  ///< at the reference
  double held{not_a_number};       ///< update = each_cycle; not for a position
};

struct AxisReport {
  /// Model output with the running correction, positive when the tool moves in the axis' positive
  /// direction relative to the work.
  double displacement_um{not_a_number};
  double target_um{0.0};             ///< of the offset
  double offset_um{0.0};             ///< sent
  double applied_um{not_a_number};   ///< read back
  double measured_um{not_a_number};  ///< last `measured` value
  bool synced{false};
  bool driven{false};  ///< true if the offset is marked valid
  StartEvidence start{StartEvidence::unknown};
  bool start_unknown{false};  ///< a link is up, but the last sent offset is unknown
  bool waits_for_disk{false};
  /// Largest distance of the offset from the one in the state file on disk; NaN: not limited.
  double corridor_um{not_a_number};
  bool disagrees{false};      ///< read-back and offset sent differ
  bool latched{false};        ///< the mismatch stays until an operator releases it
  bool releasing{false};      ///< released; the next read-backs decide
  Mismatch latched_mismatch;  ///< of the newest latch
  bool at_bound{false};
  bool proving{false};
  /// Standard deviation of the offset from estimated blocks; 0 where all are measured.
  double offset_sd_um{0.0};
  double held_um{not_a_number};  ///< update = each_cycle: displacement at the held state
  /// Claimed error of the model here, standard deviation [um]; NaN: none.
  double claimed_sd_um{not_a_number};
  /// RMS of probed displacement minus the model's, without the running correction; NaN: none yet.
  double probed_rms_um{not_a_number};
  std::uint64_t probings{0};  ///< number of measured displacements
  LastProbing last_probing;
  double entered_um{0.0};   ///< at the controller since the reference, as displacement
  double absorbed_um{0.0};  ///< part of it included in the correction
  CorrectionReport correction;
};

/// Distance from the model's domain.
struct DomainReport {
  bool known{false};  ///< the model has [made_from]
  bool outside{false};
  double distance{not_a_number};
  double outside_share_24h{0.0};
};

/// State after a step. Made once by Estimator::make_report(), then overwritten.
struct Report {
  std::uint64_t cycle{0};
  nanoseconds now{};
  Mode mode{Mode::starting};
  nanoseconds mode_since{};
  std::uint32_t reasons{0};
  bool enabled{true};  ///< the operator's switch
  std::uint64_t cycle_ends{0};
  std::vector<SensorReport> sensors;    ///< order of EstimatorConfig::sensors
  std::vector<InputReport> inputs;      ///< order of ThermalModel::temperature_columns()
  std::vector<SignalReport> signals;    ///< order of ThermalModel::signal_columns()
  std::vector<double> displacement_um;  ///< order of ThermalModel::outputs, since the reference
  std::vector<AxisReport> axes;
  double remembered_s{0.0};  ///< reach of the kept states of the axes, for parts measured later
  DomainReport domain;
};

/// State that survives a restart, by name (the state file).
struct PersistentState {
  bool enabled{true};
  std::map<std::string, double> reference_degC;  ///< by temperature column
  /// Reference in the model file at that time, by input; empty: first sample. Other numbers in the
  /// file at a restart are deliberate and replace the stored ones.
  std::map<std::string, double> model_reference_degC;
  std::map<std::string, double> reference_signals;  ///< at the reference, by column
  std::map<std::string, double> offset_um;          ///< by axis, last sent
  /// By axis with a corridor: largest distance of the sent offset from the saved one [um]. The
  /// saved one is the start if no better source is known.
  std::map<std::string, double> corridor_um;
  std::map<std::string, double> sign;  ///< by axis, at the time of the offset
  std::string controller;              ///< controller that the offsets were sent to; empty: unknown
  std::map<std::string, double> recorded_um;  ///< by axis, last-sent record; not in the file
  std::map<std::string, double> temp_degC;    ///< in use, by temperature column
  /// By sensor with a jump: its value before the jump, so that a restart does not confirm it.
  std::map<std::string, double> jumped_from_degC;
  std::map<std::string, double> held_degC;     ///< InputReport::held_degC, by column
  std::map<std::string, double> held_signals;  ///< SignalReport::held, by column
  /// RunningCorrection::persistent(), "z.gain1" and so on.
  std::map<std::string, double> correction;
};

/// Reference of a model file, by input.
[[nodiscard]] std::map<std::string, double> reference_numbers(const ThermalModel& model);

/// True if the difference must be written at once: switch, references, jumps, learned and held
/// values, and an offset that has used a quarter of its corridor. Other offsets and temperatures
/// change all the time and may wait.
[[nodiscard]] bool must_be_saved(const PersistentState& now, const PersistentState& saved);

/// Commands that report `saved` as written to disk: one per axis with a corridor.
[[nodiscard]] std::vector<Command> saved_commands(const EstimatorConfig& config,
                                                  const PersistentState& saved);

/// The state that survives a restart, from a report of the estimator with this configuration and
/// model (sizes are checked).
[[nodiscard]] PersistentState persistent_state(const EstimatorConfig& config,
                                               const ThermalModel& model, const Report& report);

}  // namespace thermocomp
