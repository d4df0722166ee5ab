/// Numbers as CANopen and J1939 put them into bytes: least significant byte first.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

namespace thermocomp {

/// @param count  1..8 bytes from `first`; bytes beyond the end count as 0
[[nodiscard]] inline std::uint64_t little_endian(std::span<const std::uint8_t> bytes,
                                                 std::size_t first, std::size_t count) noexcept {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < count && first + i < bytes.size(); ++i) {
    value |= std::uint64_t{bytes[first + i]} << (8 * i);
  }
  return value;
}

/// @pre bytes has `count` bytes from `first`
inline void put_little_endian(std::span<std::uint8_t> bytes, std::size_t first, std::size_t count,
                              std::uint64_t value) noexcept {
  for (std::size_t i = 0; i < count; ++i) {
    bytes[first + i] = static_cast<std::uint8_t>(value >> (8 * i));
  }
}

}  // namespace thermocomp
