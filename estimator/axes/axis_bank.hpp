/// All axes from their targets to the command.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "estimator/axes/axis_channel.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/state_archive.hpp"
#include "estimator/step_values.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// The nodes of a travel are one axis: it is driven while all of them are, and none goes on while
/// another must stand, so that the controller never has a set of which a part may not be followed.
/// Whether it is driven is known when all have looked at what the controller tells.
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
  /// Every axis is, and of at least one it is known what was sent last.
  [[nodiscard]] bool synced() const noexcept;
  /// By bits, one an axis: what was sent last is forgotten.
  [[nodiscard]] std::uint32_t forgotten() const noexcept;
  /// Whether the offset may be sent: the axis is driven, with all nodes of its travel.
  [[nodiscard]] bool driven(std::size_t axis) const noexcept { return driven(span_of_[axis]); }
  /// The entries that are one axis with this one.
  [[nodiscard]] const AxisSpan& span(std::size_t axis) const noexcept { return span_of_[axis]; }

  /// By how much the axis is offset now, as a displacement [um]: read back where the controller
  /// tells.
  [[nodiscard]] double compensated_um(std::size_t axis) const noexcept;

  /// Of a travel with all of its nodes, or not at all.
  void prove(std::size_t axis, double move_um) noexcept;
  void release(std::size_t axis) noexcept;
  void end_proves() noexcept;

  void saved(std::size_t axis, double offset_um) noexcept { axes_[axis].saved(offset_um); }

  /// Before the first step: what was sent last before the restart.
  void restore(std::size_t axis, const SentBefore& before) noexcept { axes_[axis].restore(before); }
  /// @param axes  from plan_names()
  void adopt(const AxisBank& previous, const std::vector<int>& axes) noexcept;
  void visit_state(StateArchive& archive);

 private:
  [[nodiscard]] bool driven(const AxisSpan& span) const noexcept;

  std::vector<AxisChannel> axes_;
  std::vector<AxisSpan> spans_;    ///< together all axes
  std::vector<AxisSpan> span_of_;  ///< one per axis, the same for all nodes of a travel
  std::vector<double> signs_;
};

}  // namespace thermocomp
