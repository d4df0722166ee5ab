/// Configuration of Modbus lines and of the devices with temperatures on them.
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
/// Byte order on the wire; A is the most significant byte.
enum class WordOrder { abcd, dcba, badc, cdab };
/// data_block: a word of an S7 CPU's data block.
enum class ModbusTable { coil, discrete_input, holding, input, data_block };

/// Registers per value: 1, 2 or 4.
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

/// Words per value in a table; a coil or discrete input is one word, 0 or 1.
[[nodiscard]] constexpr std::size_t words_of(ModbusTable table, Encoding encoding) noexcept {
  return is_bit_table(table) ? 1 : registers_of(encoding);
}

/// One data block of an S7 CPU over ISO-on-TCP: register n is bytes 2 n and 2 n + 1.
struct S7Block {
  static constexpr int port = 102;
  static constexpr int slots = 32;
  static constexpr int byte_max = 65534;
  static constexpr std::size_t pdu_bytes = 240;     ///< granted by every CPU
  static constexpr int registers_per_request{106};  ///< largest write in one PDU
  int db{1};
  int rack{0};
  int slot{1};
  bool operator==(const S7Block&) const = default;
};

struct ModbusTcp {
  std::string host;
  int port{502};
  bool rtu_frames{false};  ///< serial frames over TCP: a serial server that passes bytes on
  bool datagrams{false};   ///< UDP
  std::optional<S7Block> s7{};
  bool operator==(const ModbusTcp&) const = default;
};
struct ModbusRtu {
  std::string device;
  int baud{9600};
  char parity{'N'};  ///< 'N', 'E' or 'O'
  int data_bits{8};
  int stop_bits{1};
  bool rs485{false};  ///< the kernel switches the transceiver's direction (TIOCSRS485)
  bool operator==(const ModbusRtu&) const = default;
};

/// Timing of a Modbus line, shared by sensors and controllers.
struct ModbusLine {
  std::variant<ModbusTcp, ModbusRtu> link;
  double timeout_ms{200.0};           ///< per answer
  double inter_frame_delay_ms{-1.0};  ///< silence between frames; negative: 3.5 characters, 1.75 ms
                                      ///< above 19200 baud; TCP: 0
  double reconnect_s{1.0};            ///< pause between attempts to connect
  double backoff_s_max{30.0};         ///< longest pause between requests to a dead unit
  int retries{1};                     ///< of one request before it counts as failed
  /// TCP, UDP: any transaction id is accepted; late answers are recognised as on a serial line.
  bool ignore_transaction{false};
  bool operator==(const ModbusLine&) const = default;
};

/// A register or bit that shows whether the value is good.
struct ModbusStatus {
  ModbusTable table{ModbusTable::discrete_input};
  std::uint16_t address{0};    ///< 0-based, as on the wire
  std::uint16_t mask{0xFFFF};  ///< bits used (registers only)
  /// masked value -> fault; a value that is not listed and not 0 is device_error
  std::vector<Sentinel> codes;
  bool operator==(const ModbusStatus&) const = default;
};

struct ModbusChannel {
  std::size_t sensor{0};  ///< index of the sensor in the configuration
  ModbusTable table{ModbusTable::input};
  std::uint16_t address{0};  ///< 0-based, as on the wire
  Encoding encoding{Encoding::int16};
  WordOrder word_order{WordOrder::abcd};
  std::uint16_t mask{0xFFFF};  ///< bits of a 16-bit value that are the number
  double scale{1.0};           ///< temp = raw * scale + offset_degC
  double offset_degC{0.0};
  std::vector<Sentinel> sentinels;
  std::optional<ModbusStatus> status;
  bool operator==(const ModbusChannel&) const = default;
};

/// A register that the device changes with each conversion; while it does not change, neither do
/// the times of its readings.
struct ModbusRenewal {
  ModbusTable table{ModbusTable::input};
  std::uint16_t address{0};
  bool operator==(const ModbusRenewal&) const = default;
};

struct ModbusDeviceConfig {
  std::string name;
  int unit{1};           ///< 0..247 (255 on TCP)
  double period_s{1.0};  ///< interval of reading it
  int registers_per_request_max{125};
  int gap_registers_max{8};  ///< unused registers that a request may include
  bool one_register_a_request{false};
  bool wide_registers{false};  ///< 32-bit registers: one address per value, answer of 4 bytes
  std::optional<ModbusRenewal> renewal;
  std::vector<ModbusChannel> channels;
  bool operator==(const ModbusDeviceConfig&) const = default;
};

/// Values of the key `kind` of a line.
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
