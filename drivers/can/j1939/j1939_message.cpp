#include "drivers/can/j1939/j1939_message.hpp"

#include <algorithm>
#include <cmath>

#include "drivers/can/little_endian.hpp"
#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr int length_max = 32;
constexpr std::uint64_t highest_value = 0xFA;
constexpr std::uint64_t error_byte = 0xFE;
constexpr std::uint64_t not_available_byte = 0xFF;

std::size_t bytes_needed(const J1939Parameter& parameter) noexcept {
  const int bytes = parameter.start_byte + (parameter.start_bit + parameter.length_bits + 7) / 8;
  return static_cast<std::size_t>(bytes);
}

/// Fault::none where the raw value is one.
Fault indicated(std::uint64_t raw, const J1939Parameter& parameter) noexcept {
  const int bits = parameter.length_bits;
  if (bits % 8 == 0) {
    const std::uint64_t top = raw >> (bits - 8);
    if (top == not_available_byte) return parameter.not_available;
    if (top == error_byte) return parameter.error;
    return top > highest_value ? Fault::out_of_range : Fault::none;
  }
  const std::uint64_t ones = (std::uint64_t{1} << bits) - 1;
  if (raw == ones) return parameter.not_available;
  return raw == ones - 1 ? parameter.error : Fault::none;
}

}  // namespace

J1939Id read_identifier(std::uint32_t id) noexcept {
  J1939Id read;
  read.source = static_cast<std::uint8_t>(id);
  read.priority = static_cast<int>((id >> 26) & 7u);
  read.pgn = (id >> 8) & pgn_max;
  if (is_addressed(read.pgn)) {
    read.destination = static_cast<std::uint8_t>(read.pgn);
    read.pgn &= ~0xFFu;
  }
  return read;
}

CanId identifier(const J1939Id& id) noexcept {
  const std::uint32_t specific = is_addressed(id.pgn) ? id.destination : 0u;
  return {(static_cast<std::uint32_t>(id.priority) << 26) | ((id.pgn | specific) << 8) | id.source,
          true};
}

void check(const J1939Parameter& parameter) {
  require(parameter.pgn <= pgn_max, "pgn", parameter.pgn, "must be in [0, 262143]");
  require(!is_addressed(parameter.pgn) || (parameter.pgn & 0xFFu) == 0, "pgn", parameter.pgn,
          "a group that is sent to one node has 0 in its lowest byte");
  require(parameter.length_bits >= 2 && parameter.length_bits <= length_max, "length_bits",
          parameter.length_bits, "must be in [2, 32]");
  require(parameter.start_bit >= 0 && parameter.start_bit < 8, "start_bit", parameter.start_bit,
          "must be a bit of the byte");
  require(parameter.start_byte >= 0 && bytes_needed(parameter) <= j1939_bytes_max, "start_byte",
          parameter.start_byte, "the parameter must end within 1785 bytes");
  require(std::isfinite(parameter.scale) && parameter.scale != 0.0, "scale", parameter.scale,
          "must be finite and not 0");
  require(std::isfinite(parameter.offset), "offset", parameter.offset, "must be finite");
  require(parameter.error != Fault::none && parameter.not_available != Fault::none, "error_means",
          0.0, "must be a fault");
}

std::uint64_t extract_raw(std::span<const std::uint8_t> message,
                          const J1939Parameter& parameter) noexcept {
  const auto first = static_cast<std::size_t>(parameter.start_byte);
  const std::uint64_t bytes = little_endian(message, first, 8);
  const std::uint64_t mask = (std::uint64_t{1} << parameter.length_bits) - 1;
  return (bytes >> parameter.start_bit) & mask;
}

CanValue decode(std::span<const std::uint8_t> message, const J1939Parameter& parameter) noexcept {
  if (message.size() < bytes_needed(parameter)) return {};
  const std::uint64_t raw = extract_raw(message, parameter);
  for (const Sentinel& sentinel : parameter.sentinels) {
    if (sentinel.code == static_cast<std::int64_t>(raw)) return {not_a_number, sentinel.fault};
  }
  if (const Fault fault = indicated(raw, parameter); fault != Fault::none) {
    return {not_a_number, fault};
  }
  const double value = static_cast<double>(raw) * parameter.scale + parameter.offset;
  if (!std::isfinite(value)) return {not_a_number, Fault::out_of_range};
  return {value, Fault::none};
}

}  // namespace thermocomp
