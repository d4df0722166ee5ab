/// Sections of the daemon's file for CAN interfaces and signals.
#pragma once

#include <bitset>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/toml/toml_reader.hpp"
#include "drivers/can/can_config.hpp"

namespace thermocomp::sections {

/// A network interface's name. Required.
[[nodiscard]] std::string read_interface(const TomlTable& table);

enum class CanUse {
  temperature,  ///< scale, offset_degC, lists of codes
  signal,       ///< scale, offset
  offset,       ///< of an axis, sent or applied: scale
  bits          ///< heartbeat, valid bits: an unsigned number without scale
};
/// Missing keys are taken from `base` (may be `own`), then from `file`, the signal and its
/// multiplexors in a DBC file. Multiplexors are for temperatures only.
[[nodiscard]] CanSignal read_can_signal(const TomlTable& own, const TomlTable& base, CanUse use,
                                        const CanSignal* file = nullptr);

/// The number `key = { start_bit, length_bits, byte_order }` of the frame, in `own` or else `base`;
/// none if missing in both.
[[nodiscard]] std::optional<CanField> read_can_field(const TomlTable& own, const TomlTable& base,
                                                     std::string_view key, bool fd);

/// The multiplexor in `own` or else `base`, and in `own` its value that selects the signal; empty
/// without a multiplexor.
[[nodiscard]] std::vector<CanSelector> read_selectors(const TomlTable& own, const TomlTable& base,
                                                      bool fd);

/// `status = { start_bit, length_bits, byte_order, mask, lists of codes }` in the signal's frame,
/// in `own` or else `base`; none if missing in both.
[[nodiscard]] std::optional<CanStatus> read_can_status(const TomlTable& own, const TomlTable& base,
                                                       bool fd);
/// Mask and codes of a status at a known place.
[[nodiscard]] CanStatus read_status_numbers(const TomlTable& table, const CanField& field);

/// The lists of codes that are messages instead of values, for a signal at a known place.
[[nodiscard]] std::vector<Sentinel> read_can_codes(const TomlTable& own, const TomlTable& base,
                                                   const CanSignal& signal);

using FrameBits = std::bitset<512>;
/// The bits of the frame that the signal occupies, bit 8 n + k for bit k of byte n. Empty if it
/// does not fit into 8 bytes (FD: 64).
[[nodiscard]] FrameBits frame_bits(const CanSignal& signal);

/// The occupied bits of all frames: values must not overlap.
class TakenBits {
 public:
  void add(const TomlTable& table, std::string_view key, const CanSignal& signal);
  /// Whether the signal's frame, or one of its group, has any value.
  [[nodiscard]] bool has_frame_of(const CanSignal& signal) const;

 private:
  std::map<std::pair<std::uint32_t, bool>, FrameBits> used_;
};

/// The smallest and largest value of raw * scale + offset.
[[nodiscard]] Range reach(const CanSignal& signal);
/// Value of one count; for a float its smallest step.
[[nodiscard]] double count_of(const CanSignal& signal);

}  // namespace thermocomp::sections
