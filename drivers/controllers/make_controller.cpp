#include "drivers/controllers/make_controller.hpp"

#include <cmath>

#include "drivers/can/signal_codec.hpp"
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

double resolution(const ModbusValue& value) {
  const bool is_float = value.encoding == Encoding::float32 || value.encoding == Encoding::float64;
  return is_float ? 0.0 : std::abs(value.scale);
}

struct Resolutions {
  std::vector<double> operator()(const DryRunControllerConfig& config) const {
    return std::vector<double>(config.axes, 0.0);
  }
  std::vector<double> operator()(const BridgeControllerConfig& config) const {
    return std::vector<double>(config.axes.size(), 0.0);
  }
  template <class WithAxes>
  std::vector<double> operator()(const WithAxes& config) const {
    std::vector<double> resolutions_um;
    for (const auto& axis : config.axes) resolutions_um.push_back(resolution(axis.offset));
    return resolutions_um;
  }
};

}  // namespace

std::unique_ptr<ControllerLink> make_controller(const ControllerConfig& config) {
  return std::visit(Maker{}, config);
}

std::vector<double> offset_resolution_um(const ControllerConfig& config) {
  return std::visit(Resolutions{}, config);
}

}  // namespace thermocomp
