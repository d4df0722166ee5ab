/// Link to a controller over Modbus: a dialogue on a line that others may share.
#pragma once

#include <memory>
#include <string>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/controllers/controller_link.hpp"
#include "drivers/controllers/kinds/modbus/modbus_dialogue.hpp"
#include "drivers/modbus/shared_line.hpp"

namespace thermocomp {

class ModbusController final : public ControllerLink {
 public:
  /// @throws InvalidValue for impossible values, DriverError for an impossible line
  explicit ModbusController(const ModbusControllerConfig& config);
  ~ModbusController() override;

  void start() override;
  void stop() noexcept override;
  void newest(ControllerState& state) noexcept override { dialogue_.newest(state); }
  void offer(const OffsetCommand& command) noexcept override {
    dialogue_.offer(command, monotonic_now());
  }
  [[nodiscard]] ControllerHealth health() const override { return dialogue_.health(); }

 private:
  std::string name_;
  std::shared_ptr<SharedLine> line_;
  ModbusDialogue dialogue_;
};

}  // namespace thermocomp
