/// Requests for all values of a Modbus device, and the place of each value in the answers. Pure.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

inline constexpr int registers_per_request_limit = 125;  ///< of the protocol
inline constexpr int bits_per_request_limit = 2000;      ///< of the protocol

/// Read of `count` registers or bits of one table from `address` on.
struct PlannedRequest {
  ModbusTable table{ModbusTable::input};
  std::uint16_t address{0};  ///< 0-based
  std::uint16_t count{0};
};

/// Place of a value's first register or bit in the answers.
struct WordPlace {
  std::size_t request{0};  ///< index into ModbusPlan::requests
  std::size_t offset{0};   ///< words from the answer's first
};

struct ChannelPlace {
  WordPlace value;
  std::optional<WordPlace> status;
};

struct ModbusPlan {
  std::size_t words_a_register{1};  ///< in the answers; 2: of 32-bit registers
  std::vector<PlannedRequest> requests;
  std::vector<ChannelPlace> channels;  ///< in the order of the device's channels
  /// In the first request: a counter read before the values never makes old values new.
  std::optional<WordPlace> renewal;
};

/// Neighbouring values share a request if the unused words between them are at most
/// `gap_registers_max` (bits: 16 times that), and its length at most `registers_per_request_max`,
/// `line_registers_max` and the protocol's limit. A value is never split. `one_register_a_request`:
/// every value, status and counter has a request of its own.
/// @pre the limits are at least as large as the largest value
[[nodiscard]] ModbusPlan plan_requests(const ModbusDeviceConfig& device,
                                       int line_registers_max = registers_per_request_limit);

}  // namespace thermocomp
