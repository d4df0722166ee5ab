/// Voltage of a stacked piezo that moves a tool post, from the commanded offset. Pure.
#pragma once

#include <optional>

#include "drivers/controllers/controller_config.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// Inverse of the measured curve, linear between its points, constant beyond the ends.
/// @return volts; NaN for NaN
[[nodiscard]] double volt_at(const PiezoConfig& config, double displacement_um) noexcept;
/// The measured curve. @return um
[[nodiscard]] double displacement_at(const PiezoConfig& config, double volt) noexcept;

/// Drive of one axis. Each return to 0 V moves the tool, so offsets should change between cuts only
/// (update = "each_cycle" or hold_while_cutting).
class PiezoDrive {
 public:
  explicit PiezoDrive(const PiezoConfig& config);

  /// Call after a lost link: the voltage in effect is unknown.
  void restart() noexcept { known_ = false; }
  /// Call with a voltage read back after that: it is kept, and approached anew only if this drive
  /// knows that it was not reached from 0 V. An amplifier without setpoint rests at 0 V.
  void restart_at(double read_V) noexcept;
  /// @param now  must not run backwards. @return volts within the curve; NaN: nothing to write yet
  [[nodiscard]] double step(nanoseconds now, double offset_um) noexcept;

  /// Takes the amplifier's voltage. If it is neither the one written nor on the way to it, the
  /// offset is approached anew once it is steady.
  void show(nanoseconds now, double read_V) noexcept;
  /// True if the voltage is the setpoint, or has been on its way there since it last was.
  [[nodiscard]] bool obeyed() const noexcept { return obeyed_; }
  /// Offset of the present voltage: while the amplifier obeys, the commanded one, even if it is not
  /// reached yet; else that of the curve, and 0 at rest. NaN: not read.
  [[nodiscard]] double applied_um() const noexcept { return applied_um_; }

 private:
  [[nodiscard]] double next(nanoseconds now, double offset_um) noexcept;

  PiezoConfig config_;
  bool known_{false};    ///< a voltage has been written
  bool zeroing_{false};  ///< at 0 V, on the way to the next
  double volt_{not_a_number};
  double followed_um_{not_a_number};
  double asked_um_{not_a_number};
  nanoseconds asked_since_{};
  nanoseconds zero_since_{};
  std::optional<nanoseconds> written_since_;  ///< time of the last change of voltage
  bool obeyed_{true};
  double applied_um_{not_a_number};
};

}  // namespace thermocomp
