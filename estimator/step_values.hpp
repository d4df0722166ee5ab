/// What the steps of the pipeline hand on to each other: signals -> temperatures -> reference ->
/// displacement -> mode -> targets -> command. Views of what their makers keep, good until the next
/// step.
#pragma once

#include <cstdint>
#include <span>

#include "estimator/types.hpp"

namespace thermocomp {

struct StepTime {
  nanoseconds now{};
  double dt_s{0.0};   ///< since the step before; 0 at the first
  bool first{false};  ///< nothing was stepped before, not even by the estimator adopted from
};

/// What the controller reports. Of a silent one: what it reported last.
struct Signals {
  bool online{false};    ///< the controller is there and its report is fresh
  bool complete{false};  ///< every value that the model or disable_signal needs is known
  std::span<const double> of_model;  ///< shape (signal_columns)
  bool watches_cutting{false};       ///< there is a cutting_signal
  double cutting{not_a_number};      ///< NaN: unknown, or no such signal; so are the next two
  double disable{not_a_number};
  double cycle_end{not_a_number};

  /// Only a clear "not cutting" is one.
  [[nodiscard]] bool surely_not_cutting() const noexcept { return online && cutting < 0.5; }
  [[nodiscard]] bool may_be_cutting() const noexcept {
    return watches_cutting && !surely_not_cutting();
  }
};

/// Of the model's temperature columns; all of that shape.
struct Temperatures {
  std::span<const double> measured_degC;  ///< the last known where not good
  std::span<const std::uint8_t> good;     ///< measured in this step
  std::span<const nanoseconds>
      refuted_at;  ///< begin of the last jump that proved true; or the least
  std::span<const double> estimated_degC;  ///< measured, or estimated where lost
  bool all_good{false};
  bool complete{false};      ///< each is measured or estimated
  bool jumped{false};        ///< a value contradicts what was, and nothing confirms it
  bool suspected{false};     ///< a sensor is, that is plausibly wrong
  bool weighed_down{false};  ///< ... and is left out of its blocks
};

/// The state that displacement is counted from.
struct ReferenceState {
  std::span<const double> temps_degC;  ///< shape (temperature_columns)
  std::span<const double> signals;     ///< shape (signal_columns)
  bool known{false};                   ///< all temperatures are
  bool changed{false};                 ///< in this step
};

/// What the machine is displaced by, without any offset.
struct Displacement {
  bool known{false};  ///< in this step; else the numbers below are those of an earlier one
  bool block_lost{false};
  bool block_estimated{false};      ///< ... lost, and estimated well enough
  bool not_finite{false};           ///< good inputs, and no number from them
  bool outside{false};              ///< of what the model was made from
  bool held{false};                 ///< ... and configured to stay there
  double believed_share{1.0};       ///< of the model's displacement
  std::span<const double> zero_um;  ///< of the outputs: the model at the reference state
  std::span<const double> axis_um;  ///< one per axis, with what was learned by probing
};

/// Where the axes are to go.
struct Targets {
  std::span<const double> axis_um;  ///< one per axis; NaN: stay
  bool may_change{true};            ///< false: hold_while_cutting holds the offset
  bool waits_for_cut{false};        ///< going to zero waits for the end of a cut
  bool stand_where_unknown{false};  ///< an axis without a target has the one it stands at
};

}  // namespace thermocomp
