#include "drivers/controllers/dry_run_controller.hpp"

#include <cmath>

#include "drivers/monotonic_clock.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {
constexpr std::uint32_t only_epoch = 1;
}

DryRunController::DryRunController(DryRunControllerConfig config) : config_(std::move(config)) {
  require(config_.axes <= axes_max, "axes", static_cast<double>(config_.axes),
          "a controller has at most 16 axes");
  for (std::size_t axis = 0; axis < config_.axes; ++axis) applied_.applied_um[axis] = 0.0;
}

void DryRunController::newest(ControllerState& state) noexcept {
  if (commands_.fresh()) {
    const OffsetCommand& command = commands_.front();
    for (std::size_t axis = 0; axis < config_.axes; ++axis) {
      if (command.valid[axis] && std::isfinite(command.offset_um[axis])) {
        applied_.applied_um[axis] = command.offset_um[axis];
      }
    }
  }
  applied_.online = started_.load(std::memory_order_relaxed);
  if (applied_.online) {
    applied_.link_epoch = only_epoch;
    applied_.taken_at = monotonic_now();
  }
  state = applied_;
}

void DryRunController::offer(const OffsetCommand& command) noexcept {
  if (command.link_epoch != only_epoch || !started_.load(std::memory_order_relaxed)) return;
  commands_.back() = command;
  commands_.publish();
  writes_.fetch_add(1, std::memory_order_relaxed);
}

ControllerHealth DryRunController::health() const {
  ControllerHealth health;
  health.name = config_.name;
  health.kind = "dry_run";
  health.connected = started_.load();
  health.connects = health.connected ? 1 : 0;
  health.writes = writes_.load();
  return health;
}

}  // namespace thermocomp
