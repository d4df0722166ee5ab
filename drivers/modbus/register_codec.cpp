#include "drivers/modbus/register_codec.hpp"

#include <bit>
#include <cmath>
#include <limits>

namespace thermocomp {
namespace {

constexpr bool low_word_first(WordOrder order) noexcept {
  return order == WordOrder::cdab || order == WordOrder::dcba;
}
constexpr bool low_byte_first(WordOrder order) noexcept {
  return order == WordOrder::badc || order == WordOrder::dcba;
}
constexpr std::uint16_t swap_bytes(std::uint16_t word) noexcept {
  return static_cast<std::uint16_t>((word << 8) | (word >> 8));
}

constexpr bool is_integer(Encoding encoding) noexcept {
  return encoding != Encoding::float32 && encoding != Encoding::float64;
}

/// Range of an integer encoding.
struct Limits {
  std::int64_t lowest;
  std::int64_t highest;
};
constexpr Limits limits_of(Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::int16:
      return {std::numeric_limits<std::int16_t>::min(), std::numeric_limits<std::int16_t>::max()};
    case Encoding::uint16:
      return {0, std::numeric_limits<std::uint16_t>::max()};
    case Encoding::int32:
      return {std::numeric_limits<std::int32_t>::min(), std::numeric_limits<std::int32_t>::max()};
    case Encoding::uint32:
      return {0, std::numeric_limits<std::uint32_t>::max()};
    case Encoding::float32:
    case Encoding::float64:
      break;
  }
  return {0, 0};
}

std::int64_t integer_of(std::uint64_t bits, Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::int16:
      return static_cast<std::int16_t>(static_cast<std::uint16_t>(bits));
    case Encoding::int32:
      return static_cast<std::int32_t>(static_cast<std::uint32_t>(bits));
    default:
      return static_cast<std::int64_t>(bits);  // unsigned, at most 32 bits
  }
}

/// The number in the bits of the mask.
std::uint64_t masked(std::uint64_t bits, const NumberFormat& format) noexcept {
  if (format.mask == 0xFFFF || registers_of(format.encoding) != 1) return bits;
  const int shift = std::countr_zero(format.mask);
  const unsigned part = (static_cast<unsigned>(bits) & format.mask) >> shift;
  const unsigned sign = format.encoding == Encoding::int16
                            ? std::bit_floor(static_cast<unsigned>(format.mask) >> shift)
                            : 0;
  return static_cast<std::uint16_t>((part ^ sign) - sign);
}

double number_of(std::uint64_t bits, Encoding encoding) noexcept {
  switch (encoding) {
    case Encoding::float32:
      return static_cast<double>(std::bit_cast<float>(static_cast<std::uint32_t>(bits)));
    case Encoding::float64:
      return std::bit_cast<double>(bits);
    default:
      return static_cast<double>(integer_of(bits, encoding));
  }
}

void place_bits(std::uint64_t bits, const NumberFormat& format, Encoded& encoded) noexcept {
  encoded.count = registers_of(format.encoding);
  for (std::size_t i = 0; i < encoded.count; ++i) {
    const auto word = static_cast<std::uint16_t>(bits >> (16 * (encoded.count - 1 - i)));
    const std::size_t place = low_word_first(format.word_order) ? encoded.count - 1 - i : i;
    encoded.registers[place] = low_byte_first(format.word_order) ? swap_bytes(word) : word;
  }
}

/// Bits of the nearest representable raw value; `saturated` if it is an end of the range.
std::uint64_t nearest_bits(double raw, Encoding encoding, bool& saturated) noexcept {
  if (encoding == Encoding::float64) return std::bit_cast<std::uint64_t>(raw);
  if (encoding == Encoding::float32) {
    constexpr double highest = std::numeric_limits<float>::max();
    saturated = std::abs(raw) > highest;
    return std::bit_cast<std::uint32_t>(
        static_cast<float>(saturated ? std::copysign(highest, raw) : raw));
  }
  const Limits limits = limits_of(encoding);
  const double rounded = std::round(raw);
  saturated =
      rounded < static_cast<double>(limits.lowest) || rounded > static_cast<double>(limits.highest);
  if (!saturated) return static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded));
  return static_cast<std::uint64_t>(raw < 0 ? limits.lowest : limits.highest);
}

}  // namespace

std::uint64_t bits_of(std::span<const std::uint16_t> registers, Encoding encoding,
                      WordOrder order) noexcept {
  const std::size_t count = registers_of(encoding);
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::uint16_t word = registers[low_word_first(order) ? count - 1 - i : i];
    bits = (bits << 16) | (low_byte_first(order) ? swap_bytes(word) : word);
  }
  return bits;
}

Decoded decode(std::span<const std::uint16_t> registers, const NumberFormat& format,
               std::span<const Sentinel> sentinels) noexcept {
  const std::uint64_t bits = masked(bits_of(registers, format.encoding, format.word_order), format);
  const double number = number_of(bits, format.encoding);
  const bool integer = is_integer(format.encoding);
  for (const Sentinel& sentinel : sentinels) {
    const bool hit = integer ? integer_of(bits, format.encoding) == sentinel.code
                             : number == static_cast<double>(sentinel.code);
    if (hit && sentinel.fault != Fault::none) return {not_a_number, sentinel.fault};
  }
  const double value = number * format.scale + format.offset;
  if (!std::isfinite(value)) return {not_a_number, Fault::out_of_range};
  return {value, Fault::none};
}

bool may_be_measured(const ModbusChannel& channel, double temp_degC) noexcept {
  constexpr double resolved_min = 1e-6;
  if (channel.encoding != Encoding::float32 && channel.encoding != Encoding::float64) return true;
  const double raw = std::abs((temp_degC - channel.offset_degC) / channel.scale);
  return raw == 0.0 || raw >= resolved_min;
}

Fault decode_status(const ModbusStatus& status, std::uint16_t word) noexcept {
  const std::uint16_t mask = is_bit_table(status.table) ? std::uint16_t{1} : status.mask;
  const auto masked = static_cast<std::uint16_t>(word & mask);
  bool zero_is_good = masked == 0;
  for (const Sentinel& code : status.codes) {
    if (code.code == masked) return code.fault;
    if (code.fault == Fault::none) zero_is_good = false;
  }
  return zero_is_good ? Fault::none : Fault::device_error;
}

namespace {

/// True if `number`, rounded from `code`, equals it; the greatest codes are rounded to 2^63, out of
/// range.
bool is_exactly(double number, std::int64_t code) noexcept {
  return number < 0x1p63 && static_cast<std::int64_t>(number) == code;
}

}  // namespace

bool is_representable(std::int64_t code, Encoding encoding) noexcept {
  if (encoding == Encoding::float64) return is_exactly(static_cast<double>(code), code);
  if (encoding == Encoding::float32) {
    return is_exactly(static_cast<double>(static_cast<float>(code)), code);
  }
  const Limits limits = limits_of(encoding);
  return code >= limits.lowest && code <= limits.highest;
}

Encoded encode(double value, const NumberFormat& format) noexcept {
  Encoded encoded;
  const double raw = (value - format.offset) / format.scale;
  if (!std::isfinite(raw)) return encoded;
  bool saturated = false;
  const std::uint64_t bits = nearest_bits(raw, format.encoding, saturated);
  place_bits(bits, format, encoded);
  encoded.result = saturated ? EncodeResult::saturated : EncodeResult::exact;
  const std::uint64_t placed = bits_of(encoded.words(), format.encoding, format.word_order);
  encoded.value = number_of(placed, format.encoding) * format.scale + format.offset;
  return encoded;
}

}  // namespace thermocomp
