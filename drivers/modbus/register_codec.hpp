/// Registers <-> numbers. Pure: no I/O, no clock, no allocation, never throws.
///
/// A register is a host uint16 as from libmodbus (the first byte on the wire is its high byte). A
/// value of 2 or 4 registers is in consecutive registers, lowest address first. Bytes on the wire,
/// A the most significant:
///
///   order   16 bit   32 bit   64 bit       words        bytes in a word
///   abcd    AB       ABCD     ABCDEFGH     high first   high first
///   cdab    AB       CDAB     GHEFCDAB     low first    high first
///   badc    BA       BADC     BADCFEHG     high first   low first
///   dcba    BA       DCBA     HGFEDCBA     low first    low first
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

inline constexpr std::size_t registers_of_value_max = 4;

/// Format of a number in registers: value = raw * scale + offset.
struct NumberFormat {
  Encoding encoding{Encoding::int16};
  WordOrder word_order{WordOrder::abcd};
  double scale{1.0};
  double offset{0.0};
  /// Bits of a 16-bit value that are the number, shifted down. int16: the highest is the sign.
  std::uint16_t mask{0xFFFF};
};

/// Format of a value in `table`; a bit is always 0 or 1 before scale and offset.
[[nodiscard]] inline NumberFormat format_in(ModbusTable table, NumberFormat format) noexcept {
  if (!is_bit_table(table)) return format;
  return {Encoding::uint16, WordOrder::abcd, format.scale, format.offset};
}

[[nodiscard]] inline NumberFormat format_of(const ModbusChannel& channel) noexcept {
  return format_in(channel.table, {channel.encoding, channel.word_order, channel.scale,
                                   channel.offset_degC, channel.mask});
}

/// Bit pattern of the value, right-aligned, most significant byte first.
/// @pre registers.size() >= registers_of(encoding)
[[nodiscard]] std::uint64_t bits_of(std::span<const std::uint16_t> registers, Encoding encoding,
                                    WordOrder order) noexcept;

struct Decoded {
  double value{not_a_number};  ///< NaN unless fault is none
  Fault fault{Fault::none};
};

/// value = raw * scale + offset, unless the raw value is a sentinel (its fault) or the result is
/// not a finite number (out_of_range). A sentinel of a float encoding is compared as a number.
/// @pre registers.size() >= registers_of(format.encoding)
[[nodiscard]] Decoded decode(std::span<const std::uint16_t> registers, const NumberFormat& format,
                             std::span<const Sentinel> sentinels) noexcept;

/// False for a value that no thermometer sends: a float closer to 0 than any of them resolves comes
/// from the bytes of another number (wrong word_order or address); 0 itself is possible.
[[nodiscard]] bool may_be_measured(const ModbusChannel& channel, double temp_degC) noexcept;

/// Fault (or none) of a status word: the one listed for its masked value. 0 is good if no good code
/// is listed; any other value is device_error. A bit (coil, discrete input) is not masked.
[[nodiscard]] Fault decode_status(const ModbusStatus& status, std::uint16_t word) noexcept;

/// True if a sentinel's code can occur in the encoding (-1 cannot in uint16).
[[nodiscard]] bool is_representable(std::int64_t code, Encoding encoding) noexcept;

enum class EncodeResult {
  exact,      ///< within half a count (integers) or the float's rounding
  saturated,  ///< beyond the encoding: its nearest end
  refused     ///< not a finite number: nothing to write
};

struct Encoded {
  std::array<std::uint16_t, registers_of_value_max> registers{};
  std::size_t count{0};  ///< registers to write; 0 when refused
  EncodeResult result{EncodeResult::refused};
  double value{not_a_number};  ///< decoded from these registers

  [[nodiscard]] std::span<const std::uint16_t> words() const noexcept {
    return {registers.data(), count};
  }
};

/// raw = (value - offset) / scale, rounded to the nearest count (halves away from zero).
/// @pre format.scale is finite and not 0 (otherwise refused)
[[nodiscard]] Encoded encode(double value, const NumberFormat& format) noexcept;

}  // namespace thermocomp
