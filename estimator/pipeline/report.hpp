/// State after a step, for operators and the history.
#pragma once

#include <cstdint>
#include <vector>

#include "estimator/axes/read_back.hpp"
#include "estimator/learning/running_correction.hpp"
#include "estimator/pipeline/mode.hpp"
#include "estimator/sensing/screening.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct InputReport {  ///< a temperature column of the model
  double temp_degC{not_a_number};
  double reference_degC{not_a_number};
  bool good{false};
  bool estimated{false};           ///< lost, and temp_degC is an estimate from the others
  double sd_K{0.0};                ///< standard deviation of the estimate
  double held_degC{not_a_number};  ///< update = each_cycle: temperature compensated by
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
  bool driven{false};  ///< offset marked valid
  StartEvidence start{StartEvidence::unknown};
  bool start_unknown{false};  ///< a link is up, and the last sent offset is not known
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
  double entered_um{0.0};     ///< at the controller since the reference, as displacement
  double absorbed_um{0.0};    ///< part of it in the correction
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

struct Stages;
/// Sized for `stages`; allocates.
[[nodiscard]] Report sized_report(const Stages& stages);
/// Overwrites `out`, which was sized for these stages. No allocation.
void fill_report(const Stages& stages, Report& out) noexcept;

}  // namespace thermocomp
