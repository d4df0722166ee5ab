/// From displacement and mode to where each axis is to go.
#pragma once

#include <span>
#include <vector>

#include "estimator/estimator_config.hpp"
#include "estimator/pipeline/mode.hpp"
#include "estimator/step_values.hpp"

namespace thermocomp {

/// Compensating: the negative of the displacement, times the axis' sign. Disabled or on the way to
/// zero: zero. Otherwise: stay.
///
/// Lost data never clear an offset mid-cut, nor where it is not known whether the machine is
/// cutting: it is held as in Mode::holding, so that one outside a smaller bound still comes in.
class TargetRule {
 public:
  explicit TargetRule(const EstimatorConfig& config);

  /// @param axis_um  one per axis: what is compensated
  [[nodiscard]] Targets step(Mode mode, std::span<const double> axis_um,
                             const Displacement& displacement, const Signals& signals) noexcept;

 private:
  const bool hold_while_cutting_;
  std::vector<double> signs_;
  std::vector<double> targets_um_;
};

}  // namespace thermocomp
