#include "estimator/pipeline/mode_decision.hpp"

#include <chrono>

namespace thermocomp {

ModeDecision::ModeDecision(const CompensationConfig& config)
    : gives_up_(config.on_loss == LossPolicy::ramp_to_zero),
      hold_(std::chrono::duration_cast<nanoseconds>(seconds_d(config.hold_s))) {
  state_.enabled = config.enabled_at_first_start;
}

Mode ModeDecision::step(const ModeInput& input) noexcept {
  if (input.time.first) state_.lost_since = input.time.now;
  const bool works = input.displacement_known && input.controller_online && input.axes_synced &&
                     input.controller_written;
  if (works) {
    state_.ever_worked = true;
    state_.lost_since = input.time.now;
  }
  const Mode next = decide(input, works);
  if (next != state_.mode) {
    state_.mode = next;
    state_.mode_since = input.time.now;
  }
  return next;
}

Mode ModeDecision::decide(const ModeInput& input, bool works) const noexcept {
  if (!state_.enabled || input.controller_disables) return Mode::disabled;
  const bool given_up = !works && gives_up_ && input.time.now - state_.lost_since > hold_;
  if (state_.stopping || given_up) return Mode::ramping_to_zero;
  if (works) return Mode::compensating;
  return state_.ever_worked ? Mode::holding : Mode::starting;
}

}  // namespace thermocomp
