/// Configuration of the controller drivers.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/can/can_config.hpp"
#include "drivers/modbus/modbus_config.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {

/// Configuration of a piezo drive.
struct PiezoConfig {
  /// Measured displacement over voltage, each voltage approached from 0 V: both strictly increase,
  /// the first voltage is 0 V, and the ends are the limits.
  std::vector<double> curve_V;
  std::vector<double> curve_um;
  bool return_to_zero{true};     ///< to 0 V before each new voltage, against hysteresis
  double settle_s{0.2};          ///< at 0 V
  double steady_s{1.0};          ///< time that an offset must be steady before it is followed
  double step_um{0.2};           ///< minimum change that is followed
  double tolerance_V{1.0};       ///< maximum difference between voltage read back and written
  inline void validate() const;  ///< @throws InvalidValue
  bool operator==(const PiezoConfig&) const = default;
};

namespace detail {

inline void check_increasing(const std::vector<double>& values, const char* key) {
  for (std::size_t i = 0; i < values.size(); ++i) {
    require(std::isfinite(values[i]), key, values[i], "must be finite");
    if (i > 0)
      require(values[i] > values[i - 1], key, values[i],
              "must be more than the value before it: only such a curve can be inverted");
  }
}

}  // namespace detail

inline void PiezoConfig::validate() const {
  require(curve_V.size() >= 2, "curve_V", static_cast<double>(curve_V.size()),
          "must have at least two points");
  require(curve_um.size() == curve_V.size(), "curve_um", static_cast<double>(curve_um.size()),
          "must have as many points as curve_V");
  detail::check_increasing(curve_V, "curve_V");
  detail::check_increasing(curve_um, "curve_um");
  require(curve_V.front() == 0.0, "curve_V", curve_V.front(), "must begin at 0 V");
  require(curve_V.back() <= 1000.0, "curve_V", curve_V.back(), "must be at most 1000 V");
  require(settle_s >= 0 && settle_s <= 10, "settle_s", settle_s, "must be in [0, 10]");
  require(steady_s >= 0 && steady_s <= 600, "steady_s", steady_s, "must be in [0, 600]");
  require(tolerance_V >= 0.001 && tolerance_V <= 100, "tolerance_V", tolerance_V,
          "must be in [0.001, 100]");
  require(step_um >= 0.01 && step_um <= 10, "step_um", step_um, "must be in [0.01, 10]");
}

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

/// An axis whose controller interpolates the offset along its travel. The command has one offset
/// per node, in consecutive entries; the controller takes their set as a whole or not at all.
struct TravelShape {
  static constexpr std::size_t nodes_max = 16;
  std::vector<double> nodes_mm;  ///< increasing; for a line both ends of the travel
  /// Only for a line: the values are K0, the offset at P0 [um], its slope [um/m] and, where it is
  /// written, P0 itself [mm]:  offset = K0 + slope (P - P0).  None: the offset at each node [um].
  std::optional<double> p0_mm;
  bool operator==(const TravelShape&) const = default;
};

/// Registers of a set: one block
///
///     begin | values | end
///
/// where begin and end hold the number of the set, written in one request, lowest address first. A
/// reader that takes `end`, then the values, then `begin`, and finds both equal, has one set only.
struct ModbusTravel : TravelShape {
  ModbusValue begin;
  std::vector<ModbusValue> values;
  ModbusValue end;
  std::vector<ModbusValue> applied;  ///< the same values in effect; empty: not read back
  bool operator==(const ModbusTravel&) const = default;
};

/// Registers of an axis: written offset and applied offset.
struct ModbusAxis {
  ModbusValue offset;
  std::optional<ModbusValue> applied;  ///< none: no read-back
  /// `offset` and `applied` are voltages of an amplifier, not um.
  std::optional<PiezoConfig> piezo{};
  std::optional<ModbusTravel> travel{};  ///< replaces `offset` and `applied`

  /// Number of offsets of this axis in the command.
  [[nodiscard]] std::size_t offsets() const noexcept {
    return travel ? travel->nodes_mm.size() : 1;
  }
  [[nodiscard]] bool reads_back() const noexcept {
    return travel ? !travel->applied.empty() : applied.has_value();
  }
  bool operator==(const ModbusAxis&) const = default;
};

struct ModbusControllerConfig {
  std::string name;
  ModbusLine line;
  int unit{1};
  double period_s{0.1};  ///< of writes and reads
  int registers_per_request_max{125};
  int gap_registers_max{8};  ///< unused registers read along to save a request
  static constexpr int one_register = 6;
  int write_function{16};        ///< or one_register per request
  std::vector<ModbusAxis> axes;  ///< in the order of the configuration, one with all its nodes
  std::vector<ModbusSignal> signals;
  std::optional<ModbusValue> valid_bits;  ///< register: bit i = offset of axis i is valid
  std::optional<ModbusValue> heartbeat;   ///< register: incremented with every write

  [[nodiscard]] std::size_t registers_per_write() const noexcept {
    constexpr int limit = 123;  // of the protocol
    return write_function == one_register
               ? 1
               : static_cast<std::size_t>(std::min(registers_per_request_max, limit));
  }
  [[nodiscard]] std::size_t offsets() const noexcept {
    std::size_t count = 0;
    for (const ModbusAxis& axis : axes) count += axis.offsets();
    return count;
  }
  bool operator==(const ModbusControllerConfig&) const = default;
};

/// Values of one set in one or several frames. Each frame carries the number of the set: frames
/// with the same number belong to one set, however many were lost in between.
struct CanSet {
  static constexpr int number_bits_min = 8;
  static constexpr int number_bits_max = 32;
  std::vector<CanSignal> values;
  std::vector<CanSignal> numbers;  ///< raw counts of equal length, one in each frame with values
  bool operator==(const CanSet&) const = default;
};

/// Over CAN a set arrives frame by frame, with losses: a reader uses it when the newest frames of
/// all its identifiers carry the same number. Numbers wrap around, so frames older than
/// forgotten_after_s() are ignored.
struct CanTravel : TravelShape {
  CanSet sent;
  CanSet applied;  ///< the values in effect, with the number of their set; empty: not read back
  bool operator==(const CanTravel&) const = default;

  /// @param period_s  of the sent frames
  [[nodiscard]] static double forgotten_after_s(double period_s) noexcept {
    constexpr double least_s = 1.0;
    constexpr double periods = 10.0;
    return std::max(least_s, periods * period_s);
  }
};

struct CanAxis {
  CanSignal offset;                   ///< in a frame we send
  std::optional<CanSignal> applied;   ///< in a frame the controller sends
  std::optional<CanTravel> travel{};  ///< replaces `offset` and `applied`
  std::string name{};                 ///< for messages

  /// Number of offsets of this axis in the command.
  [[nodiscard]] std::size_t offsets() const noexcept {
    return travel ? travel->nodes_mm.size() : 1;
  }
  [[nodiscard]] bool reads_back() const noexcept {
    return travel ? !travel->applied.values.empty() : applied.has_value();
  }
  bool operator==(const CanAxis&) const = default;
};
struct CanControllerSignal {
  std::size_t signal{0};
  CanSignal value;
  std::string name{};  ///< for messages
  bool operator==(const CanControllerSignal&) const = default;
};
struct CanControllerConfig {
  std::string name;
  std::string interface;
  double period_s{0.1};
  double silent_after_s{2.0};  ///< offline if a configured frame is missing for this long
  double reconnect_s{0.5};
  std::vector<CanAxis> axes;  ///< in the order of the configuration, one with all its nodes
  std::vector<CanControllerSignal> signals;
  std::optional<CanSignal> valid_bits;  ///< bit i = offset of axis i is valid
  std::optional<CanSignal> heartbeat;

  [[nodiscard]] std::size_t offsets() const noexcept {
    std::size_t count = 0;
    for (const CanAxis& axis : axes) count += axis.offsets();
    return count;
  }
  bool operator==(const CanControllerConfig&) const = default;
};

struct DryRunControllerConfig {
  std::string name;
  std::size_t axes{0};
  bool operator==(const DryRunControllerConfig&) const = default;
};

/// LinuxCNC: its bridge calls the daemon (docs/linuxcnc.md).
struct BridgeControllerConfig {
  std::string name;
  double silent_after_s{1.0};        ///< offline without a report for this long
  std::vector<std::string> axes;     ///< names in the bridge, in the order of the configuration
  std::vector<std::string> signals;  ///< names in the bridge, in the order of the configuration
  bool operator==(const BridgeControllerConfig&) const = default;
};

using ControllerConfig = std::variant<DryRunControllerConfig, ModbusControllerConfig,
                                      CanControllerConfig, BridgeControllerConfig>;

}  // namespace thermocomp
