/// Invariants checked in every step, from values of the simulated machine and from reports, not
/// from the internal state of the code under test.
#pragma once

#include <array>
#include <deque>
#include <optional>
#include <span>
#include <string>
#include <type_traits>
#include <vector>

#include "../invariant_list.hpp"
#include "estimator/pipeline/estimator.hpp"
#include "machine.hpp"

namespace thermocomp::faults {

inline constexpr double tiny_um = 1e-9;

/// Largest difference between a register of 0.1 um resolution and its offset [um].
inline constexpr double register_rounding_um = 0.1;

struct Broken {
  std::string invariant;
  nanoseconds at{};
  std::string detail;
};

/// One cycle: inputs, command, report.
struct CycleSeen {
  nanoseconds now{};
  std::span<const Reading> readings;
  const ControllerState* reported{nullptr};  ///< as received by the estimator
  const OffsetCommand* command{nullptr};
  const Report* report{nullptr};
  const MachineShape* shape{nullptr};  ///< active configuration
};

/// Contributions of the correction's input groups to an axis's modelled displacement: first input,
/// then the two others.
[[nodiscard]] std::array<double, 2> contributions_um(const MachineShape& shape,
                                                     const Report& report, std::size_t axis);

class Invariants {
 public:
  static constexpr double recovery_s_max = 95.0;
  /// Error that screening allows after an outage of minutes (rate_allowance_K, outage_K_max and 10
  /// K/h); a reading with a larger one is used for at most false_s_max.
  static constexpr double false_K_max = 12.0;
  static constexpr double false_s_max = 20.0;

  Invariants(const MachineShape& shape, const FaultSchedule& schedule,
             const Thermocouples& thermocouples);

  /// @param leap_um  allowed difference between the first offset and the last one before
  void booted(nanoseconds now, double leap_um);
  /// When power failed, the disk did not yet hold that the controller had lost this axis's offset
  /// or that an operator had set it to zero: no restart can detect this.
  void lost(std::size_t axis) { is_lost_[axis] = true; }
  void reloaded(const MachineShape& shape);
  /// A probing of this axis reaches the estimator in the next cycle.
  void probed(std::size_t axis) { ++probings_[axis]; }
  /// The operator releases this axis in the next cycle.
  void released(std::size_t axis) { sent_[axis].released = true; }
  /// The operator takes a new reference in the next cycle.
  void referenced() { referenced_ = true; }
  /// @param columns  columns of the model, in the order of the report's inputs
  void restored(const PersistentState& saved, const Report& report,
                const std::vector<std::string>& columns, nanoseconds now);
  void check(const CycleSeen& seen, std::vector<Move>& moves, SimulatedController& controller);
  /// @param detail  a text, or a function that makes one and is called only on failure
  template <typename Detail>
  void demand(bool holds, invariants::Rule rule, nanoseconds at, const Detail& detail) {
    if (holds || broken_) return;
    if constexpr (std::is_invocable_v<Detail>)
      broken_ = Broken{std::string(rule.name()), at, detail()};
    else
      broken_ = Broken{std::string(rule.name()), at, detail};
  }
  [[nodiscard]] const std::optional<Broken>& broken() const noexcept { return broken_; }

 private:
  void check_readings(const CycleSeen& seen);
  void check_sensors_used(const CycleSeen& seen);
  void check_truth(const CycleSeen& seen);
  void check_command(const CycleSeen& seen);
  void check_hold(const CycleSeen& seen);
  [[nodiscard]] bool is_released(const CycleSeen& seen, std::size_t axis) const;
  void check_correction(const CycleSeen& seen);
  void check_node(const CycleSeen& seen, std::size_t axis);
  void check_learning(const CycleSeen& seen, std::size_t axis);
  void check_cycle_hold(const CycleSeen& seen);
  void check_held_displacement(const CycleSeen& seen, std::size_t axis);
  void note_learned(const Report& report);
  void check_recovery(const CycleSeen& seen, SimulatedController& controller);
  void check_written(const CycleSeen& seen, const SimulatedController& controller);
  void check_move(const CycleSeen& seen, const Move& move, const SimulatedController& controller);
  void check_sent(const CycleSeen& seen, const Move& move);
  void check_first(const CycleSeen& seen, const Move& move);
  void check_unexplained(const CycleSeen& seen, std::size_t axis);
  [[nodiscard]] bool fresh(std::size_t sensor, nanoseconds now) const;
  void check_suspicion(const Report& report, nanoseconds now);
  [[nodiscard]] bool any_block_lost(nanoseconds now) const;
  [[nodiscard]] nanoseconds slack_of(std::size_t sensor) const { return slack_[sensor]; }

  const FaultSchedule& schedule_;
  const Thermocouples& thermocouples_;
  std::optional<Broken> broken_;
  std::array<nanoseconds, sensors_count> slack_{};  ///< from conversion to reading's time
  std::array<nanoseconds, sensors_count> stale_after_{};
  std::array<nanoseconds, sensors_count> settled_after_{};
  /// Value may be older than its request: unchanged counter, or separately requested status.
  std::array<bool, sensors_count> stamped_earlier_{};
  std::array<Reading, sensors_count> last_readings_{};
  std::array<nanoseconds, sensors_count> last_used_{};
  std::array<nanoseconds, sensors_count> true_at_{};  ///< last unused or close
  std::array<bool, sensors_count> had_truth_{};       ///< since the start
  std::array<nanoseconds, sensors_count> first_used_{};
  double period_s_{1.0};
  double link_period_s_{1.0};
  double link_timeout_s_{0.2};
  double turn_s_{1.0};      ///< longest duration of the link's reads and writes
  double patience_s_{1.0};  ///< longest allowed time without a write
  bool smoothing_off_{false};
  double resolution_um_{0.0};
  bool reads_back_{true};
  std::array<double, axes_count> leap_um_{};    ///< allowed for the first offset since the boot
  std::array<bool, axes_count> is_lost_{};      ///< until the axis moves, see lost()
  std::array<double, axes_count> wanted_um_{};  ///< in the newest valid command
  std::array<double, axes_count> wanted_before_um_{};  ///< ... before the boot
  std::array<bool, axes_count> has_moved_{};           ///< since the boot

  nanoseconds boot_{};
  nanoseconds last_{};
  nanoseconds last_compensating_{};
  nanoseconds switched_off_last_{};
  bool first_{true};
  bool lost_before_{false};
  std::array<double, axes_count> offset_um_{};  ///< sent in the previous cycle
  std::array<bool, axes_count> offset_was_driven_{};
  std::array<double, axes_count> bound_um_{};
  std::array<double, axes_count> largest_bound_um_{};
  std::array<double, axes_count> rate_um_per_s_{};  ///< the larger one across a reload

  struct Budget {
    double um{0.0};
    nanoseconds at{};
    std::array<double, 16> reported_um{};
    std::size_t count{0};
    nanoseconds disturbed_at{-std::chrono::hours(1)};
  };
  std::array<Budget, axes_count> budgets_{};

  /// Offsets written to an axis, observed at the controller, independent of its read-back.
  struct Sent {
    double um{not_a_number};
    nanoseconds at{};
    double credit_um{0.0};    ///< remaining allowed change
    std::uint64_t breaks{0};  ///< of the link, at the last start from the read-back
    std::deque<std::pair<nanoseconds, double>> lately;
    std::deque<std::pair<nanoseconds, double>> wanted;  ///< by the cycle
    nanoseconds read_back_at{};
    int unexplained{0};    ///< consecutive read-backs
    bool released{false};  ///< since it was latched
    bool latched{false};   ///< in the previous cycle
    [[nodiscard]] std::pair<double, double> range_um(double with_um) const;
  };
  std::array<Sent, axes_count> sent_{};

  /// Correction of an axis at the end of the previous cycle.
  struct Learned {
    CorrectionReport correction;
    std::array<double, 2> contribution_um{};  ///< per group, when last predicted
    bool proving{false};
    bool predicted{false};  ///< in that cycle, so that contribution_um belongs to it
  };
  std::array<Learned, axes_count> learned_{};
  /// Temperatures held since the last cycle end, and the count of cycle ends then.
  std::vector<double> held_degC_;
  std::uint64_t ends_at_hold_{0};
  std::array<std::size_t, axes_count> probings_{};
  bool referenced_{false};
};

}  // namespace thermocomp::faults
