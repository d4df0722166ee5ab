/// Correction once per machining cycle: between two cycle ends the compensation goes by the state
/// that the machine had at the last one (JP7689460B2; Teratani et al. 1995, eq. 33 to 38).
#pragma once

#include <span>
#include <string>
#include <vector>

#include "estimator/model/displacement_model.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/thermal_model.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// What is held is a state, never a displacement: block temperatures, operating signals and the
/// terms' past, one interval ahead if wanted:
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
                 std::span<const double> signals, const DisplacementModel& live) noexcept;
  /// A new reference has been taken: the machine is straight in this state, and there is no change
  /// to go by yet.
  void restart(nanoseconds now, std::span<const double> temps_degC,
               std::span<const double> signals) noexcept;

  /// Whether there is a state to go by: a cycle has ended, or one was restored.
  [[nodiscard]] bool holds() const noexcept { return state_.holds; }
  [[nodiscard]] std::span<const double> temps_degC() const noexcept { return state_.held_degC; }
  /// NaN for a position: those are never held.
  [[nodiscard]] double signal(std::size_t index) const noexcept {
    return is_position_[index] ? not_a_number : state_.held_signals[index];
  }
  /// The model at the held state. @pre holds()
  /// @param signals          now; only positions are taken from them
  /// @param displacement_um  shape (outputs); overwritten
  void displacement(std::span<const double> reference_degC, std::span<const double> signals,
                    std::span<double> displacement_um) noexcept;

  /// Before the first step: what was held before the restart, NaN where it is not known.
  void restore(std::span<const double> temps_degC, std::span<const double> signals) noexcept;
  /// After a reload; plans from plan_names() and plan_terms().
  void adopt(const CycleHold& previous, const std::vector<int>& columns,
             const std::vector<int>& signals, const std::vector<int>& terms) noexcept;
  void visit_state(StateArchive& archive) { archive(model_, state_); }

 private:
  struct State {
    bool holds{false};
    nanoseconds at{};  ///< the moment of the held state; may lie ahead
    std::vector<double> held_degC;
    std::vector<double> held_signals;
    bool ended{false};  ///< there was a cycle end to count the next change from
    nanoseconds ended_at{};
    std::vector<double> ended_degC;
    void visit_state(StateArchive& archive) {
      auto& [a, b, c, d, e, f, g] = *this;
      archive(a, b, c, d, e, f, g);
    }
  };
  void hold(std::span<const double> signals) noexcept;

  const double ahead_;
  std::vector<bool> is_position_;  ///< of the signals
  DisplacementModel model_;        ///< at the held state

  State state_;
};

}  // namespace thermocomp
