/// What an operator or the history may want to know after a step.
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
  bool good{false};                ///< measured
  bool estimated{false};           ///< lost, and temp_degC is an estimate from the others
  double sd_K{0.0};                ///< standard deviation of the estimate
  double held_degC{not_a_number};  ///< update = each_cycle: what is compensated by
};

struct SignalReport {  ///< an operating signal or position of the model
  double value{not_a_number};
  double reference{not_a_number};  ///< when the reference was taken
  double held{not_a_number};       ///< update = each_cycle; never of a position
};

struct AxisReport {
  /// Of the model's output with the running correction, positive when the tool moves in
  /// the axis' positive direction relative to the work.
  double displacement_um{not_a_number};
  double target_um{0.0};             ///< where the offset is heading
  double offset_um{0.0};             ///< sent
  double applied_um{not_a_number};   ///< read back
  double measured_um{not_a_number};  ///< last `measured` of the operator
  bool synced{false};
  bool driven{false};  ///< offset marked valid
  StartEvidence start{StartEvidence::unknown};
  bool start_unknown{false};  ///< a link is there, and nothing tells what was sent last
  bool waits_for_disk{false};
  /// How far the offset goes from the one in the state file that is on disk; NaN: no matter.
  double corridor_um{not_a_number};
  bool disagrees{false};      ///< read-back and offset sent differ
  bool latched{false};        ///< the mismatch stays until an operator releases it
  bool releasing{false};      ///< released, the read-backs are looked at
  Mismatch latched_mismatch;  ///< of the newest latch
  bool at_bound{false};
  bool proving{false};
  /// Standard deviation that estimated blocks give the offset; 0 where all are measured.
  double offset_sd_um{0.0};
  double held_um{not_a_number};  ///< update = each_cycle: displacement at the held state
  /// What the model says of itself here, standard deviation [um]; NaN: it says nothing.
  double claimed_sd_um{not_a_number};
  /// RMS of probed displacement minus the model's, without the running correction; NaN: none yet.
  double probed_rms_um{not_a_number};
  std::uint64_t probings{0};  ///< displacements that were measured
  double entered_um{0.0};   ///< by operators at the controller since the reference, as displacement
  double absorbed_um{0.0};  ///< the part of it that the correction has learned
  CorrectionReport correction;
};

/// Where the machine is beside what its model was made from.
struct DomainReport {
  bool known{false};  ///< the model says what it was made from
  bool outside{false};
  double distance{not_a_number};  ///< ModelDomain::distance()
  double outside_share_24h{0.0};  ///< of the last day
};

/// All that an operator or the history may want to know after a step. Made once by
/// Estimator::make_report(), then only overwritten.
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
  double remembered_s{0.0};  ///< how far back the axes are known, for parts measured later
  DomainReport domain;
};

struct Stages;
/// With room for all that `stages` have; allocates.
[[nodiscard]] Report sized_report(const Stages& stages);
/// Overwrites `out`, which was sized for these stages. No allocation.
void fill_report(const Stages& stages, Report& out) noexcept;

}  // namespace thermocomp
