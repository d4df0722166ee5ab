/// Registers <-> numbers. Pure: no I/O, no clock, no allocation, never throws.
///
/// A register is a host uint16 as libmodbus delivers it (the first byte on the wire is its high
/// byte). A value of 2 or 4 registers stands in consecutive registers, lowest address first. With
/// its bytes named from the most significant, the orders are, as bytes on the wire:
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

/// How a number stands in registers: value = raw * scale + offset.
struct NumberFormat {
  Encoding encoding{Encoding::int16};
  WordOrder word_order{WordOrder::abcd};
  double scale{1.0};
  double offset{0.0};
  /// Of a 16-bit value: the bits that are the number, shifted down. int16: the highest of them is
  /// its sign.
  std::uint16_t mask{0xFFFF};
};

/// The format of a value in `table`: as given, but a bit is always 0 or 1 before scale and offset.
[[nodiscard]] inline NumberFormat format_in(ModbusTable table, NumberFormat format) noexcept {
  if (!is_bit_table(table)) return format;
  return {Encoding::uint16, WordOrder::abcd, format.scale, format.offset};
}

[[nodiscard]] inline NumberFormat format_of(const ModbusChannel& channel) noexcept {
  return format_in(channel.table, {channel.encoding, channel.word_order, channel.scale,
                                   channel.offset_degC, channel.mask});
}

/// The value's bit pattern, right-aligned, its bytes brought into order.
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

/// Whether a thermometer can have sent it. A float nearer to 0 than any of them resolves is made of
/// another number's bytes (word_order, address); 0 itself is not.
[[nodiscard]] bool may_be_measured(const ModbusChannel& channel, double temp_degC) noexcept;

/// What a status word says: the fault (or none) listed for its masked value. 0 is good where no
/// good code is listed; anything else is device_error. A bit (coil, discrete input) is not masked.
[[nodiscard]] Fault decode_status(const ModbusStatus& status, std::uint16_t word) noexcept;

/// Whether a sentinel's code can occur at all in the encoding (-1 cannot in uint16).
[[nodiscard]] bool is_representable(std::int64_t code, Encoding encoding) noexcept;

enum class EncodeResult {
  exact,      ///< within half a count (integers) or the float's rounding
  saturated,  ///< beyond the encoding: the nearest end was taken
  refused     ///< not a finite number: there is nothing to write
};

struct Encoded {
  std::array<std::uint16_t, registers_of_value_max> registers{};
  std::size_t count{0};  ///< registers to write; 0 when refused
  EncodeResult result{EncodeResult::refused};
  double value{not_a_number};  ///< what the registers say when decoded again

  [[nodiscard]] std::span<const std::uint16_t> words() const noexcept {
    return {registers.data(), count};
  }
};

/// raw = (value - offset) / scale, rounded to the nearest count (halves away from zero).
/// @pre format.scale is finite and not 0 (otherwise refused)
[[nodiscard]] Encoded encode(double value, const NumberFormat& format) noexcept;

}  // namespace thermocomp
