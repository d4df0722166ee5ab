#include "estimator/axes/axis_bank.hpp"

#include <algorithm>
#include <cmath>
#include <span>

#include "estimator/checks.hpp"

namespace thermocomp {

AxisBank::AxisBank(const EstimatorConfig& config) {
  static_assert(axes_max == 16);
  require(config.axes.size() <= axes_max, "axis", static_cast<double>(config.axes.size()),
          "must be at most 16");
  for (const AxisConfig& axis : config.axes) {
    axes_.emplace_back(axis, config.compensation, config.controller_reads_back);
    signs_.push_back(axis.sign);
  }
  spans_ = axis_spans(config.axes);
  for (const AxisSpan& span : spans_) span_of_.insert(span_of_.end(), span.count, span);
}

void AxisBank::step(const StepTime& time, const Targets& targets, const Signals& signals,
                    const ControllerState& controller, OffsetCommand& command) noexcept {
  AxisInput input;
  input.now = time.now;
  input.dt_s = time.dt_s;
  input.may_change = targets.may_change;
  input.link_epoch = controller.link_epoch;
  input.online = signals.online;
  input.written = controller.written;
  input.taken_at = controller.taken_at;
  command.link_epoch = controller.link_epoch;
  command.look = controller.look;
  for (const AxisSpan& span : spans_) {
    for (std::size_t i = span.first; i < span.end(); ++i) {
      input.applied_um = controller.applied_um[i];
      axes_[i].observe(input);
    }
    const bool moves = driven(span);
    for (std::size_t i = span.first; i < span.end(); ++i) {
      input.target_um = targets.axis_um[i];
      if (targets.hold_where_unknown && !std::isfinite(input.target_um))
        input.target_um = axes_[i].offset_um();
      moves ? axes_[i].move(input) : axes_[i].hold(time.now);
      command.offset_um[i] = axes_[i].offset_um();
      command.valid[i] = moves;
    }
  }
}

bool AxisBank::driven(const AxisSpan& span) const noexcept {
  for (std::size_t i = span.first; i < span.end(); ++i)
    if (!axes_[i].driven()) return false;
  return true;
}

bool AxisBank::synced() const noexcept {
  bool any_known = axes_.empty();
  for (const AxisChannel& axis : axes_) {
    if (!axis.synced()) return false;
    any_known = any_known || !axis.start_unknown();
  }
  return any_known;
}

std::uint32_t AxisBank::forgotten() const noexcept {
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < axes_.size(); ++i)
    if (axes_[i].forgotten()) bits |= 1u << i;
  return bits;
}

double AxisBank::compensated_um(std::size_t axis) const noexcept {
  const double applied_um = axes_[axis].applied_um();
  return signs_[axis] * (std::isfinite(applied_um) ? applied_um : axes_[axis].offset_um());
}

void AxisBank::prove(std::size_t axis, double move_um) noexcept {
  const AxisSpan span = span_of_[axis];
  if (!driven(span)) return;
  for (std::size_t i = span.first; i < span.end(); ++i) axes_[i].prove(move_um);
}

void AxisBank::release(std::size_t axis) noexcept {
  const AxisSpan span = span_of_[axis];
  const std::span nodes = std::span(axes_).subspan(span.first, span.end() - span.first);
  // For an unknown start the operator has set the whole axis to zero, including the nodes of a
  // travel whose offset is known.
  const bool at_zero = std::any_of(nodes.begin(), nodes.end(),
                                   [](const AxisChannel& node) { return node.start_unknown(); });
  for (AxisChannel& node : nodes) {
    if (at_zero)
      node.begin_at_zero();
    else
      node.release();
  }
}

void AxisBank::end_proves() noexcept {
  for (AxisChannel& axis : axes_) axis.end_prove();
}

void AxisBank::adopt(const AxisBank& previous, const std::vector<int>& axes) noexcept {
  for (std::size_t i = 0; i < axes.size(); ++i)
    if (axes[i] >= 0) axes_[i].adopt(previous.axes_[static_cast<std::size_t>(axes[i])]);
}

void AxisBank::visit_state(StateArchive& archive) {
  for (AxisChannel& axis : axes_) archive(axis);
}

}  // namespace thermocomp
