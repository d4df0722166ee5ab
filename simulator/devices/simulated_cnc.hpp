/// Simulated machine controller, without I/O. Times are arguments, in real time.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "simulator/plant/machine_config.hpp"
#include "simulator/plant/scripted_events.hpp"

namespace thermocomp {

/// Play of `dead_band_V`: the effective voltage v follows u within u - dead_band_V <= v <= u; the
/// curve at v is the displacement. After a turn nothing moves for the dead band; there are two
/// branches a dead band apart, and from 0 V only the rising one.
class SimulatedPiezo {
 public:
  /// @pre the curve meets SimulatedPiezoConfig's rules
  explicit SimulatedPiezo(const SimulatedPiezoConfig& config);

  /// @return displacement [um]. NaN changes nothing.
  double step(double volt) noexcept;
  [[nodiscard]] double displacement_um() const noexcept;

 private:
  SimulatedPiezoConfig config_;
  double felt_V_{0.0};
};

struct CncOrder {
  /// In the order of the axes; all nodes of an interpolated axis. NaN: none received.
  std::vector<double> offset_um;
  std::uint64_t valid_bits{~std::uint64_t{0}};
  double heartbeat{0.0};
  /// Set number by axis, if shown with the applied values; else empty.
  std::vector<std::uint64_t> set_numbers{};
};

/// An axis takes a new offset while its valid bit is set, the offset is within the controller's
/// bound and the heartbeat has changed within its timeout; else it keeps the applied offset. The
/// applied offset follows with a time constant and a slew limit. The nodes of a travel are taken as
/// a whole or not at all, and the tool follows the interpolation at the slide's position.
class SimulatedCnc {
 public:
  explicit SimulatedCnc(const SimulatedController& config);

  /// Handles a write. @pre order.offset_um has one value per axis or node (checked)
  void take(double now_s, const CncOrder& order);
  /// Advances the time. @pre now_s does not decrease
  /// @return the axes were homed just now, which voids the registers' values
  bool step(double now_s, const ControllerEffect& effect);
  /// Power loss or homing: applied and wanted offsets are zero until the next order.
  void forget();

  /// Interpolates at the slide's position, also without a heartbeat. @pre now_s does not decrease;
  /// the axis has a travel
  void set_position(std::size_t axis, double now_s, double position_mm);

  /// Offset at the tool.
  [[nodiscard]] double applied_um(std::size_t axis) const {
    if (config_.axes[axis].travel) return tool_um_.at(axis);
    return piezos_.at(axis) ? piezos_[axis]->displacement_um() : applied_um_[first_[axis]];
  }
  /// Reported value: the offset, or a piezo's voltage.
  [[nodiscard]] double shown(std::size_t axis) const { return nodes(axis).front(); }
  [[nodiscard]] std::span<const double> nodes(std::size_t axis) const {
    return std::span(applied_um_).subspan(first_.at(axis), config_.axes[axis].offsets());
  }
  /// Number of the set in effect; 0 before the first.
  [[nodiscard]] std::uint64_t set_number(std::size_t axis) const { return set_numbers_.at(axis); }
  /// Index of the axis' first offset in an order.
  [[nodiscard]] std::size_t first(std::size_t axis) const { return first_.at(axis); }
  [[nodiscard]] bool alive() const noexcept { return alive_; }    ///< the heartbeat changes
  [[nodiscard]] bool beaten() const noexcept { return beaten_; }  ///< it has ever changed

 private:
  void take_axis(std::size_t axis, const CncOrder& order);
  void step_axis(std::size_t axis, double dt_s, double misapplied_um);
  [[nodiscard]] double between_nodes_um(std::size_t axis, double position_mm) const;

  SimulatedController config_;
  std::vector<std::size_t> first_;  ///< by axis: index of its first offset
  std::vector<double> wanted_um_;
  std::vector<double> applied_um_;   ///< volts for a piezo, as in `wanted_um_`
  std::vector<double> tool_um_;      ///< by axis: interpolated offset
  std::vector<double> looked_at_s_;  ///< by axis
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
