/// Registers of one Modbus unit and its answers, without I/O.
/// Source: MODBUS Application Protocol Specification V1.1b3.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "drivers/controllers/controller_config.hpp"
#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

class ModbusUnit {
 public:
  /// Creates words. Undefined words between defined ones of a table read as 0, as in most devices;
  /// all others are refused with exception 2.
  void define(ModbusTable table, std::uint16_t address, std::size_t words, bool writable);
  void define(const ModbusValue& value, bool writable);

  void set(ModbusTable table, std::uint16_t address, std::uint16_t word);
  void set(ModbusTable table, std::uint16_t address, std::span<const std::uint16_t> words);
  [[nodiscard]] std::uint16_t word(ModbusTable table, std::uint16_t address) const;

  /// Saturates; NaN becomes a float's NaN or an integer's highest code, as in upscale burn-out.
  void set_value(const ModbusValue& place, double offset, double value);
  /// Writes a raw code, without scale.
  void set_code(const ModbusValue& place, std::int64_t code);
  [[nodiscard]] double value(const ModbusValue& place) const;  ///< NaN if not a number

  struct Answer {
    std::vector<std::uint8_t> pdu;
    bool wrote{false};  ///< the request changed registers
  };
  /// Functions 1 to 6, 15 and 16; exception 1, 2 or 3 otherwise. @pre !request.empty()
  [[nodiscard]] Answer answer(std::span<const std::uint8_t> request);

 private:
  struct Word {
    std::uint16_t value{0};
    bool writable{false};
  };
  using Table = std::map<std::uint16_t, Word>;

  [[nodiscard]] Table& table(ModbusTable which);
  [[nodiscard]] const Table& table(ModbusTable which) const;
  [[nodiscard]] bool readable(ModbusTable which, std::size_t address, std::size_t count) const;
  [[nodiscard]] bool writable(ModbusTable which, std::size_t address, std::size_t count) const;
  [[nodiscard]] Answer read_bits(ModbusTable which, std::span<const std::uint8_t> request) const;
  [[nodiscard]] Answer read_words(ModbusTable which, std::span<const std::uint8_t> request) const;
  [[nodiscard]] Answer write_one(std::span<const std::uint8_t> request);
  [[nodiscard]] Answer write_bits(std::span<const std::uint8_t> request);
  [[nodiscard]] Answer write_words(std::span<const std::uint8_t> request);

  std::array<Table, 4> tables_;
};

[[nodiscard]] std::vector<std::uint8_t> modbus_exception(std::uint8_t function, std::uint8_t code);

}  // namespace thermocomp
