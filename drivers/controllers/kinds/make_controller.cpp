#include "drivers/controllers/kinds/make_controller.hpp"

#include <cmath>

#include "drivers/bus_thread.hpp"
#include "drivers/controllers/kinds/bridge_controller.hpp"
#include "drivers/controllers/kinds/can/can_controller.hpp"
#include "drivers/controllers/kinds/modbus/modbus_controller.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr std::uint32_t only_epoch = 1;

std::array<double, axes_max> all_unknown() noexcept {
  std::array<double, axes_max> values{};
  values.fill(not_a_number);
  return values;
}

}  // namespace

DryRunController::DryRunController(DryRunControllerConfig config,
                                   std::unique_ptr<ControllerLink> read)
    : config_(std::move(config)),
      read_(std::move(read)),
      applied_um_(all_unknown()),
      shown_um_(all_unknown()) {
  require(config_.axes <= axes_max, "axes", static_cast<double>(config_.axes),
          "a controller has at most 16 axes");
  for (std::size_t axis = 0; axis < config_.axes; ++axis) applied_um_[axis] = 0.0;
}

void DryRunController::start() {
  if (read_) read_->start();
  started_.store(true);
}

void DryRunController::stop() noexcept {
  started_.store(false);
  if (read_) read_->stop();
}

void DryRunController::newest(ControllerState& state) noexcept {
  read_state(state);
  // Between two read-backs the values do not change.
  if (state.online && state.taken_at != read_at_) {
    read_at_ = state.taken_at;
    apply_offered(state.link_epoch);
  }
  state.applied_um = applied_um_;
  state.written = state.online;  // a dry run counts offsets as written
}

void DryRunController::read_state(ControllerState& state) noexcept {
  if (read_) {
    read_->newest(state);
    shown_um_.back() = state.applied_um;
    shown_um_.publish();
    return;
  }
  state = {};
  state.online = started_.load(std::memory_order_relaxed);
  if (!state.online) return;
  state.link_epoch = only_epoch;
  state.taken_at = monotonic_now();
}

void DryRunController::apply_offered(std::uint32_t link_epoch) noexcept {
  commands_.fresh();
  const OffsetCommand& command = commands_.front();
  if (command.link_epoch != link_epoch) return;
  for (std::size_t axis = 0; axis < config_.axes; ++axis)
    if (command.valid[axis] && std::isfinite(command.offset_um[axis]))
      applied_um_[axis] = command.offset_um[axis];
}

void DryRunController::offer(const OffsetCommand& command) noexcept {
  commands_.back() = command;
  commands_.publish();
}

ControllerHealth DryRunController::health() const {
  if (read_) {
    ControllerHealth health = read_->health();
    shown_um_.fresh();
    health.shown_um = shown_um_.front();
    return health;
  }
  ControllerHealth health;
  health.name = config_.name;
  health.kind = "dry_run";
  health.connected = started_.load();
  health.connects = health.connected ? 1 : 0;
  return health;
}

namespace {

struct Maker {
  std::unique_ptr<ControllerLink> operator()(const DryRunControllerConfig& config) const {
    return std::make_unique<DryRunController>(config);
  }
  std::unique_ptr<ControllerLink> operator()(const ModbusControllerConfig& config) const {
    return std::make_unique<ModbusController>(config);
  }
  std::unique_ptr<ControllerLink> operator()(const CanControllerConfig& config) const {
    return std::make_unique<CanController>(config);
  }
  std::unique_ptr<ControllerLink> operator()(const BridgeControllerConfig& config) const {
    return std::make_unique<BridgeController>(config);
  }
};

struct AxesCounter {
  std::size_t operator()(const DryRunControllerConfig& config) const { return config.axes; }
  std::size_t operator()(const BridgeControllerConfig& config) const { return config.axes.size(); }
  template <class Config>
  std::size_t operator()(const Config& config) const {
    return config.offsets();
  }
};

}  // namespace

std::unique_ptr<ControllerLink> make_controller(const ControllerConfig& config, bool dry_run) {
  std::unique_ptr<ControllerLink> link = std::visit(Maker{}, config);
  if (!dry_run || std::holds_alternative<DryRunControllerConfig>(config)) return link;
  const std::string name = std::visit([](const auto& each) { return each.name; }, config);
  return std::make_unique<DryRunController>(
      DryRunControllerConfig{name, std::visit(AxesCounter{}, config)}, std::move(link));
}

}  // namespace thermocomp
