/// What the sensor drivers are built from: plain structures, filled by config/ or by a test.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

enum class Encoding { int16, uint16, int32, uint32, float32, float64 };
/// Bytes of a value as they come over the wire; the most significant byte is A.
enum class WordOrder { abcd, dcba, badc, cdab };
enum class ModbusTable { coil, discrete_input, holding, input };

/// Registers a value takes: 1, 2 or 4.
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

struct ModbusTcp {
  std::string host;
  int port{502};
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
  bool operator==(const ModbusLine&) const = default;
};

/// A register value that is no temperature but a message of the device.
struct Sentinel {
  std::int64_t code{0};  ///< raw value before scale and offset (of the encoding's signedness)
  Fault fault{Fault::open_circuit};
  bool operator==(const Sentinel&) const = default;
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
  double scale{1.0};  ///< temp = raw * scale + offset_degC
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
  double period_s{1.0};  ///< read every so often
  int registers_per_request_max{125};
  int gap_registers_max{8};  ///< unused registers read along rather than ask twice
  bool one_register_a_request{false};
  std::optional<ModbusRenewal> renewal;
  std::vector<ModbusChannel> channels;
  bool operator==(const ModbusDeviceConfig&) const = default;
};

struct ModbusBusConfig {
  std::string name;
  ModbusLine line;
  std::vector<ModbusDeviceConfig> devices;
  bool operator==(const ModbusBusConfig&) const = default;
};

enum class ByteOrder { little_endian, big_endian };  ///< Intel, Motorola

/// Bits of a CAN frame read as an unsigned number. `start_bit` counts as DBC files do: for
/// little_endian the least significant bit, for big_endian the most significant bit, bit 0 = lowest
/// of byte 0.
struct CanField {
  int start_bit{0};
  int length_bits{8};  ///< 1..64
  ByteOrder byte_order{ByteOrder::little_endian};
  bool operator==(const CanField&) const = default;
};

/// A multiplexor: a number in the frame that says which of several contents the rest of it has.
struct CanSelector {
  /// Numbers from first to last, both included.
  struct Pages {
    std::uint64_t first{0};
    std::uint64_t last{0};
    bool operator==(const Pages&) const = default;
  };
  CanField field;
  std::vector<Pages> pages;  ///< the signal is in the frame while the number is in one of them
  bool operator==(const CanSelector&) const = default;
};

/// A number beside a value that says whether the value is good.
struct CanStatus {
  CanField field;
  std::uint64_t mask{~std::uint64_t{0}};  ///< bits looked at
  /// masked number -> fault (none: good); a number not listed and not 0 is device_error
  std::vector<Sentinel> codes;
  bool operator==(const CanStatus&) const = default;
};

/// Where a value stands in a CAN frame, with the numbering of CanField.
struct CanSignal {
  std::uint32_t id{0};
  bool extended_id{false};
  bool fd{false};  ///< the frame may have up to 64 bytes (CAN FD), else 8
  int start_bit{0};
  int length_bits{16};  ///< 1..64; a float has 32 or 64
  ByteOrder byte_order{ByteOrder::little_endian};
  bool is_signed{true};
  bool is_float{false};
  double scale{1.0};  ///< value = raw * scale + offset
  double offset{0.0};
  std::vector<Sentinel> sentinels;
  std::vector<CanSelector> selectors{};  ///< all must agree; empty: it is in every frame
  std::optional<CanStatus> status{};     ///< in the same frame
  bool operator==(const CanSignal&) const = default;
};

struct CanChannel {
  std::size_t sensor{0};  ///< index of the sensor in the configuration
  CanSignal signal;
  /// A counter or toggle in the same frame; while it stands still, so does the reading's time.
  std::optional<CanField> counter{};
  bool operator==(const CanChannel&) const = default;
};

struct CanDeviceConfig {
  std::string name;
  std::vector<CanChannel> channels;
  bool operator==(const CanDeviceConfig&) const = default;
};

struct CanBusConfig {
  std::string name;
  std::string interface;    ///< "can0"
  double reconnect_s{0.5};  ///< pause before the interface is tried again
  std::vector<CanDeviceConfig> devices;
  bool operator==(const CanBusConfig&) const = default;
};

}  // namespace thermocomp
