/// Values in the bits of a CAN frame, classic or FD: pure, no I/O.
///
/// Bits are numbered as DBC files do: bit 8 n + k is bit k (0 = lowest) of byte n. A little_endian
/// signal starts at its least significant bit and grows upwards through the numbers. A big_endian
/// signal starts at its most significant bit, goes down to bit 0 of that byte and continues at bit
/// 7 of the next byte (the sawtooth).
#pragma once

#include <bitset>
#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/can/can_config.hpp"

namespace thermocomp {

inline constexpr std::size_t can_classic_bytes_max = 8;
inline constexpr std::size_t can_bytes_max = 64;  ///< of a CAN FD frame

/// One bit for each bit of a frame, by its DBC number.
using CanBits = std::bitset<8 * can_bytes_max>;

/// Refuses an impossible signal: identifier, length, place in 8 bytes (FD: 64), float length,
/// scale, multiplexors. The keys named are those of CanSignal and CanField.
/// @throws InvalidValue
void check(const CanSignal& signal);
/// The same for a number in a frame of a signal with this `fd`.
void check(const CanField& field, bool fd);

/// Bytes a frame must have to hold the signal and its multiplexors. @pre check(signal) passes
[[nodiscard]] std::size_t bytes_needed(const CanSignal& signal) noexcept;
[[nodiscard]] std::size_t bytes_needed(const CanField& field) noexcept;

/// The bits that belong to the signal. Two signals of one frame overlap when these do.
/// @pre check() passes
[[nodiscard]] CanBits bits_of(const CanSignal& signal) noexcept;
[[nodiscard]] CanBits bits_of(const CanField& field) noexcept;

/// The bits of a field, right-aligned. @pre check() passes and payload has bytes_needed() or more
[[nodiscard]] std::uint64_t extract_raw(std::span<const std::uint8_t> payload,
                                        const CanField& field) noexcept;
/// The signal's bits, right-aligned, not sign-extended. @pre as above
[[nodiscard]] std::uint64_t extract_raw(std::span<const std::uint8_t> payload,
                                        const CanSignal& signal) noexcept;
/// Puts the lowest length_bits of `raw` into the frame; all other bits of it stay. @pre as above
void insert_raw(std::span<std::uint8_t> payload, const CanField& field, std::uint64_t raw) noexcept;
void insert_raw(std::span<std::uint8_t> payload, const CanSignal& signal,
                std::uint64_t raw) noexcept;

/// Whether the frame carries the signal: false when a multiplexor in it shows another page. A frame
/// too short for a multiplexor counts as carrying it, so that decode() can call it bad.
/// @pre check(signal) passes
[[nodiscard]] bool carries(std::span<const std::uint8_t> payload, const CanSignal& signal) noexcept;

/// A decoded value; NaN exactly when there is a fault.
struct CanValue {
  double value{not_a_number};
  Fault fault{Fault::bad_frame};
};

/// What a status with this number says of its value.
[[nodiscard]] Fault fault_of(const CanStatus& status, std::uint64_t number) noexcept;

/// value = raw * scale + offset. A frame too short for the signal is bad_frame, a raw value listed
/// as a sentinel is the sentinel's fault, a float that is not finite is out_of_range; else the
/// status in the frame decides, if the signal has one.
/// @pre check(signal) and carries(payload, signal)
[[nodiscard]] CanValue decode(std::span<const std::uint8_t> payload,
                              const CanSignal& signal) noexcept;

/// raw = round((value - offset) / scale), saturated to what the signal can hold. Multiplexors are
/// left as they are.
/// @return false when the value had to be saturated, or is NaN (then nothing is written)
/// @pre as insert_raw
bool encode(double value, std::span<std::uint8_t> payload, const CanSignal& signal) noexcept;

/// How far apart two neighbouring values of the signal are; 0 for a float.
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
