/// Modbus lines, and devices with temperatures on them: plain structures, filled by config/ or by a
/// test.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/bus.hpp"

namespace thermocomp {

enum class Encoding { int16, uint16, int32, uint32, float32, float64 };
/// Bytes of a value as they come over the wire; the most significant byte is A.
enum class WordOrder { abcd, dcba, badc, cdab };
/// The last is of an S7 CPU: a word of a data block.
enum class ModbusTable { coil, discrete_input, holding, input, data_block };

/// Number of registers a value takes: 1, 2 or 4.
[[nodiscard]] constexpr std::size_t registers_of(Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::int16:
    case Encoding::uint16:
      return 1;
    case Encoding::int32:
    case Encoding::uint32:
    case Encoding::float32:
      return 2;
    case Encoding::float64:
      break;
  }
  return 4;
}

[[nodiscard]] constexpr bool is_bit_table(ModbusTable table) noexcept {
  return table == ModbusTable::coil || table == ModbusTable::discrete_input;
}

/// Words a value takes in a table; a coil or discrete input is one word, 0 or 1.
[[nodiscard]] constexpr std::size_t words_of(ModbusTable table, Encoding encoding) noexcept {
  return is_bit_table(table) ? 1 : registers_of(encoding);
}

/// One data block of an S7 CPU, over ISO-on-TCP: register n is its bytes 2 n and 2 n + 1.
struct S7Block {
  static constexpr int port = 102;
  static constexpr int slots = 32;
  static constexpr int byte_max = 65534;
  static constexpr std::size_t pdu_bytes = 240;     ///< every CPU grants as many
  static constexpr int registers_per_request{106};  ///< that can be written in one PDU
  int db{1};
  int rack{0};
  int slot{1};
  bool operator==(const S7Block&) const = default;
};

struct ModbusTcp {
  std::string host;
  int port{502};
  bool rtu_frames{false};  ///< as on a serial line: a serial server that passes bytes on
  bool datagrams{false};   ///< UDP
  std::optional<S7Block> s7{};
  bool operator==(const ModbusTcp&) const = default;
};
struct ModbusRtu {
  std::string device;  ///< "/dev/ttyUSB0"
  int baud{9600};
  char parity{'N'};  ///< 'N', 'E' or 'O'
  int data_bits{8};
  int stop_bits{1};
  bool rs485{false};  ///< let the kernel drive the transceiver's direction (TIOCSRS485)
  bool operator==(const ModbusRtu&) const = default;
};

/// Timing of a Modbus line, shared by sensors and controllers.
struct ModbusLine {
  std::variant<ModbusTcp, ModbusRtu> link;
  double timeout_ms{200.0};           ///< for one answer
  double inter_frame_delay_ms{-1.0};  ///< silence between frames; negative: 3.5 characters, 1.75 ms
                                      ///< above 19200 baud; TCP: 0
  double reconnect_s{1.0};            ///< pause before a connection is tried again
  double backoff_s_max{30.0};         ///< longest pause before a dead unit is asked again
  int retries{1};                     ///< further tries of one request before it has failed
  /// TCP, UDP: answers carry any transaction number; late ones are recognised as on a serial line.
  bool ignore_transaction{false};
  bool operator==(const ModbusLine&) const = default;
};

/// A register or bit beside the value that says whether the value is good.
struct ModbusStatus {
  ModbusTable table{ModbusTable::discrete_input};
  std::uint16_t address{0};    ///< 0-based, as on the wire
  std::uint16_t mask{0xFFFF};  ///< bits looked at (registers only)
  /// masked value -> fault; a value not listed and not 0 is device_error
  std::vector<Sentinel> codes;
  bool operator==(const ModbusStatus&) const = default;
};

struct ModbusChannel {
  std::size_t sensor{0};  ///< index of the sensor in the configuration
  ModbusTable table{ModbusTable::input};
  std::uint16_t address{0};  ///< 0-based, as on the wire
  Encoding encoding{Encoding::int16};
  WordOrder word_order{WordOrder::abcd};
  std::uint16_t mask{0xFFFF};  ///< of a 16-bit value: the bits that are the number
  double scale{1.0};           ///< temp = raw * scale + offset_degC
  double offset_degC{0.0};
  std::vector<Sentinel> sentinels;
  std::optional<ModbusStatus> status;
  bool operator==(const ModbusChannel&) const = default;
};

/// A register that the device changes with each conversion; while it stands still, so do the times
/// of the device's readings.
struct ModbusRenewal {
  ModbusTable table{ModbusTable::input};
  std::uint16_t address{0};
  bool operator==(const ModbusRenewal&) const = default;
};

struct ModbusDeviceConfig {
  std::string name;
  int unit{1};           ///< 0..247 (255 on TCP)
  double period_s{1.0};  ///< how often it is read
  int registers_per_request_max{125};
  int gap_registers_max{8};  ///< unused registers read along to save a request
  bool one_register_a_request{false};
  bool wide_registers{false};  ///< a register has 32 bits: a value one address, its answer 4 bytes
  std::optional<ModbusRenewal> renewal;
  std::vector<ModbusChannel> channels;
  bool operator==(const ModbusDeviceConfig&) const = default;
};

/// What the key `kind` of a line may say.
inline constexpr std::array modbus_kinds{"modbus_tcp", "modbus_rtu", "modbus_rtu_over_tcp",
                                         "modbus_udp"};
[[nodiscard]] constexpr const char* kind_of(const ModbusLine& line) noexcept {
  const auto* tcp = std::get_if<ModbusTcp>(&line.link);
  if (tcp == nullptr) return modbus_kinds[1];
  if (tcp->s7) return "s7";
  return tcp->rtu_frames ? modbus_kinds[2] : tcp->datagrams ? modbus_kinds[3] : modbus_kinds[0];
}

[[nodiscard]] constexpr const S7Block* s7_of(const ModbusLine& line) noexcept {
  const auto* tcp = std::get_if<ModbusTcp>(&line.link);
  return tcp != nullptr && tcp->s7 ? &*tcp->s7 : nullptr;
}

struct ModbusBusConfig {
  static constexpr auto kinds = modbus_kinds;
  std::string name;
  ModbusLine line;
  std::vector<ModbusDeviceConfig> devices;
  [[nodiscard]] BusOutline outline() const { return {kind_of(line), "", devices.size(), "device"}; }
  bool operator==(const ModbusBusConfig&) const = default;
};

}  // namespace thermocomp
