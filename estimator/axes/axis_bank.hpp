/// All axes from their targets to the command.
#pragma once

#include <span>
#include <vector>

#include "estimator/axes/axis_channel.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

class AxisBank {
 public:
  explicit AxisBank(const EstimatorConfig& config);

  /// @param command  overwritten: offsets of all axes, and the look that they belong to
  void step(const StepTime& time, const Targets& targets, const Signals& signals,
            const ControllerState& controller, OffsetCommand& command) noexcept;

  [[nodiscard]] std::span<const AxisChannel> all() const noexcept { return axes_; }
  [[nodiscard]] std::size_t size() const noexcept { return axes_.size(); }
  [[nodiscard]] const AxisChannel& operator[](std::size_t axis) const noexcept {
    return axes_[axis];
  }
  [[nodiscard]] bool synced() const noexcept;  ///< all are

  /// What the axis is offset by now, as a displacement: read back where the controller tells.
  [[nodiscard]] double compensated_um(std::size_t axis) const noexcept;

  void prove(std::size_t axis, double move_um) noexcept { axes_[axis].prove(move_um); }
  void release(std::size_t axis) noexcept { axes_[axis].release(); }
  void end_proves() noexcept;

  /// Before the first step: what was sent last before the restart.
  void restore(std::size_t axis, double offset_um) noexcept { axes_[axis].restore(offset_um); }
  /// @param axes  of plan_names()
  void adopt(const AxisBank& previous, const std::vector<int>& axes) noexcept;
  void visit_state(StateArchive& archive);

 private:
  std::vector<AxisChannel> axes_;
  std::vector<double> signs_;
};

}  // namespace thermocomp
