/// Which requests carry a controller's values, and what one that failed is called.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/modbus/connection.hpp"

namespace thermocomp {

struct ReadRequest {
  ModbusTable table{ModbusTable::holding};
  std::uint16_t address{0};
  std::size_t count{0};  ///< words (a coil or discrete input is one)
};

/// Where a value's first word stands in the answers.
struct ValuePlace {
  std::size_t request{0};
  std::size_t word{0};
};

struct ReadPlan {
  std::vector<ReadRequest> requests;
  std::vector<ValuePlace> places;  ///< one a value, in the order given
};

/// Few requests that cover all values: neighbours of one table are joined over at most
/// gap_registers_max unused words; a request has at most registers_per_request_max registers or
/// 2000 bits.
[[nodiscard]] ReadPlan plan_reads(std::span<const ModbusValue> values,
                                  const ModbusControllerConfig& config);

/// Values of a higher stage reach the controller after those of a lower one, unless one request
/// carries both.
enum class WriteStage { offset, valid_bits, heartbeat };

struct WriteField {
  std::uint16_t address{0};
  WriteStage stage{WriteStage::offset};
  std::vector<std::uint16_t> words;
};

/// Joins fields whose registers touch into one request each, of at most so many registers, never
/// writing a register that is in no field. The requests come in the order of their latest stage.
/// @pre the fields do not overlap
[[nodiscard]] std::vector<WriteField> join_writes(std::vector<WriteField> fields,
                                                  std::size_t registers_max);

/// By the function that the configuration names.
Exchange write_field(ModbusConnection& connection, const ModbusControllerConfig& config,
                     const WriteField& request);

/// Whether the controller itself refused, and not a gateway because the controller behind it may be
/// off.
[[nodiscard]] bool is_refused(const Exchange& exchange) noexcept;
/// "DB100, bytes 0..9"
[[nodiscard]] std::string s7_place(const S7Block& s7, std::size_t address, std::size_t count);
/// "the controller refuses writes (function 16, register 200): exception 1 (Illegal function)", and
/// what may help.
[[nodiscard]] std::string write_error(const ModbusControllerConfig& config,
                                      const WriteField& request, const Exchange& exchange);

}  // namespace thermocomp
