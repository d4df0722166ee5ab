/// All axes, from targets to the command.
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

/// The nodes of a travel are one axis, driven only while all of them may be, so that the controller
/// never follows a part of a set. A step therefore compares all nodes with the controller's report
/// before it moves any.
class AxisBank {
 public:
  explicit AxisBank(const EstimatorConfig& config);

  /// @param command  overwritten: offsets of all axes, with the look that they were computed from
  void step(const StepTime& time, const Targets& targets, const Signals& signals,
            const ControllerState& controller, OffsetCommand& command) noexcept;

  [[nodiscard]] std::span<const AxisChannel> all() const noexcept { return axes_; }
  [[nodiscard]] std::size_t size() const noexcept { return axes_.size(); }
  [[nodiscard]] const AxisChannel& operator[](std::size_t axis) const noexcept {
    return axes_[axis];
  }
  /// All axes are synchronised, and the last sent offset of at least one is known.
  [[nodiscard]] bool synced() const noexcept;
  /// One bit per axis: the last sent offset is not known.
  [[nodiscard]] std::uint32_t forgotten() const noexcept;
  /// True if the offset may be sent: all nodes of the axis' travel are driven.
  [[nodiscard]] bool driven(std::size_t axis) const noexcept { return driven(span_of_[axis]); }
  [[nodiscard]] const AxisSpan& span(std::size_t axis) const noexcept { return span_of_[axis]; }

  /// Offset in effect as a displacement [um]: read back, or as sent where nothing is read back.
  [[nodiscard]] double compensated_um(std::size_t axis) const noexcept;

  /// Moves all nodes of a travel, or none.
  void prove(std::size_t axis, double move_um) noexcept;
  void release(std::size_t axis) noexcept;
  void end_proves() noexcept;

  void saved(std::size_t axis, double offset_um) noexcept { axes_[axis].saved(offset_um); }

  /// Before the first step: offsets known from before the restart.
  void restore(std::size_t axis, const SentBefore& before) noexcept { axes_[axis].restore(before); }
  /// @param axes  from plan_names()
  void adopt(const AxisBank& previous, const std::vector<int>& axes) noexcept;
  void visit_state(StateArchive& archive);

 private:
  [[nodiscard]] bool driven(const AxisSpan& span) const noexcept;

  std::vector<AxisChannel> axes_;
  std::vector<AxisSpan> spans_;
  std::vector<AxisSpan> span_of_;  ///< one per axis, the same for all nodes of a travel
  std::vector<double> signs_;
};

}  // namespace thermocomp
