/// The voltage of a stacked piezo that moves a tool post, from the offset that is asked for: pure.
#pragma once

#include "drivers/controllers/piezo_config.hpp"
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
  /// @param now  must not run backwards. @return volts within the curve; NaN: nothing to write yet
  [[nodiscard]] double step(nanoseconds now, double offset_um) noexcept;

 private:
  PiezoConfig config_;
  bool known_{false};    ///< a voltage has been written
  bool zeroing_{false};  ///< at 0 V, on the way to the next
  double volt_{not_a_number};
  double followed_um_{not_a_number};
  double asked_um_{not_a_number};
  nanoseconds asked_since_{};
  nanoseconds zero_since_{};
};

}  // namespace thermocomp
