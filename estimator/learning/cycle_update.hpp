/// What is compensated until the next cycle end, where the offset follows machining cycles.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/learning/cycle_ends.hpp"
#include "estimator/learning/cycle_hold.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/travel_curves.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

/// update = "each_cycle": the displacement at the state that was held when the last cycle ended,
/// evaluated at the present positions and with the gains of the moment; "continuous": that of the
/// moment.
class CycleUpdate {
 public:
  struct State {
    double share{not_a_number};   ///< of the model that was believed when the cycle ended
    std::vector<double> axis_um;  ///< one per axis, of the held state
  };

  /// @param axis_output  axis -> output of the model
  CycleUpdate(const EstimatorConfig& config, const ThermalModel& model,
              const std::vector<std::size_t>& axis_output);

  /// @param compensating  a cycle end may be taken
  /// @param live          the model, stepped with these values
  /// @return one per axis: what is compensated
  [[nodiscard]] std::span<const double> step(nanoseconds now, const Displacement& displacement,
                                             bool compensating, const Temperatures& temps,
                                             const ReferenceState& reference,
                                             const Signals& signals, const DisplacementModel& live,
                                             const Probings& learned) noexcept;
  /// An operator's command: a cycle has ended.
  void command() noexcept { ends_.command(); }
  /// A new reference has been taken in this state.
  void restart(nanoseconds now, std::span<const double> temps_degC,
               std::span<const double> signals) noexcept;

  [[nodiscard]] std::uint64_t cycle_ends() const noexcept { return ends_.count(); }
  [[nodiscard]] const CycleHold& hold() const noexcept { return hold_; }
  [[nodiscard]] double held_um(std::size_t axis) const noexcept { return state_.axis_um[axis]; }

  /// Before the first step: what was held before the restart, NaN where it is not known.
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
  std::vector<double> node_um_;  ///< scratch, one per axis: that at its node
  std::vector<double> rise_K_;   ///< scratch, one per column
};

}  // namespace thermocomp
