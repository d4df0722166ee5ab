/// A controller's registers: what is read, the set of a travel, and what stands in the offset
/// registers of an axis that is not read back. Pure.
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

/// @throws InvalidValue for nodes or registers that cannot be
void check_travel(const ModbusTravel& travel);

/// begin, values and end in one field, so that one request carries them: number, what the offsets
/// at the nodes come to, number.
/// @param number  of the set; an earlier one must not stand in `end` [0, travel_numbers)
[[nodiscard]] WriteField travel_field(const ModbusTravel& travel, std::uint64_t number,
                                      std::span<const double> offset_um);

/// How many numbers a set can have before they begin anew.
[[nodiscard]] std::uint64_t travel_numbers(const ModbusTravel& travel) noexcept;

/// How far a node's offset moves with one count of everything that it is shown by [um].
[[nodiscard]] double shown_resolution_um(const ModbusTravel& travel, std::size_t node);

/// Registers that can be written need not hold what was: a device may answer 0, or what it likes.
/// So they are compared once with what was written, and count no more where they differ.
class WrittenOffsets {
 public:
  explicit WrittenOffsets(const ModbusAxis& axis);

  /// The registers of the offset, or the set of a travel, in one request.
  [[nodiscard]] const ReadRequest& request() const noexcept { return request_; }
  /// Whether they may hold what was written.
  [[nodiscard]] bool count() const noexcept { return held_ != Held::no; }
  /// @param words  as read; empty: refused
  /// @return one per node of the axis, as sent: [um], of a piezo [V]; NaN: not known
  [[nodiscard]] std::vector<double> decode(std::span<const std::uint16_t> words) const;

  void wrote(const WriteField& field) { words_ = field.words; }
  /// Whether a look at the registers now would show if they hold what was written.
  [[nodiscard]] bool is_to_be_compared() const noexcept;
  void compare(std::span<const std::uint16_t> words) noexcept;

 private:
  enum class Held : std::uint8_t { not_known, yes, no };

  const ModbusAxis axis_;
  ReadRequest request_;
  Held held_{Held::not_known};
  std::vector<std::uint16_t> words_;  ///< written last
};

}  // namespace thermocomp
