/// What the controller drivers are built from: plain structures, filled by config/ or by a test.
#pragma once

#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/can/can_config.hpp"
#include "drivers/controllers/piezo_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

/// A number in the controller's Modbus registers.
struct ModbusValue {
  ModbusTable table{ModbusTable::holding};
  std::uint16_t address{0};  ///< 0-based, as on the wire
  Encoding encoding{Encoding::int16};
  WordOrder word_order{WordOrder::abcd};
  double scale{1.0};  ///< value = raw * scale (um for offsets)
  bool operator==(const ModbusValue&) const = default;
};

struct ModbusSignal {
  std::size_t signal{0};  ///< index of the signal in the configuration
  ModbusValue value;
  bool operator==(const ModbusSignal&) const = default;
};

/// Per axis: where the offset is written and where the controller shows what it applies.
struct ModbusAxis {
  ModbusValue offset;
  std::optional<ModbusValue> applied;  ///< none: the controller does not read back
  /// `offset` takes volts of an amplifier, not um, and `applied` shows volts.
  std::optional<PiezoConfig> piezo{};
  bool operator==(const ModbusAxis&) const = default;
};

struct ModbusControllerConfig {
  std::string name;
  ModbusLine line;
  int unit{1};
  double period_s{0.1};          ///< write and read every so often
  std::vector<ModbusAxis> axes;  ///< order of the configuration's axes
  std::vector<ModbusSignal> signals;
  std::optional<ModbusValue> valid_bits;  ///< register: bit i = offset of axis i is valid
  std::optional<ModbusValue> heartbeat;   ///< register: counts up with every write
  bool operator==(const ModbusControllerConfig&) const = default;
};

struct CanAxis {
  CanSignal offset;                  ///< in a frame we send
  std::optional<CanSignal> applied;  ///< in a frame the controller sends
  bool operator==(const CanAxis&) const = default;
};
struct CanControllerSignal {
  std::size_t signal{0};
  CanSignal value;
  bool operator==(const CanControllerSignal&) const = default;
};
struct CanControllerConfig {
  std::string name;
  std::string interface;
  double period_s{0.1};
  double silent_after_s{2.0};  ///< any configured frame missing for so long: offline
  double reconnect_s{0.5};
  std::vector<CanAxis> axes;
  std::vector<CanControllerSignal> signals;
  std::optional<CanSignal> valid_bits;
  std::optional<CanSignal> heartbeat;
  bool operator==(const CanControllerConfig&) const = default;
};

/// No controller at all, or one that is only read (make_controller.hpp).
struct DryRunControllerConfig {
  std::string name;
  std::size_t axes{0};
  bool operator==(const DryRunControllerConfig&) const = default;
};

/// LinuxCNC: a bridge of its own calls the daemon (docs/linuxcnc.md).
struct BridgeControllerConfig {
  std::string name;
  double silent_after_s{1.0};        ///< without a report: offline
  std::vector<std::string> axes;     ///< as the bridge calls them, order of the configuration's
  std::vector<std::string> signals;  ///< as the bridge calls them, order of the configuration's
  bool operator==(const BridgeControllerConfig&) const = default;
};

using ControllerConfig = std::variant<DryRunControllerConfig, ModbusControllerConfig,
                                      CanControllerConfig, BridgeControllerConfig>;

}  // namespace thermocomp
