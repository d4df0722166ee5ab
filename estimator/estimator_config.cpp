#include "estimator/estimator_config.hpp"

#include "estimator/checks.hpp"

namespace thermocomp {

void ScreeningConfig::validate() const {
  require(temp_degC_min >= -273.15, "temp_degC_min", temp_degC_min, "must be at least -273.15");
  require(temp_degC_max <= 2000, "temp_degC_max", temp_degC_max, "must be at most 2000");
  require(temp_degC_min < temp_degC_max, "temp_degC_min", temp_degC_min,
          "must be below temp_degC_max");
  require(stale_after_s > 0 && stale_after_s <= 3600, "stale_after_s", stale_after_s,
          "must be in (0, 3600]");
  require(rate_K_per_s_max > 0 && rate_K_per_s_max <= 1e6, "rate_K_per_s_max", rate_K_per_s_max,
          "must be in (0, 1e6]");
  require(rate_allowance_K >= 0 && rate_allowance_K <= 1000, "rate_allowance_K", rate_allowance_K,
          "must be in [0, 1000]");
  require(outage_K_max >= 0 && outage_K_max <= 1000, "outage_K_max", outage_K_max,
          "must be in [0, 1000]");
  require(settle_s >= 0 && settle_s <= 3600, "settle_s", settle_s, "must be in [0, 3600]");
  require(stuck_after_s >= 0 && stuck_after_s <= 1e6, "stuck_after_s", stuck_after_s,
          "must be in [0, 1e6]");
}

void SmoothingConfig::validate() const {
  require(period_s >= 0 && period_s <= 3600, "period_s", period_s, "must be in [0, 3600]");
  require(samples >= 3 && samples <= 32, "samples", static_cast<double>(samples),
          "must be a whole number in [3, 32]");
  require(blocks >= 1 && blocks <= smoothing_blocks_max, "blocks", static_cast<double>(blocks),
          "must be a whole number in [1, 6]");
  require(half_width_K > 0 && half_width_K <= 100, "half_width_K", half_width_K,
          "must be in (0, 100]");
  require(outage_s > 0 && outage_s <= 86400, "outage_s", outage_s, "must be in (0, 86400]");
}

void LimiterConfig::validate() const {
  require(offset_um_max > 0 && offset_um_max <= offset_um_max_of_any_axis, "offset_um_max",
          offset_um_max, "must be in (0, 500]");
  require(rate_um_per_s_max > 0 && rate_um_per_s_max <= 1000, "rate_um_per_s_max",
          rate_um_per_s_max, "must be in (0, 1000]");
}

void CompensationConfig::validate() const {
  require(cycles_per_update >= 1 && cycles_per_update <= 1'000'000, "cycles_per_update",
          static_cast<double>(cycles_per_update), "must be in [1, 1000000]");
  require(cycle_ahead >= 0 && cycle_ahead <= 1, "cycle_ahead", cycle_ahead, "must be in [0, 1]");
  require(hold_s >= 0 && hold_s <= 1e6, "hold_s", hold_s, "must be in [0, 1e6]");
  require(stop_ramp_s_max > 0 && stop_ramp_s_max <= 3600, "stop_ramp_s_max", stop_ramp_s_max,
          "must be in (0, 3600]");
  require(controller_stale_after_s > 0 && controller_stale_after_s <= 3600,
          "controller_stale_after_s", controller_stale_after_s, "must be in (0, 3600]");
  require(mismatch_um > 0 && mismatch_um <= 500, "mismatch_um", mismatch_um, "must be in (0, 500]");
  require(mismatch_after_s > 0 && mismatch_after_s <= 3600, "mismatch_after_s", mismatch_after_s,
          "must be in (0, 3600]");
  require(restart_leap_um_max > 0 && restart_leap_um_max <= 500, "restart_leap_um_max",
          restart_leap_um_max, "must be in (0, 500]");
  require(offset_sd_um_max > 0 && offset_sd_um_max <= 500, "offset_sd_um_max", offset_sd_um_max,
          "must be in (0, 500]");
  require(suspected_sensors != SuspectedPolicy::weigh_down || estimate_lost_blocks,
          "estimate_lost_blocks", 0.0, "must be true where suspected_sensors is \"weigh_down\"");
  require(warm_um > 0 && warm_um <= 500, "warm_um", warm_um, "must be in (0, 500]");
  require(prove_um_max > 0 && prove_um_max <= 50, "prove_um_max", prove_um_max,
          "must be in (0, 50]");
  require(prove_hold_s >= 0 && prove_hold_s <= 60, "prove_hold_s", prove_hold_s,
          "must be in [0, 60]");
}

}  // namespace thermocomp
