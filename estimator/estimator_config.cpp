#include "estimator/estimator_config.hpp"

#include "estimator/checks.hpp"

namespace thermocomp {

void ScreeningConfig::validate() const {
  require_numbers(*this);
  require(temp_degC_min < temp_degC_max, "temp_degC_min", temp_degC_min,
          "must be below temp_degC_max");
}

void SmoothingConfig::validate() const {
  require_numbers(*this);
  require(samples >= 3 && samples <= 32, "samples", static_cast<double>(samples),
          "must be a whole number in [3, 32]");
  require(blocks >= 1 && blocks <= smoothing_blocks_max, "blocks", static_cast<double>(blocks),
          "must be a whole number in [1, 6]");
}

void CompensationConfig::validate() const {
  require_numbers(*this);
  require(cycles_per_update >= 1 && cycles_per_update <= 1'000'000, "cycles_per_update",
          static_cast<double>(cycles_per_update), "must be in [1, 1000000]");
  require(suspected_sensors != SuspectedPolicy::weigh_down || estimate_lost_blocks,
          "estimate_lost_blocks", 0.0, "must be true where suspected_sensors is \"weigh_down\"");
}

}  // namespace thermocomp
