/// What must hold in every step, whatever happens. Judged from what the simulated machine gave out
/// and was reported, not from what the code under test believes.
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

/// So far may a register of 0.1 um be off the offset that it holds [um].
inline constexpr double register_rounding_um = 0.1;

struct Broken {
  std::string invariant;
  nanoseconds at{};
  std::string detail;
};

/// One cycle as it was.
struct CycleSeen {
  nanoseconds now{};
  std::span<const Reading> readings;
  const ControllerState* reported{nullptr};  ///< of the controller, as the estimator got it
  const OffsetCommand* command{nullptr};
  const Report* report{nullptr};
  const MachineShape* shape{nullptr};  ///< the configuration in force
};

/// What the groups of inputs of the corrections add to the model's displacement of an axis: the
/// first input, then the two others.
[[nodiscard]] std::array<double, 2> contributions_um(const MachineShape& shape,
                                                     const Report& report, std::size_t axis);

class Invariants {
 public:
  static constexpr double recovery_s_max = 95.0;
  /// A reading in use differs from the machine by no more than screening lets pass after an outage
  /// of minutes (rate_allowance_K, outage_K_max and 10 K/h), or for no longer than it may serve.
  static constexpr double false_K_max = 12.0;
  static constexpr double false_s_max = 20.0;

  Invariants(const MachineShape& shape, const FaultSchedule& schedule,
             const Thermocouples& thermocouples);

  /// @param leap_um  by so much the first offset may differ from the last one
  void booted(nanoseconds now, double leap_um);
  /// At a power cut the disk did not have yet that the controller had lost this axis's offset, or
  /// that an operator had set it to zero: no start can know.
  void lost(std::size_t axis) { is_lost_[axis] = true; }
  void reloaded(const MachineShape& shape);
  /// A probing of this axis reaches the estimator in the cycle to come.
  void probed(std::size_t axis) { ++probings_[axis]; }
  /// The operator releases this axis in the cycle to come.
  void released(std::size_t axis) { sent_[axis].released = true; }
  /// The operator takes a new reference in the cycle to come.
  void referenced() { referenced_ = true; }
  /// @param columns  of the model, in the order of the report's inputs
  void restored(const PersistentState& saved, const Report& report,
                const std::vector<std::string>& columns, nanoseconds now);
  void check(const CycleSeen& seen, std::vector<Move>& moves, SimulatedController& controller);
  /// @param detail  a text, or what makes one: that is only called where it does not hold
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
  std::array<nanoseconds, sensors_count> slack_{};  ///< from the unit to the time of the reading
  std::array<nanoseconds, sensors_count> stale_after_{};
  std::array<nanoseconds, sensors_count> settled_after_{};
  /// By a counter that has not moved, or a status asked for before.
  std::array<bool, sensors_count> stamped_earlier_{};
  std::array<Reading, sensors_count> last_readings_{};
  std::array<nanoseconds, sensors_count> last_used_{};
  std::array<nanoseconds, sensors_count> true_at_{};  ///< last not used, or near the machine
  std::array<bool, sensors_count> had_truth_{};       ///< since the start
  std::array<nanoseconds, sensors_count> first_used_{};
  double period_s_{1.0};
  double link_period_s_{1.0};
  double link_timeout_s_{0.2};
  double turn_s_{1.0};      ///< of the link, reads and writes, at the longest
  double patience_s_{1.0};  ///< so long it may go without a write
  bool smoothing_off_{false};
  double resolution_um_{0.0};
  bool reads_back_{true};
  std::array<double, axes_count> leap_um_{};           ///< of the first offset since the boot
  std::array<bool, axes_count> is_lost_{};             ///< until it moves: see lost()
  std::array<double, axes_count> wanted_um_{};         ///< by the newest valid command
  std::array<double, axes_count> wanted_before_um_{};  ///< ... before the boot
  std::array<bool, axes_count> has_moved_{};           ///< since the boot

  nanoseconds boot_{};
  nanoseconds last_{};
  nanoseconds last_compensating_{};
  nanoseconds switched_off_last_{};
  bool first_{true};
  bool lost_before_{false};
  std::array<double, axes_count> offset_um_{};  ///< sent in the cycle before
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

  /// What an axis was sent, seen at the controller, whatever it says that it applies.
  struct Sent {
    double um{not_a_number};
    nanoseconds at{};
    double credit_um{0.0};    ///< what it may still go at once
    std::uint64_t breaks{0};  ///< of the link, when it last began from what is applied
    std::deque<std::pair<nanoseconds, double>> lately;
    std::deque<std::pair<nanoseconds, double>> wanted;  ///< by the cycle
    nanoseconds read_back_at{};
    int unexplained{0};    ///< read-backs in a row
    bool released{false};  ///< since it was latched
    bool latched{false};   ///< in the cycle before
    [[nodiscard]] std::pair<double, double> range_um(double with_um) const;
  };
  std::array<Sent, axes_count> sent_{};

  /// What an axis had learned at the end of the cycle before.
  struct Learned {
    CorrectionReport correction;
    std::array<double, 2> contribution_um{};  ///< of the groups, when last predicted
    bool proving{false};
    bool predicted{false};  ///< in that cycle: the contributions are its own
  };
  std::array<Learned, axes_count> learned_{};
  /// Temperatures held since the last cycle end, and the cycle ends counted when they were taken.
  std::vector<double> held_degC_;
  std::uint64_t ends_at_hold_{0};
  std::array<std::size_t, axes_count> probings_{};
  bool referenced_{false};
};

}  // namespace thermocomp::faults
