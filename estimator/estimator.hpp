/// From readings to offsets, one cycle at a time: the part of the daemon that replay, the fault
/// simulation and the tools run too.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/mismatch.hpp"
#include "estimator/running_correction.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

enum class Mode : std::uint8_t {
  starting,  ///< not all inputs have had a value yet; offsets stay where they were
  disabled,  ///< by an operator or the controller's switch; offsets at or on the way to zero
  compensating,
  holding,         ///< data lost: offsets stay
  ramping_to_zero  ///< data lost for longer than hold_s and the policy says so
};
[[nodiscard]] std::string_view to_string(Mode mode) noexcept;

/// Why the estimator does not simply compensate; a set of bits.
enum class Reason : std::uint32_t {
  operator_disabled = 1u << 0,
  controller_disabled = 1u << 1,  ///< disable_signal is 1
  block_lost = 1u << 2,           ///< no good sensor left in a block the model needs
  signal_lost = 1u << 3,          ///< a position or operating signal the model needs is missing
  no_reference = 1u << 4,
  controller_offline = 1u << 5,
  not_synced = 1u << 6,  ///< what the controller applies is not known yet
  mismatch = 1u << 7,    ///< applied and sent differ
  cutting = 1u << 8,     ///< hold_while_cutting holds the offset
  at_bound = 1u << 9,
  applied_out_of_bound = 1u << 10,  ///< read-back beyond any bound of ours: axis is not driven
  block_estimated = 1u << 11,       ///< a warning: compensating, with an estimate for a lost block
  mismatch_latched =
      1u << 12,              ///< read-backs that nothing sent explains: not driven until released
  no_target = 1u << 13,      ///< the model's answer is no finite number
  outside_domain = 1u << 14  ///< the machine is where its model was never made or judged
};
inline constexpr std::size_t reasons_count = 15;
[[nodiscard]] std::string_view to_string(Reason reason) noexcept;

/// Of a set of reasons (Report::reasons), whether one is in it.
[[nodiscard]] constexpr bool has_reason(std::uint32_t reasons, Reason reason) noexcept {
  return (reasons & static_cast<std::uint32_t>(reason)) != 0;
}

struct SensorReport {
  double raw_degC{not_a_number};       ///< as the driver gave it
  double smoothed_degC{not_a_number};  ///< what the block gets; a difference where configured
  nanoseconds taken_at{};
  Fault fault{Fault::never_read};     ///< after screening
  std::uint32_t clipped_in_a_row{0};  ///< smoothing clipped so many values running
  std::uint64_t clipped{0};
  std::uint64_t rejected{0};  ///< readings refused by screening since the start
};

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
  /// Of the model's output with the running correction, positive as ARCHITECTURE says.
  double displacement_um{not_a_number};
  double target_um{0.0};             ///< where the offset is heading
  double offset_um{0.0};             ///< sent
  double applied_um{not_a_number};   ///< read back
  double measured_um{not_a_number};  ///< last `measured` of the operator
  bool synced{false};
  bool driven{false};  ///< offset marked valid
  bool mismatch{false};
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
  DomainReport domain;
};

/// What survives a restart by name (the state file).
struct PersistentState {
  bool enabled{true};
  std::map<std::string, double> reference_degC;  ///< by temperature column
  /// The numbers that the model file gave as reference at the time, by input; none: first sample.
  /// Other numbers in the file at a restart are meant, and take the place of the stored ones.
  std::map<std::string, double> model_reference_degC;
  std::map<std::string, double> reference_signals;  ///< operating signals then, by column
  std::map<std::string, double> offset_um;          ///< by axis, last sent
  std::map<std::string, double> temp_degC;          ///< in use then, by temperature column
  std::map<std::string, double> held_degC;          ///< InputReport::held_degC, by column
  std::map<std::string, double> held_signals;       ///< SignalReport::held, by column
  /// RunningCorrection::persistent(), "z.gain1" and so on.
  std::map<std::string, double> correction;
};

/// Pure: no clock, no I/O, no thread; no allocation after construction except where said.
class Estimator {
 public:
  /// @throws InvalidValue when configuration and model do not fit each other
  Estimator(const EstimatorConfig& config, const ThermalModel& model);
  ~Estimator();
  Estimator(Estimator&&) noexcept;
  Estimator& operator=(Estimator&&) noexcept;

  /// One cycle. `now` must not run backwards. Never throws, never allocates.
  /// @param readings  one a sensor, order of the configuration (checked)
  /// @param command   overwritten: offsets of all axes with the epoch they belong to
  void step(nanoseconds now, std::span<const Reading> readings, const ControllerState& controller,
            OffsetCommand& command) noexcept;
  /// An operator's command, taken between two steps. Never throws, never allocates.
  void apply(const Command& command) noexcept;

  [[nodiscard]] Report make_report() const;  ///< allocates; sizes are then fixed
  void report(Report& out) const noexcept;   ///< no allocation

  /// The exact inner state as bytes, for a replay from here. Only the same configuration and model
  /// (and build of the program) can load it.
  [[nodiscard]] std::size_t state_size_bytes() const noexcept;
  void save_state(
      std::span<std::byte> out) const noexcept;  ///< @pre out.size() == state_size_bytes()
  void load_state(
      std::span<const std::byte> in);  ///< @throws std::runtime_error on another size or layout

  /// The numbers of the model file's reference, as PersistentState keeps them.
  [[nodiscard]] std::map<std::string, double> model_reference_degC() const;
  /// Before the first step; allocates. A reference outside of what the sensors of its column may
  /// show (their screening) is not one that was ever taken: then no reference is, and the
  /// compensation is switched off, because the next one would be that of a machine in any state.
  /// @return what was refused, by key, value and rule; empty: nothing
  std::vector<std::string> restore(const PersistentState& state);
  /// Bumpless reload: takes over offsets, switches, references, smoothing and lag states by name.
  /// plan_adoption() allocates and may run on any thread while `previous` is not being replaced;
  /// adopt() neither allocates nor throws.
  void plan_adoption(const Estimator& previous);
  void adopt(const Estimator& previous) noexcept;

  [[nodiscard]] const EstimatorConfig& config() const noexcept;
  [[nodiscard]] const ThermalModel& model() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
