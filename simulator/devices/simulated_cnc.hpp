/// What the simulated machine controller does with the offsets it is told. Pure: the time is
/// passed in (real time, for that is the time the one who writes lives in).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "simulator/devices/simulated_piezo.hpp"
#include "simulator/plant/machine_config.hpp"
#include "simulator/plant/scripted_events.hpp"

namespace thermocomp {

/// What stands in the controller's registers or came in frames.
struct CncOrder {
  std::vector<double> offset_um;  ///< order of the axes; NaN: never told
  std::uint64_t valid_bits{~std::uint64_t{0}};
  double heartbeat{0.0};
};

/// An axis takes a new offset while its valid bit is set, the offset is within the controller's own
/// bound and the heartbeat has changed within its time; else the applied offset stays where it is.
/// The applied offset follows with time constant and rate.
class SimulatedCnc {
 public:
  explicit SimulatedCnc(const SimulatedController& config);

  /// Something was written. @pre order.offset_um has one value an axis (checked)
  void take(double now_s, const CncOrder& order);
  /// Time passes. @pre now_s does not fall
  /// @return whether the axes were homed just now: what stood in the registers is void
  bool step(double now_s, const ControllerEffect& effect);
  /// Power lost or axes homed: applied and wanted offsets are zero until the next order.
  void forget();

  /// What moves the tool.
  [[nodiscard]] double applied_um(std::size_t axis) const {
    return piezos_.at(axis) ? piezos_[axis]->displacement_um() : applied_um_[axis];
  }
  /// What it says: the offset, of a piezo the voltage.
  [[nodiscard]] double shown(std::size_t axis) const { return applied_um_.at(axis); }
  [[nodiscard]] bool alive() const noexcept { return alive_; }    ///< the heartbeat beats
  [[nodiscard]] bool beaten() const noexcept { return beaten_; }  ///< has it ever

 private:
  SimulatedController config_;
  std::vector<double> wanted_um_;
  std::vector<double> applied_um_;  ///< of a piezo volts, as `wanted_um_`
  std::vector<std::optional<SimulatedPiezo>> piezos_;
  bool rejects_{false};
  bool told_{false};
  bool beaten_{false};
  bool alive_{false};
  double heartbeat_{0.0};
  double beat_at_s_{0.0};
  double stepped_at_s_{0.0};
  std::size_t rehomings_{0};
};

}  // namespace thermocomp
