/// Values in the bits of a CAN frame, classic or FD. Pure.
///
/// Bits are numbered as in DBC files: bit 8 n + k is bit k (0 = lowest) of byte n. A little_endian
/// signal starts at its least significant bit, with rising bit numbers. A big_endian signal starts
/// at its most significant bit, goes down to bit 0 of that byte and continues at bit 7 of the next
/// byte (sawtooth).
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/can/can_config.hpp"

namespace thermocomp {

inline constexpr std::size_t can_classic_bytes_max = 8;
inline constexpr std::size_t can_bytes_max = 64;  ///< per CAN FD frame

/// One bit per bit of a frame, by DBC number.
using CanBits = std::bitset<8 * can_bytes_max>;

/// Checks identifier, length, place in 8 bytes (FD: 64), float length, scale and multiplexors of a
/// signal.
/// @throws InvalidValue with the keys of CanSignal and CanField
void check(const CanSignal& signal);
/// Checks a field in a frame of a signal with this `fd`, with the same errors.
void check(const CanField& field, bool fd);

/// Smallest frame with the signal and its multiplexors [bytes]. @pre check(signal) passes
[[nodiscard]] std::size_t bytes_needed(const CanSignal& signal) noexcept;
[[nodiscard]] std::size_t bytes_needed(const CanField& field) noexcept;

/// Bits of the signal. Two signals of one frame overlap if these do. @pre check() passes
[[nodiscard]] CanBits bits_of(const CanSignal& signal) noexcept;
[[nodiscard]] CanBits bits_of(const CanField& field) noexcept;

/// Bits of a field, right-aligned. @pre check() passes and payload has at least bytes_needed()
[[nodiscard]] std::uint64_t extract_raw(std::span<const std::uint8_t> payload,
                                        const CanField& field) noexcept;
/// Bits of the signal, right-aligned, not sign-extended. @pre as above
[[nodiscard]] std::uint64_t extract_raw(std::span<const std::uint8_t> payload,
                                        const CanSignal& signal) noexcept;
/// Writes the lowest length_bits of `raw`; other bits of the frame are unchanged. @pre as above
void insert_raw(std::span<std::uint8_t> payload, const CanField& field, std::uint64_t raw) noexcept;
void insert_raw(std::span<std::uint8_t> payload, const CanSignal& signal,
                std::uint64_t raw) noexcept;

/// False if a multiplexor of the frame selects another page. A frame too short for a multiplexor
/// counts as carrying the signal, so that decode() returns bad_frame.
/// @pre check(signal) passes
[[nodiscard]] bool carries(std::span<const std::uint8_t> payload, const CanSignal& signal) noexcept;

/// A decoded value; NaN if and only if there is a fault.
struct CanValue {
  double value{not_a_number};
  Fault fault{Fault::bad_frame};
};

/// Fault that a status with this number indicates.
[[nodiscard]] Fault fault_of(const CanStatus& status, std::uint64_t number) noexcept;

/// value = raw * scale + offset. The first that applies: bad_frame if the frame is too short, the
/// fault of a matching sentinel, out_of_range for a float that is not finite, the fault of the
/// signal's status.
/// @pre check(signal) and carries(payload, signal)
[[nodiscard]] CanValue decode(std::span<const std::uint8_t> payload,
                              const CanSignal& signal) noexcept;

/// raw = round((value - offset) / scale), saturated to the signal's range. Multiplexors are
/// unchanged.
/// @return false if the value was saturated, or is NaN (then nothing is written)
/// @pre as insert_raw
bool encode(double value, std::span<std::uint8_t> payload, const CanSignal& signal) noexcept;

/// Distance of two neighbouring values of the signal; 0 for a float.
[[nodiscard]] double resolution(const CanSignal& signal) noexcept;

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
