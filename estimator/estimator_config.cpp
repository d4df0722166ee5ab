#include "estimator/estimator_config.hpp"

#include "estimator/checks.hpp"

namespace thermocomp {

void ScreeningConfig::validate() const {
  require_numbers(*this);
  require(temp_degC_min < temp_degC_max, "temp_degC_min", temp_degC_min,
          "must be below temp_degC_max");
}

void CompensationConfig::validate() const {
  require_numbers(*this);
  require(suspected_sensors != SuspectedPolicy::weigh_down || estimate_lost_blocks,
          "estimate_lost_blocks", 0.0, "must be true where suspected_sensors is \"weigh_down\"");
}

}  // namespace thermocomp
