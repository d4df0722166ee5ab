/// The voltage of a stacked piezo that moves a tool post, from the offset that is asked for: pure.
#pragma once

#include <optional>

#include "drivers/controllers/controller_config.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

/// The measured curve inverted, straight between its points; held at the ends.
/// @return volts; NaN for a displacement that is no number
[[nodiscard]] double volt_at(const PiezoConfig& config, double displacement_um) noexcept;
/// The curve itself. @return um
[[nodiscard]] double displacement_at(const PiezoConfig& config, double volt) noexcept;

/// One axis: which voltage to write now. Returning to 0 V takes the tool with it, so offsets should
/// change between cuts only (update = "each_cycle" or hold_while_cutting).
class PiezoDrive {
 public:
  explicit PiezoDrive(const PiezoConfig& config);

  /// After a lost link: the voltage in effect is not known.
  void restart() noexcept { known_ = false; }
  /// The same where it has been read back: what stands there is kept, and need not be reached anew
  /// unless this drive knows that it was not reached from 0 V.
  /// 0 V is the rest of an amplifier that has no setpoint yet.
  void restart_at(double read_V) noexcept;
  /// @param now  must not run backwards. @return volts within the curve; NaN: nothing to write yet
  [[nodiscard]] double step(nanoseconds now, double offset_um) noexcept;

  /// What the amplifier shows. When it is neither the voltage written nor on the way to it, the
  /// offset is driven to anew once it stands still.
  void show(nanoseconds now, double read_V) noexcept;
  /// Whether it showed its setpoint, or went there from where it did.
  [[nodiscard]] bool obeyed() const noexcept { return obeyed_; }
  /// Which offset that stands for: while it obeys, the one asked for, even where that is still
  /// waited for or too near to be followed; else what the curve says, and 0 at rest. NaN: not read.
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
  std::optional<nanoseconds> written_since_;  ///< another voltage than before
  bool obeyed_{true};
  double applied_um_{not_a_number};
};

}  // namespace thermocomp
