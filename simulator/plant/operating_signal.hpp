/// What the machine does over time: one signal, a pure function of plant time and seed.
#pragma once

#include <cstdint>
#include <vector>

#include "simulator/plant/plant_config.hpp"

namespace thermocomp {

class OperatingSignal {
 public:
  /// @param stream  tells the random choices of several signals apart
  OperatingSignal(const SignalConfig& config, std::uint64_t seed, std::uint64_t stream);

  /// @param time_s   plant time, >= 0
  /// @param watched  the watched signal at that time (while_above only)
  [[nodiscard]] double value(double time_s, double watched = 0.0);

 private:
  [[nodiscard]] double step_value(double time_s) const;
  [[nodiscard]] double line_value(double time_s) const;
  [[nodiscard]] double random_value(double time_s);

  SignalConfig config_;
  std::uint64_t seed_;
  std::uint64_t stream_;
  std::vector<double> changes_s_;  ///< random: when piece i ends; grows as time goes on
};

}  // namespace thermocomp
