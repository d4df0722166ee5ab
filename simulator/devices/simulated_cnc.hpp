/// What the simulated machine controller does with the offsets it is told. Pure: the time is
/// passed in (real time, for that is the time the one who writes lives in).
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "simulator/plant/machine_config.hpp"
#include "simulator/plant/scripted_events.hpp"

namespace thermocomp {

/// A play of `dead_band_V` between the voltage and what the stack feels of it: v follows u within
/// u - dead_band_V <= v <= u, and the displacement is the curve at v. So after every turn nothing
/// moves for the dead band, rising and falling voltage give two branches a dead band apart, and
/// whoever comes from 0 V is always on the rising one.
class SimulatedPiezo {
 public:
  /// @pre the curve is as SimulatedPiezoConfig says
  explicit SimulatedPiezo(const SimulatedPiezoConfig& config);

  /// @return displacement [um]. NaN leaves it where it is.
  double step(double volt) noexcept;
  [[nodiscard]] double displacement_um() const noexcept;

 private:
  SimulatedPiezoConfig config_;
  double felt_V_{0.0};
};

/// What stands in the controller's registers or came in frames.
struct CncOrder {
  /// Order of the axes, of one that it interpolates along its travel all nodes; NaN: never told.
  std::vector<double> offset_um;
  std::uint64_t valid_bits{~std::uint64_t{0}};
  double heartbeat{0.0};
  /// One an axis: the number of its set, where that is shown with what is applied; else empty.
  std::vector<std::uint64_t> set_numbers{};
};

/// An axis takes a new offset while its valid bit is set, the offset is within the controller's own
/// bound and the heartbeat has changed within its time; else the applied offset stays where it is.
/// The applied offset follows with time constant and rate; of a travel that of each node, all of
/// them or none taken, and the tool follows what lies between them where its slide stands.
class SimulatedCnc {
 public:
  explicit SimulatedCnc(const SimulatedController& config);

  /// Something was written. @pre order.offset_um has one value an axis or node (checked)
  void take(double now_s, const CncOrder& order);
  /// Time passes. @pre now_s does not fall
  /// @return whether the axes were homed just now: what stood in the registers is void
  bool step(double now_s, const ControllerEffect& effect);
  /// Power lost or axes homed: applied and wanted offsets are zero until the next order.
  void forget();

  /// It looks at the slide of an axis that it interpolates, as often as this is called; the tool
  /// follows, also without a heartbeat. @pre now_s does not fall; the axis has a travel
  void stand_at(std::size_t axis, double now_s, double position_mm);

  /// What moves the tool.
  [[nodiscard]] double applied_um(std::size_t axis) const {
    if (config_.axes[axis].travel) return tool_um_.at(axis);
    return piezos_.at(axis) ? piezos_[axis]->displacement_um() : applied_um_[first_[axis]];
  }
  /// What it says: the offset, of a piezo the voltage.
  [[nodiscard]] double shown(std::size_t axis) const { return nodes(axis).front(); }
  /// Of a travel the offset of each node.
  [[nodiscard]] std::span<const double> nodes(std::size_t axis) const {
    return std::span(applied_um_).subspan(first_.at(axis), config_.axes[axis].offsets());
  }
  /// The number of the set that is in effect; 0 before the first.
  [[nodiscard]] std::uint64_t set_number(std::size_t axis) const { return set_numbers_.at(axis); }
  /// Where the offsets of an axis begin among those of an order.
  [[nodiscard]] std::size_t first(std::size_t axis) const { return first_.at(axis); }
  [[nodiscard]] bool alive() const noexcept { return alive_; }    ///< the heartbeat beats
  [[nodiscard]] bool beaten() const noexcept { return beaten_; }  ///< has it ever

 private:
  void take_axis(std::size_t axis, const CncOrder& order);
  void step_axis(std::size_t axis, double dt_s, double misapplied_um);
  [[nodiscard]] double between_nodes_um(std::size_t axis, double position_mm) const;

  SimulatedController config_;
  std::vector<std::size_t> first_;  ///< one an axis, among the offsets
  std::vector<double> wanted_um_;
  std::vector<double> applied_um_;   ///< of a piezo volts, as `wanted_um_`
  std::vector<double> tool_um_;      ///< one an axis: what is interpolated
  std::vector<double> looked_at_s_;  ///< one an axis
  std::vector<std::uint64_t> set_numbers_;
  std::vector<std::optional<SimulatedPiezo>> piezos_;
  bool rejects_{false};
  bool has_order_{false};
  bool beaten_{false};
  bool alive_{false};
  double heartbeat_{0.0};
  double beat_at_s_{0.0};
  double stepped_at_s_{0.0};
  std::size_t rehomings_{0};
};

}  // namespace thermocomp
