/// Correction once a machining cycle: between two cycle ends the compensation goes by the state
/// that the machine had at the last one (JP7689460B2; Teratani et al. 1995, eq. 33 to 38).
#pragma once

#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "estimator/displacement_model.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// What is held is a state, never a displacement: block temperatures, operating signals and the
/// terms' past, one interval ahead where that is wanted:
///   T_held = T_n + ahead (T_n - T_(n-1))
/// The displacement is evaluated from them whenever it is asked for, at the axes' present positions
/// (signals in mm) and with the gains of the moment. So a moving slide, a gain that a probing has
/// corrected and a matrix that has been reloaded count at once, and none of them is extrapolated.
class CycleHold {
 public:
  /// @param ahead  in [0, 1]; 1: a whole interval ahead by linear extrapolation
  /// @throws InvalidValue when the model's shapes do not fit each other
  CycleHold(const ThermalModel& model, double ahead);

  /// A cycle has ended. Never allocates; O(outputs x inputs).
  /// @param temps_degC  shape (temperature_columns)
  /// @param signals     shape (signal_columns)
  /// @param live        the same model, stepped to `now` with these values
  void cycle_end(nanoseconds now, std::span<const double> temps_degC,
                 std::span<const double> signals, DisplacementModel& live) noexcept;
  /// A new reference has been taken: the machine is straight in this state, and there is no change
  /// to go by yet.
  void restart(nanoseconds now, std::span<const double> temps_degC,
               std::span<const double> signals) noexcept;

  /// Whether there is a state to go by: a cycle has ended, or one was restored.
  [[nodiscard]] bool holds() const noexcept { return holds_; }
  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return held_degC_; }
  /// NaN for a position: those are never held.
  [[nodiscard]] double signal(std::size_t index) const noexcept {
    return is_position_[index] ? not_a_number : held_signals_[index];
  }
  /// The model at the held state. @pre holds()
  /// @param signals          now; only positions are taken from them
  /// @param displacement_um  shape (outputs); overwritten
  void displacement(std::span<const double> reference_degC, std::span<const double> signals,
                    std::span<double> displacement_um) noexcept;

  /// Before the first step: what was held before the restart, NaN where it is not known.
  void restore(std::span<const double> temps_degC, std::span<const double> signals) noexcept;
  /// After a reload; plans as of plan_names() and plan_terms().
  void adopt(CycleHold& previous, const std::vector<int>& columns, const std::vector<int>& signals,
             const std::vector<int>& terms) noexcept;
  void visit_state(StateArchive& archive) {
    archive(model_, holds_, at_, held_degC_, held_signals_, ended_, ended_at_, ended_degC_);
  }

 private:
  void hold(std::span<const double> signals) noexcept;

  double ahead_;
  std::vector<bool> is_position_;  ///< of the signals
  DisplacementModel model_;        ///< at the held state

  bool holds_{false};
  nanoseconds at_{};  ///< the moment of the held state; may lie ahead
  std::vector<double> held_degC_;
  std::vector<double> held_signals_;
  bool ended_{false};  ///< there was a cycle end to count the next change from
  nanoseconds ended_at_{};
  std::vector<double> ended_degC_;
};

/// Counts cycle ends from commands and from a signal of the controller, and says when they are due.
class CycleEnds {
 public:
  /// @param every     a correction at each so-many-th cycle end
  /// @param is_switch  the signal is 0 or 1, and ends a cycle by rising; else any change does
  CycleEnds(std::uint64_t every, bool is_switch) : every_(every), is_switch_(is_switch) {}

  void command() noexcept { ended(); }
  /// @param value  NaN: not known, which ends nothing
  void signal(double value) noexcept {
    if (!std::isfinite(value)) return;
    if (std::isfinite(last_) && (is_switch_ ? last_ < 0.5 && value >= 0.5 : value != last_))
      ended();
    last_ = value;
  }
  /// Whether the correction is due; once only. @param can  predictions are there to be taken
  [[nodiscard]] bool take(bool can) noexcept {
    const bool now = due_ && can;
    if (now) due_ = false;
    return now;
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  /// @param same_signal  of the other's configuration and of ours: an edge during the reload counts
  void adopt(const CycleEnds& previous, bool same_signal) noexcept {
    count_ = previous.count_;
    due_ = previous.due_;
    if (same_signal) last_ = previous.last_;
  }
  void visit_state(StateArchive& archive) { archive(count_, last_, due_); }

 private:
  void ended() noexcept {
    if (++count_ % every_ == 0) due_ = true;
  }

  std::uint64_t every_;
  bool is_switch_;
  std::uint64_t count_{0};
  double last_{not_a_number};
  bool due_{false};
};

}  // namespace thermocomp
