#include "drivers/controllers/make_controller.hpp"

#include "drivers/controllers/bridge_controller.hpp"
#include "drivers/controllers/can_controller.hpp"
#include "drivers/controllers/dry_run_controller.hpp"
#include "drivers/controllers/modbus_controller.hpp"

namespace thermocomp {
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

}  // namespace

std::unique_ptr<ControllerLink> make_controller(const ControllerConfig& config) {
  return std::visit(Maker{}, config);
}

}  // namespace thermocomp
