#include "drivers/can/signal_codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr int number_bits = 64;

std::uint64_t low_bits(int count) noexcept {
  return count >= number_bits ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
}

CanField field_of(const CanSignal& signal) noexcept {
  return {signal.start_bit, signal.length_bits, signal.byte_order};
}

/// Position of the field's first bit in the order of its bits; for big_endian counted from the
/// highest bit of byte 0.
int first_bit(const CanField& field) noexcept {
  if (field.byte_order == ByteOrder::little_endian) return field.start_bit;
  return field.start_bit / 8 * 8 + (7 - field.start_bit % 8);
}

/// Eight bytes as a number in the given byte order; bytes beyond the end are zero.
std::uint64_t load(std::span<const std::uint8_t> bytes, ByteOrder order) noexcept {
  std::uint64_t number = 0;
  std::memcpy(&number, bytes.data(), std::min(bytes.size(), sizeof number));
  static_assert(std::endian::native == std::endian::little);
  return order == ByteOrder::little_endian ? number : __builtin_bswap64(number);
}

std::int64_t sign_extended(std::uint64_t raw, int length_bits) noexcept {
  const int unused = number_bits - length_bits;
  return static_cast<std::int64_t>(raw << unused) >> unused;
}

double as_float(std::uint64_t raw, int length_bits) noexcept {
  if (length_bits == 32) return std::bit_cast<float>(static_cast<std::uint32_t>(raw));
  return std::bit_cast<double>(raw);
}

/// Nearest float, saturated at the largest; `fitted` is false if it was saturated.
std::uint64_t float_bits(double value, int length_bits, bool& fitted) noexcept {
  if (length_bits == 64) {
    fitted = std::isfinite(value);
    const double top = std::numeric_limits<double>::max();
    return std::bit_cast<std::uint64_t>(std::clamp(value, -top, top));
  }
  const double top = std::numeric_limits<float>::max();
  fitted = std::abs(value) <= top;
  return std::bit_cast<std::uint32_t>(static_cast<float>(std::clamp(value, -top, top)));
}

std::uint64_t integer_bits(double counts, const CanSignal& signal, bool& fitted) noexcept {
  const int value_bits = signal.is_signed ? signal.length_bits - 1 : signal.length_bits;
  const double above = std::ldexp(1.0, value_bits);  // the smallest number that is too large
  const double lowest = signal.is_signed ? -above : 0.0;
  const double rounded = std::round(counts);
  fitted = rounded >= lowest && rounded < above;
  if (rounded < lowest) {
    return signal.is_signed ? std::uint64_t{1} << value_bits : 0;
  }
  if (rounded >= above) return low_bits(value_bits);
  if (rounded < 0) return static_cast<std::uint64_t>(static_cast<std::int64_t>(rounded));
  return static_cast<std::uint64_t>(rounded);
}

}  // namespace

void check(const CanField& field, bool fd) {
  const int frame_bits = static_cast<int>(8 * (fd ? can_bytes_max : can_classic_bytes_max));
  require(field.length_bits >= 1 && field.length_bits <= number_bits, "length_bits",
          field.length_bits, "must be in [1, 64]");
  require(field.start_bit >= 0 && field.start_bit < frame_bits, "start_bit", field.start_bit,
          fd ? "must be in [0, 511]" : "must be in [0, 63]");
  require(first_bit(field) + field.length_bits <= frame_bits, "start_bit", field.start_bit,
          fd ? "the signal must end within 64 bytes" : "the signal must end within 8 bytes");
}

void check(const CanSignal& signal) {
  if (signal.extended_id) {
    require(signal.id <= 0x1FFFFFFFu, "id", signal.id, "must be at most 0x1FFFFFFF (29 bits)");
  } else {
    require(signal.id <= 0x7FFu, "id", signal.id, "must be at most 0x7FF (11 bits)");
  }
  check(field_of(signal), signal.fd);
  require(!signal.is_float || signal.length_bits == 32 || signal.length_bits == 64, "length_bits",
          signal.length_bits, "a float has 32 or 64 bits");
  require(std::isfinite(signal.scale) && signal.scale != 0.0, "scale", signal.scale,
          "must be finite and not 0");
  require(std::isfinite(signal.offset), "offset", signal.offset, "must be finite");
  for (const CanSelector& selector : signal.selectors) {
    check(selector.field, signal.fd);
    require(!selector.pages.empty(), "multiplexor", 0.0, "must have a value");
  }
  if (signal.status) check(signal.status->field, signal.fd);
}

std::size_t bytes_needed(const CanField& field) noexcept {
  return static_cast<std::size_t>(first_bit(field) + field.length_bits + 7) / 8;
}

std::size_t bytes_needed(const CanSignal& signal) noexcept {
  std::size_t bytes = bytes_needed(field_of(signal));
  for (const CanSelector& selector : signal.selectors) {
    bytes = std::max(bytes, bytes_needed(selector.field));
  }
  if (signal.status) bytes = std::max(bytes, bytes_needed(signal.status->field));
  return bytes;
}

CanBits bits_of(const CanField& field) noexcept {
  CanBits bits;
  int bit = first_bit(field);
  for (int i = 0; i < field.length_bits; ++i, ++bit) {
    const bool up = field.byte_order == ByteOrder::little_endian;
    bits.set(static_cast<std::size_t>(up ? bit : bit / 8 * 8 + (7 - bit % 8)));
  }
  return bits;
}

CanBits bits_of(const CanSignal& signal) noexcept {
  return bits_of(field_of(signal));
}

std::uint64_t extract_raw(std::span<const std::uint8_t> payload, const CanField& field) noexcept {
  const int first = first_bit(field);
  const auto byte = static_cast<std::size_t>(first / 8);
  const int skipped = first % 8;
  const std::uint64_t number = load(payload.subspan(byte), field.byte_order);
  // Up to seven bits may be in a ninth byte.
  const bool more = skipped + field.length_bits > number_bits;
  const std::uint64_t ninth = more ? payload[byte + 8] : 0;
  if (field.byte_order == ByteOrder::little_endian) {
    const std::uint64_t high = more ? ninth << (number_bits - skipped) : 0;
    return ((number >> skipped) | high) & low_bits(field.length_bits);
  }
  const std::uint64_t low = more ? ninth >> (8 - skipped) : 0;
  return ((number << skipped) | low) >> (number_bits - field.length_bits);
}

std::uint64_t extract_raw(std::span<const std::uint8_t> payload, const CanSignal& signal) noexcept {
  return extract_raw(payload, field_of(signal));
}

void insert_raw(std::span<std::uint8_t> payload, const CanField& field,
                std::uint64_t raw) noexcept {
  const bool up = field.byte_order == ByteOrder::little_endian;
  int bit = first_bit(field);
  for (int left = field.length_bits; left > 0;) {
    const int place = bit % 8;
    const int count = std::min(8 - place, left);
    // The first bits of this byte are at its low end or, for big_endian, at its high end.
    const int shift = up ? place : 8 - place - count;
    const std::uint64_t part = up ? raw >> (field.length_bits - left) : raw >> (left - count);
    const std::uint64_t mask = low_bits(count) << shift;
    std::uint8_t& byte = payload[static_cast<std::size_t>(bit / 8)];
    byte = static_cast<std::uint8_t>((byte & ~mask) | ((part << shift) & mask));
    bit += count;
    left -= count;
  }
}

void insert_raw(std::span<std::uint8_t> payload, const CanSignal& signal,
                std::uint64_t raw) noexcept {
  insert_raw(payload, field_of(signal), raw);
}

bool carries(std::span<const std::uint8_t> payload, const CanSignal& signal) noexcept {
  return std::all_of(
      signal.selectors.begin(), signal.selectors.end(), [&](const CanSelector& selector) {
        if (payload.size() < bytes_needed(selector.field)) return true;
        const std::uint64_t page = extract_raw(payload, selector.field);
        return std::any_of(selector.pages.begin(), selector.pages.end(), [&](const auto& pages) {
          return page >= pages.first && page <= pages.last;
        });
      });
}

Fault fault_of(const CanStatus& status, std::uint64_t number) noexcept {
  const std::uint64_t masked = number & status.mask;
  bool zero_is_good = masked == 0;
  for (const Sentinel& code : status.codes) {
    if (static_cast<std::uint64_t>(code.code) == masked) return code.fault;
    if (code.fault == Fault::none) zero_is_good = false;
  }
  return zero_is_good ? Fault::none : Fault::device_error;
}

CanValue decode(std::span<const std::uint8_t> payload, const CanSignal& signal) noexcept {
  if (payload.size() < bytes_needed(signal)) return {};
  const std::uint64_t raw = extract_raw(payload, signal);
  const bool extend = signal.is_signed && !signal.is_float;
  const std::int64_t code =
      extend ? sign_extended(raw, signal.length_bits) : static_cast<std::int64_t>(raw);
  for (const Sentinel& sentinel : signal.sentinels) {
    if (sentinel.code == code) return {not_a_number, sentinel.fault};
  }
  double counts = 0.0;
  if (signal.is_float) {
    counts = as_float(raw, signal.length_bits);
  } else {
    counts = extend ? static_cast<double>(code) : static_cast<double>(raw);
  }
  const double value = counts * signal.scale + signal.offset;
  if (!std::isfinite(value)) return {not_a_number, Fault::out_of_range};
  if (signal.status) {
    const Fault fault = fault_of(*signal.status, extract_raw(payload, signal.status->field));
    if (fault != Fault::none) return {not_a_number, fault};
  }
  return {value, Fault::none};
}

bool encode(double value, std::span<std::uint8_t> payload, const CanSignal& signal) noexcept {
  if (std::isnan(value)) return false;
  const double counts = (value - signal.offset) / signal.scale;
  if (std::isnan(counts)) return false;
  bool fitted = false;
  const std::uint64_t raw = signal.is_float ? float_bits(counts, signal.length_bits, fitted)
                                            : integer_bits(counts, signal, fitted);
  insert_raw(payload, signal, raw);
  return fitted;
}

double resolution(const CanSignal& signal) noexcept {
  return signal.is_float ? 0.0 : std::abs(signal.scale);
}

}  // namespace thermocomp
