/// From the displacement to the targets of the axes: mode of the step, displacement compensated in
/// it, and the rule of the targets.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "estimator/axes/axis_bank.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/travel_curves.hpp"
#include "estimator/pipeline/prediction.hpp"
#include "estimator/sensing/sensing.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct ModeInput {
  StepTime time;
  bool displacement_known{false};
  bool controller_online{false};
  bool axes_synced{false};          ///< the applied offset of each axis is known
  bool controller_written{false};   ///< the newest writes of offsets are confirmed
  bool controller_disables{false};  ///< by its switch, as last reported
};

/// The mode is the first that holds:
///
///     disabled          by the operator or the controller
///     ramping_to_zero   the daemon is stopping, or nothing worked for longer than hold_s and
///                       on_loss is ramp_to_zero
///     compensating      displacement, controller and applied offsets are known, and the offsets
///                       are written ("works")
///     holding           it worked before
///     starting          it has never worked
class ModeDecision {
 public:
  struct State {
    bool ever_worked{false};
    nanoseconds lost_since{};  ///< the last step that worked, or the first one
    bool enabled{true};        ///< the operator's switch
    bool stopping{false};      ///< the daemon is stopping: offsets to zero
    Mode mode{Mode::starting};
    nanoseconds mode_since{};
  };

  explicit ModeDecision(const CompensationConfig& config);

  Mode step(const ModeInput& input) noexcept;

  void enable(bool enabled) noexcept { state_.enabled = enabled; }
  void stop() noexcept { state_.stopping = true; }
  [[nodiscard]] const State& state() const noexcept { return state_; }
  /// Mode for the targets: an axis that holds only because the controller takes no offset still has
  /// a target, towards which it may move back (AxisChannel).
  [[nodiscard]] Mode targeted() const noexcept {
    return state_.mode == Mode::holding && only_unwritten_ ? Mode::compensating : state_.mode;
  }

  void adopt(const ModeDecision& previous) noexcept { state_ = previous.state_; }
  void visit_state(StateArchive& archive) {
    auto& [ever_worked, lost_since, enabled, stopping, mode, mode_since] = state_;
    archive(ever_worked, lost_since, enabled, stopping, mode, mode_since);
  }

 private:
  [[nodiscard]] Mode decide(const ModeInput& input, bool works) const noexcept;

  const bool ramps_on_loss_;  ///< on_loss = "ramp_to_zero"
  const nanoseconds hold_;
  State state_;
  bool only_unwritten_{false};
};

/// Counts cycle ends from commands and from a signal of the controller.
class CycleEnds {
 public:
  /// @param every      an update at every n-th cycle end
  /// @param is_switch  the signal is 0 or 1, and a rising edge ends a cycle; else any change does
  CycleEnds(std::uint64_t every, bool is_switch) : every_(every), is_switch_(is_switch) {}

  struct State {
    std::uint64_t count{0};
    double last{not_a_number};  ///< last value of the signal
    bool due{false};
  };

  void command() noexcept { ended(); }
  /// @param value  NaN: unknown, ends no cycle
  void signal(double value) noexcept {
    if (!std::isfinite(value)) return;
    if (std::isfinite(state_.last) &&
        (is_switch_ ? state_.last < 0.5 && value >= 0.5 : value != state_.last))
      ended();
    state_.last = value;
  }
  /// True once for each update that is due. @param can  predictions are available
  [[nodiscard]] bool take(bool can) noexcept {
    const bool now = state_.due && can;
    if (now) state_.due = false;
    return now;
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return state_.count; }
  /// @param same_signal  of both configurations: an edge during the reload counts
  void adopt(const CycleEnds& previous, bool same_signal) noexcept {
    const double last = same_signal ? previous.state_.last : state_.last;
    state_ = previous.state_;
    state_.last = last;
  }
  void visit_state(StateArchive& archive) {
    auto& [count, last, due] = state_;
    archive(count, last, due);
  }

 private:
  void ended() noexcept {
    if (++state_.count % every_ == 0) state_.due = true;
  }

  const std::uint64_t every_;
  const bool is_switch_;
  State state_;
};

/// The held quantity is a state, not a displacement: block temperatures, operating signals and
/// states of the terms, extrapolated by a share of an interval:
///   T_held = T_n + ahead (T_n - T_(n-1))
/// The displacement is evaluated from it at the present positions (signals in mm) and with the
/// present gains, so that a moving slide, a corrected gain and a reloaded matrix act at once and
/// are not extrapolated.
class CycleHold {
 public:
  /// @param ahead  in [0, 1]; 1: linear extrapolation by a whole interval
  /// @throws InvalidValue when the model's shapes do not fit each other
  CycleHold(const ThermalModel& model, double ahead);

  /// A cycle has ended. Never allocates; O(outputs x inputs).
  /// @param temps_degC  shape (temperature_columns)
  /// @param signals     shape (signal_columns)
  /// @param live        the same model, stepped to `now` with these values
  void cycle_end(nanoseconds now, std::span<const double> temps_degC,
                 std::span<const double> signals, const DisplacementModel& live) noexcept;
  /// A new reference: displacement is zero in this state, without a cycle end to extrapolate from.
  void restart(nanoseconds now, std::span<const double> temps_degC,
               std::span<const double> signals) noexcept;

  /// True if a state is held: a cycle has ended, or a state was restored.
  [[nodiscard]] bool holds() const noexcept { return state_.holds; }
  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return state_.held_degC; }
  /// NaN for positions, which are never held.
  [[nodiscard]] double signal(std::size_t index) const noexcept {
    return is_position_[index] ? not_a_number : state_.held_signals[index];
  }
  /// The model at the held state. @pre holds()
  /// @param signals          present values; only positions are used
  /// @param displacement_um  shape (outputs); overwritten
  void displacement(std::span<const double> reference_degC, std::span<const double> signals,
                    std::span<double> displacement_um) noexcept;

  /// Before the first step: the state held before the restart, NaN where unknown.
  void restore(std::span<const double> temps_degC, std::span<const double> signals) noexcept;
  /// After a reload; plans from plan_names() and plan_terms().
  void adopt(const CycleHold& previous, const std::vector<int>& columns,
             const std::vector<int>& signals, const std::vector<int>& terms) noexcept;
  void visit_state(StateArchive& archive) { archive(model_, state_); }

 private:
  struct State {
    bool holds{false};
    nanoseconds at{};  ///< time of the held state; may be in the future
    std::vector<double> held_degC;
    std::vector<double> held_signals;
    bool ended{false};  ///< a cycle has ended, from which the next change counts
    nanoseconds ended_at{};
    std::vector<double> ended_degC;
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g] = *this;
      archive(a, b, c, d, e, f, g);
    }
  };
  void hold(std::span<const double> signals) noexcept;

  const double ahead_;
  std::vector<bool> is_position_;  ///< one per signal
  DisplacementModel model_;        ///< at the held state

  State state_;
};

/// Update once per machining cycle (JP7689460B2; Teratani et al. 1995, eq. 33 to 38).
///
/// update = "each_cycle": displacement of the state held since the last cycle end, at the present
/// positions and with the present gains; "continuous": the present displacement.
class CycleUpdate {
 public:
  struct State {
    double share{not_a_number};   ///< share of the model in use when the cycle ended
    std::vector<double> axis_um;  ///< one per axis, of the held state
  };

  /// @param axis_output  axis -> output of the model
  CycleUpdate(const EstimatorConfig& config, const ThermalModel& model,
              const std::vector<std::size_t>& axis_output);

  /// @param compensating  a cycle end may be taken
  /// @param live          the model, stepped with these values
  /// @return one per axis: the displacement to compensate
  [[nodiscard]] std::span<const double> step(nanoseconds now, const Displacement& displacement,
                                             bool compensating, const Temperatures& temps,
                                             const ReferenceState& reference,
                                             const Signals& signals, const DisplacementModel& live,
                                             const Probings& learned) noexcept;
  /// An operator's command that a cycle has ended.
  void command() noexcept { ends_.command(); }
  void restart(nanoseconds now, std::span<const double> temps_degC,
               std::span<const double> signals) noexcept;

  [[nodiscard]] std::uint64_t cycle_ends() const noexcept { return ends_.count(); }
  [[nodiscard]] const CycleHold& hold() const noexcept { return hold_; }
  [[nodiscard]] double held_um(std::size_t axis) const noexcept { return state_.axis_um[axis]; }

  /// Before the first step: the state held before the restart, NaN where unknown.
  void restore(std::span<const double> temps_degC, std::span<const double> signals) noexcept {
    hold_.restore(temps_degC, signals);
  }
  /// After a reload, with plans from plan_names() and plan_terms().
  void adopt(const CycleUpdate& previous, const std::vector<int>& columns,
             const std::vector<int>& signals, const std::vector<int>& axes,
             const std::vector<int>& terms) noexcept;
  void visit_state(StateArchive& archive) {
    auto& [share, axis_um] = state_;
    archive(share, axis_um);
  }
  void visit_cycles(StateArchive& archive) { archive(hold_, ends_); }

 private:
  void evaluate(const Displacement& displacement, const ReferenceState& reference,
                const Signals& signals, const Probings& learned) noexcept;

  const bool each_cycle_;
  const std::string signal_name_;
  const std::vector<std::size_t> axis_output_;

  CycleHold hold_;
  CycleEnds ends_;
  State state_;
  TravelCurves curves_;
  const std::vector<NodePlace> places_;
  std::vector<double> held_um_;  ///< scratch, one per output: the model at the held state
  std::vector<double> node_um_;  ///< scratch, one per axis: the model at its node
  std::vector<double> rise_K_;   ///< scratch, one per column
};

/// Compensating: the negative of the displacement, times the axis' sign. Disabled or ramping to
/// zero: zero. Otherwise: stay.
///
/// Loss of data never clears an offset during a cut, or where cutting is unknown: the offset is
/// held as in Mode::holding, so that one outside a smaller bound still returns into it.
class TargetRule {
 public:
  explicit TargetRule(const EstimatorConfig& config);

  /// @param axis_um  one per axis: the displacement to compensate
  [[nodiscard]] Targets step(Mode mode, std::span<const double> axis_um,
                             const Displacement& displacement, const Signals& signals) noexcept;

 private:
  const bool hold_while_cutting_;
  std::vector<double> signs_;
  std::vector<double> targets_um_;
};

}  // namespace thermocomp
