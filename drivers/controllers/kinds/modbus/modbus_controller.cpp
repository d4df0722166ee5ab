#include "drivers/controllers/kinds/modbus/modbus_controller.hpp"

namespace thermocomp {
namespace {

/// How long stop() lets an exchange and the last write end by themselves.
constexpr std::chrono::milliseconds stop_patience{600};

}  // namespace

ModbusController::ModbusController(const ModbusControllerConfig& config)
    : name_(config.name), connection_(config.line), dialogue_(config, connection_) {}

ModbusController::~ModbusController() {
  stop();
}

void ModbusController::start() {
  thread_.start(name_, [this] {
    run();
    const std::scoped_lock lock(done_mutex_);
    done_ = true;
    done_changed_.notify_all();
  });
}

void ModbusController::run() {
  while (!dialogue_.ending()) {
    wake_.wait_until(dialogue_.next_action_at());
    if (!dialogue_.ending()) dialogue_.act();
  }
  dialogue_.end();
}

void ModbusController::stop() noexcept {
  dialogue_.end_soon();
  wake_.signal();
  if (thread_.running()) {
    std::unique_lock lock(done_mutex_);
    const auto until = std::chrono::steady_clock::now() + stop_patience;
    // wait_until the monotonic clock: a step of the wall clock must not prolong the stop.
    done_changed_.wait_until(lock, until, [this] { return done_; });
  }
  connection_.cancel();
  thread_.join();
}

}  // namespace thermocomp
