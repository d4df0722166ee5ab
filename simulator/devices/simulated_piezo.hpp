/// A stacked piezo behind an amplifier: where it stands depends on where it came from. Pure.
#pragma once

#include "simulator/plant/machine_config.hpp"

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

}  // namespace thermocomp
