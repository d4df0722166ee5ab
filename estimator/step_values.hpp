/// Values passed between the stages of a step: signals -> temperatures -> reference -> displacement
/// -> mode -> targets -> command. Spans are views into the stages, valid until the next step.
#pragma once

#include <cstdint>
#include <span>

#include "estimator/types.hpp"

namespace thermocomp {

struct StepTime {
  nanoseconds now{};
  double dt_s{0.0};   ///< since the previous step; 0 at the first
  bool first{false};  ///< no earlier step, not even of an adopted estimator
};

/// Signals of the controller; while it is offline, the last ones.
struct Signals {
  bool online{false};    ///< the controller answers and its report is fresh
  bool complete{false};  ///< every value that the model or disable_signal needs is known
  std::span<const double> of_model;  ///< shape (signal_columns)
  bool watches_cutting{false};       ///< a cutting_signal is configured
  double cutting{not_a_number};      ///< NaN: unknown or not configured; so are the next two
  double disable{not_a_number};
  double cycle_end{not_a_number};

  /// An unknown signal does not count as "not cutting".
  [[nodiscard]] bool surely_not_cutting() const noexcept { return online && cutting < 0.5; }
  [[nodiscard]] bool may_be_cutting() const noexcept {
    return watches_cutting && !surely_not_cutting();
  }
};

/// Temperatures of the model's columns; all spans have that shape.
struct Temperatures {
  std::span<const double> measured_degC;    ///< the last known value where not good
  std::span<const std::uint8_t> good;       ///< measured in this step
  std::span<const nanoseconds> refuted_at;  ///< start of the last confirmed jump; min(): none
  std::span<const double> estimated_degC;   ///< measured, or estimated where lost
  bool all_good{false};
  bool complete{false};  ///< each is measured or estimated
  bool jumped{false};    ///< an unconfirmed value contradicts the earlier ones
  bool suspected{false};
  bool weighed_down{false};  ///< a suspected sensor is excluded from its blocks
};

/// State of zero displacement.
struct ReferenceState {
  std::span<const double> temps_degC;  ///< shape (temperature_columns)
  std::span<const double> signals;     ///< shape (signal_columns)
  bool known{false};                   ///< all temperatures are known
  bool changed{false};                 ///< in this step
};

/// Displacement of the machine without any offset.
struct Displacement {
  bool known{false};  ///< computed in this step; else the numbers below are from an earlier one
  bool block_lost{false};
  bool block_estimated{false};  ///< lost, and estimated well enough
  bool not_finite{false};       ///< good inputs gave no finite number
  bool outside{false};
  bool held{false};                 ///< outside, and configured to hold
  double used_share{1.0};           ///< share of the model's displacement in use
  std::span<const double> zero_um;  ///< per output: the model at the reference state
  std::span<const double> axis_um;  ///< one per axis, with the correction learned from probings
};

struct Targets {
  std::span<const double> axis_um;  ///< one per axis; NaN: stay
  bool may_change{true};            ///< false: hold_while_cutting holds the offset
  bool waits_for_cut{false};        ///< the ramp to zero waits for the end of a cut
  bool hold_where_unknown{false};   ///< an axis without a target keeps its offset
};

}  // namespace thermocomp
