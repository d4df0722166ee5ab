/// Inputs of a simulated body: operating signals and room air.
#pragma once

#include <cstdint>
#include <vector>

#include "simulator/plant/plant_config.hpp"

namespace thermocomp {

/// One operating signal, a pure function of plant time and seed.
class OperatingSignal {
 public:
  /// @param stream  selects independent random numbers
  OperatingSignal(const SignalConfig& config, std::uint64_t seed, std::uint64_t stream);

  /// @param time_s   plant time, >= 0
  /// @param watched  value of the watched signal (while_above only)
  [[nodiscard]] double value(double time_s, double watched = 0.0);

 private:
  [[nodiscard]] double step_value(double time_s) const;
  [[nodiscard]] double line_value(double time_s) const;
  [[nodiscard]] double random_value(double time_s);

  SignalConfig config_;
  std::uint64_t seed_;
  std::uint64_t stream_;
  std::vector<double> changes_s_;  ///< random: end of piece i; extended as needed
};

/// Temperature of the room's air over a day.
class RoomAir {
 public:
  RoomAir(const RoomConfig& config, std::uint64_t seed);

  /// Advances by one step of plant time; only the slow wander has a state.
  void step(double step_s);
  [[nodiscard]] double temp_degC(double time_s) const;

 private:
  RoomConfig config_;
  std::uint64_t seed_;
  std::uint64_t steps_{0};
  double wander_K_;
};

}  // namespace thermocomp
