#include "drivers/can/signal_codec.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr int frame_bits = 64;

std::uint64_t low_bits(int count) noexcept {
  return count >= frame_bits ? ~std::uint64_t{0} : (std::uint64_t{1} << count) - 1;
}

/// Place of the signal's most significant bit counted from the first bit sent (big_endian only).
int first_sent(const CanSignal& signal) noexcept {
  return signal.start_bit / 8 * 8 + (7 - signal.start_bit % 8);
}

/// How far the signal is from the right end of the frame read as one 64-bit number of its order.
int shift_of(const CanSignal& signal) noexcept {
  if (signal.byte_order == ByteOrder::little_endian) return signal.start_bit;
  return frame_bits - (first_sent(signal) + signal.length_bits);
}

/// The number's byte that the frame's byte `index` is, counted from the least significant.
int place_of(std::size_t index, ByteOrder order) noexcept {
  const int place = static_cast<int>(index);
  return order == ByteOrder::little_endian ? place : 7 - place;
}

std::uint64_t as_number(std::span<const std::uint8_t> payload, ByteOrder order) noexcept {
  std::uint64_t number = 0;
  for (std::size_t i = 0; i < std::min(payload.size(), can_bytes_max); ++i) {
    number |= std::uint64_t{payload[i]} << (8 * place_of(i, order));
  }
  return number;
}

std::int64_t sign_extended(std::uint64_t raw, int length_bits) noexcept {
  const int unused = frame_bits - length_bits;
  return static_cast<std::int64_t>(raw << unused) >> unused;
}

double as_float(std::uint64_t raw, int length_bits) noexcept {
  if (length_bits == 32) return std::bit_cast<float>(static_cast<std::uint32_t>(raw));
  return std::bit_cast<double>(raw);
}

/// The float nearest to `value`; beyond what it can hold: the largest. Tells whether it fitted.
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
  const double above = std::ldexp(1.0, value_bits);  // the first number too large
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

void check(const CanSignal& signal) {
  if (signal.extended_id) {
    require(signal.id <= 0x1FFFFFFFu, "id", signal.id, "must be at most 0x1FFFFFFF (29 bits)");
  } else {
    require(signal.id <= 0x7FFu, "id", signal.id, "must be at most 0x7FF (11 bits)");
  }
  require(signal.length_bits >= 1 && signal.length_bits <= frame_bits, "length_bits",
          signal.length_bits, "must be in [1, 64]");
  require(!signal.is_float || signal.length_bits == 32 || signal.length_bits == 64, "length_bits",
          signal.length_bits, "a float has 32 or 64 bits");
  require(signal.start_bit >= 0 && signal.start_bit < frame_bits, "start_bit", signal.start_bit,
          "must be in [0, 63]");
  const int begin =
      signal.byte_order == ByteOrder::little_endian ? signal.start_bit : first_sent(signal);
  require(begin + signal.length_bits <= frame_bits, "start_bit", signal.start_bit,
          "the signal must end within 8 bytes");
  require(std::isfinite(signal.scale) && signal.scale != 0.0, "scale", signal.scale,
          "must be finite and not 0");
  require(std::isfinite(signal.offset), "offset", signal.offset, "must be finite");
}

std::size_t bytes_needed(const CanSignal& signal) noexcept {
  const int begin =
      signal.byte_order == ByteOrder::little_endian ? signal.start_bit : first_sent(signal);
  return static_cast<std::size_t>(begin + signal.length_bits + 7) / 8;
}

std::uint64_t bits_of(const CanSignal& signal) noexcept {
  const std::uint64_t mask = low_bits(signal.length_bits) << shift_of(signal);
  if (signal.byte_order == ByteOrder::little_endian) return mask;
  return __builtin_bswap64(mask);
}

std::uint64_t extract_raw(std::span<const std::uint8_t> payload, const CanSignal& signal) noexcept {
  const std::uint64_t number = as_number(payload, signal.byte_order);
  return (number >> shift_of(signal)) & low_bits(signal.length_bits);
}

void insert_raw(std::span<std::uint8_t> payload, const CanSignal& signal,
                std::uint64_t raw) noexcept {
  const std::uint64_t mask = low_bits(signal.length_bits) << shift_of(signal);
  const std::uint64_t number =
      (as_number(payload, signal.byte_order) & ~mask) | ((raw << shift_of(signal)) & mask);
  for (std::size_t i = 0; i < std::min(payload.size(), can_bytes_max); ++i) {
    payload[i] = static_cast<std::uint8_t>(number >> (8 * place_of(i, signal.byte_order)));
  }
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
