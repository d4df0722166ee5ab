/// The temperature of the workshop's air over a day.
#pragma once

#include <cstdint>

#include "simulator/plant/plant_config.hpp"

namespace thermocomp {

class RoomAir {
 public:
  RoomAir(const RoomConfig& config, std::uint64_t seed);

  /// Goes one step of plant time on: only the slow wander has a memory.
  void step(double step_s);
  [[nodiscard]] double temp_degC(double time_s) const;

 private:
  RoomConfig config_;
  std::uint64_t seed_;
  std::uint64_t steps_{0};
  double wander_K_;
};

}  // namespace thermocomp
