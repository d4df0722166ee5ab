/// Values in the bits of a CAN frame: pure, no I/O.
///
/// Bits are numbered as DBC files do: bit 8 n + k is bit k (0 = lowest) of byte n. A little_endian
/// signal starts at its least significant bit and grows upwards through the numbers. A big_endian
/// signal starts at its most significant bit, goes down to bit 0 of that byte and continues at bit
/// 7 of the next byte (the sawtooth).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "drivers/sensors/sensor_bus_config.hpp"

namespace thermocomp {

inline constexpr std::size_t can_bytes_max = 8;  ///< of a classic CAN frame

/// Refuses a signal that cannot be: identifier, length, place in 8 bytes, float length, scale.
/// The keys named are those of CanSignal.
/// @throws InvalidValue
void check(const CanSignal& signal);

/// Bytes a frame must have to hold the signal. @pre check(signal) passes
[[nodiscard]] std::size_t bytes_needed(const CanSignal& signal) noexcept;

/// Bits of `payload` that belong to the signal, as a mask over the 64 bits of the frame counted
/// 8 byte + bit (DBC numbers). Two signals of one frame overlap when their masks do.
[[nodiscard]] std::uint64_t bits_of(const CanSignal& signal) noexcept;

/// The signal's bits, right-aligned, not sign-extended.
/// @pre check(signal) passes and payload has bytes_needed(signal) or more
[[nodiscard]] std::uint64_t extract_raw(std::span<const std::uint8_t> payload,
                                        const CanSignal& signal) noexcept;
/// Puts the lowest length_bits of `raw` into the frame; all other bits of it stay. @pre as above
void insert_raw(std::span<std::uint8_t> payload, const CanSignal& signal,
                std::uint64_t raw) noexcept;

/// A decoded value; NaN exactly when there is a fault.
struct CanValue {
  double value{not_a_number};
  Fault fault{Fault::bad_frame};
};

/// value = raw * scale + offset. A frame too short for the signal is bad_frame, a raw value listed
/// as a sentinel is the sentinel's fault, a float that is not finite is out_of_range.
/// @pre check(signal) passes
[[nodiscard]] CanValue decode(std::span<const std::uint8_t> payload,
                              const CanSignal& signal) noexcept;

/// raw = round((value - offset) / scale), saturated to what the signal can hold.
/// @return false when the value had to be saturated, or is NaN (then nothing is written)
/// @pre as insert_raw
bool encode(double value, std::span<std::uint8_t> payload, const CanSignal& signal) noexcept;

/// How far apart two neighbouring values of the signal are; 0 for a float.
[[nodiscard]] double resolution(const CanSignal& signal) noexcept;

}  // namespace thermocomp
