#include "drivers/controllers/kinds/modbus/modbus_controller.hpp"

#include <chrono>

namespace thermocomp {
namespace {

/// Time for the present exchange and the last write during stop().
constexpr std::chrono::milliseconds stop_patience{600};

}  // namespace

ModbusController::ModbusController(const ModbusControllerConfig& config)
    : name_(config.name),
      line_(SharedLine::of(config.line)),
      dialogue_(config, line_->connection()) {}

ModbusController::~ModbusController() {
  stop();
}

void ModbusController::start() {
  line_->join(dialogue_, name_);
}

void ModbusController::stop() noexcept {
  dialogue_.end_soon();
  line_->leave(dialogue_, stop_patience);
}

}  // namespace thermocomp
