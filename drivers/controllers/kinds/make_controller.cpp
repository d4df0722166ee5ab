#include "drivers/controllers/kinds/make_controller.hpp"

#include "drivers/controllers/kinds/bridge_controller.hpp"
#include "drivers/controllers/kinds/can/can_controller.hpp"
#include "drivers/controllers/kinds/dry_run_controller.hpp"
#include "drivers/controllers/kinds/modbus/modbus_controller.hpp"

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
