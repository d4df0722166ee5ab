/// Register layout of a controller: read plan, set of a travel, and offset registers of an axis
/// without read-back. Pure.
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

/// Place of a value's first word in the answers.
struct ValuePlace {
  std::size_t request{0};
  std::size_t word{0};
};

struct ReadPlan {
  std::vector<ReadRequest> requests;
  std::vector<ValuePlace> places;  ///< one per value, in the order given
};

/// Plans few requests for all values: neighbours in one table are joined over at most
/// gap_registers_max unused words; a request has at most registers_per_request_max registers or
/// 2000 bits.
[[nodiscard]] ReadPlan plan_reads(std::span<const ModbusValue> values,
                                  const ModbusControllerConfig& config);

/// Values of a higher stage are written after those of a lower one or with them.
enum class WriteStage { offset, valid_bits, heartbeat };

struct WriteField {
  std::uint16_t address{0};
  WriteStage stage{WriteStage::offset};
  std::vector<std::uint16_t> words;
};

/// Joins adjacent fields into requests of at most registers_max registers; no register outside the
/// fields is written. Requests are in the order of their latest stage.
/// @pre the fields do not overlap
[[nodiscard]] std::vector<WriteField> join_writes(std::vector<WriteField> fields,
                                                  std::size_t registers_max);

/// Writes with the configured function.
Exchange write_field(ModbusConnection& connection, const ModbusControllerConfig& config,
                     const WriteField& request);

/// True if the controller itself refused, not a gateway before it.
[[nodiscard]] bool is_refused(const Exchange& exchange) noexcept;
/// "DB100, bytes 0..9"
[[nodiscard]] std::string s7_place(const S7Block& s7, std::size_t address, std::size_t count);
/// "the controller refuses writes (function 16, register 200): exception 1 (Illegal function)",
/// with a hint.
[[nodiscard]] std::string write_error(const ModbusControllerConfig& config,
                                      const WriteField& request, const Exchange& exchange);

/// @throws InvalidValue for impossible nodes or registers
void check_travel(const ModbusTravel& travel);

/// begin, values and end in one field, so that one request carries them.
/// @param number  of the set, in [0, travel_numbers); must differ from that in `end`
[[nodiscard]] WriteField travel_field(const ModbusTravel& travel, std::uint64_t number,
                                      std::span<const double> offset_um);

/// Number of set numbers before they wrap around.
[[nodiscard]] std::uint64_t travel_numbers(const ModbusTravel& travel) noexcept;

/// @throws InvalidValue for impossible values, and for registers that are written twice
void check_layout(const ModbusControllerConfig& config);

/// Step of each read-back, nodes of travels counted [um]; 0: not read back.
[[nodiscard]] std::vector<double> applied_resolution_um(const ModbusControllerConfig& config);

/// Change of a node's offset with one count of each value that shows it [um].
[[nodiscard]] double shown_resolution_um(const ModbusTravel& travel, std::size_t node);

/// Written registers need not keep their values: a device may answer 0 or anything. They are
/// compared once with the values written, and not used if they differ. If they are equal, they are
/// compared from time to time: two differences in succession mean that the controller does not take
/// writes.
class WrittenOffsets {
 public:
  explicit WrittenOffsets(const ModbusAxis& axis);

  /// Registers of the offset, or of the set of a travel, in one request.
  [[nodiscard]] const ReadRequest& request() const noexcept { return request_; }
  /// False if the registers are known not to hold the values written.
  [[nodiscard]] bool count() const noexcept { return held_ != Held::no; }
  /// @param words  as read; empty: refused
  /// @return one per node of the axis, as sent: [um], of a piezo [V]; NaN: unknown
  [[nodiscard]] std::vector<double> decode(std::span<const std::uint16_t> words) const;

  void wrote(const WriteField& field);
  void taken();     ///< the words of wrote() were answered
  void left_out();  ///< the words were not written: the axis is not driven
  /// True if a read now would show whether the registers hold the values written.
  /// @param is_due  true if the last read is some time ago
  [[nodiscard]] bool is_to_be_compared(bool is_due) const noexcept;
  void compare(std::span<const std::uint16_t> words);
  /// True if an offset is written, and the registers are known to hold it.
  [[nodiscard]] bool holds_known_offset() const noexcept {
    return held_ == Held::yes && !taken_.empty();
  }
  /// True if the registers hold the newest offsets written or the newest ones answered.
  [[nodiscard]] bool is_one_written(std::span<const std::uint16_t> words) const noexcept;
  /// True if the registers are known to hold offsets that are not all 0.
  [[nodiscard]] bool holds_an_offset() const noexcept;
  /// True if the registers held offsets and are all 0.
  [[nodiscard]] bool is_cleared(std::span<const std::uint16_t> words) const noexcept;
  /// "-17.30 was written, -5.46 is read"; empty: writes are taken, or it is unknown.
  [[nodiscard]] const std::string& difference_text() const noexcept { return untaken_; }

 private:
  enum class Held : std::uint8_t { not_known, yes, no };

  const ModbusAxis axis_;
  ReadRequest request_;
  Held held_{Held::not_known};
  std::vector<std::uint16_t> words_;         ///< written last
  std::vector<std::uint16_t> words_before_;  ///< the newest others, which a read may still return
  std::vector<std::uint16_t> taken_;         ///< the newest that was answered
  bool differed_{false};                     ///< at the last comparison
  std::string untaken_;
};

/// "writes are answered, but register 0 keeps another value: ..."
[[nodiscard]] std::string untaken_error(const ModbusControllerConfig& config,
                                        const WrittenOffsets& written);

}  // namespace thermocomp
