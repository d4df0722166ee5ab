/// The parts of the daemon's file that describe CAN interfaces and signals.
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
/// What `own` leaves out is taken from `base` (which may be `own` again), then from `file`, the
/// signal as a DBC file has it, with its multiplexors. Multiplexors are for temperatures only.
[[nodiscard]] CanSignal read_can_signal(const TomlTable& own, const TomlTable& base, CanUse use,
                                        const CanSignal* file = nullptr);

/// The number `key = { start_bit, length_bits, byte_order }` of the frame, in `own` or else in
/// `base`; none where neither has it.
[[nodiscard]] std::optional<CanField> read_can_field(const TomlTable& own, const TomlTable& base,
                                                     std::string_view key, bool fd);

/// The multiplexor that `own` or else `base` names, and the number in `own` at which the value is
/// there; none without one.
[[nodiscard]] std::vector<CanSelector> read_selectors(const TomlTable& own, const TomlTable& base,
                                                      bool fd);

/// `status = { start_bit, length_bits, byte_order, mask, lists of codes }` in the signal's frame,
/// in `own` or else in `base`; none where neither has it.
[[nodiscard]] std::optional<CanStatus> read_can_status(const TomlTable& own, const TomlTable& base,
                                                       bool fd);
/// Mask and codes of a status whose place is known.
[[nodiscard]] CanStatus read_status_numbers(const TomlTable& table, const CanField& field);

/// The lists of codes that are messages, not values, for a signal whose place is known.
[[nodiscard]] std::vector<Sentinel> read_can_codes(const TomlTable& own, const TomlTable& base,
                                                   const CanSignal& signal);

using FrameBits = std::bitset<512>;
/// The bits of the frame that the signal takes, bit 8 n + k for bit k of byte n. None when it does
/// not fit into 8 bytes (FD: 64).
[[nodiscard]] FrameBits frame_bits(const CanSignal& signal);

/// Which bits of which frames are taken: no two values of a frame may share any.
class TakenBits {
 public:
  void add(const TomlTable& table, std::string_view key, const CanSignal& signal);
  /// Whether something stands in the signal's frame.
  [[nodiscard]] bool has_frame_of(const CanSignal& signal) const;

 private:
  std::map<std::pair<std::uint32_t, bool>, FrameBits> used_;
};

/// The smallest and greatest value of raw * scale + offset.
[[nodiscard]] Range reach(const CanSignal& signal);
/// What one count of the raw value is; of a float the least step that it can make.
[[nodiscard]] double count_of(const CanSignal& signal);

}  // namespace thermocomp::sections
