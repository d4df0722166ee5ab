/// Reads the places of values in the CAN frames of a simulated machine, and finds overlaps.
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "config/toml/toml_reader.hpp"
#include "drivers/can/signal_codec.hpp"

namespace thermocomp {

/// Selects the key of a value's offset, and its sign. Only temperatures may be multiplexed.
enum class CanUse { temperature, signal, bits };

[[nodiscard]] CanSignal read_can(const TomlTable& table, CanUse use);
/// The counter in the signal's frames, if the table has one.
[[nodiscard]] std::optional<CanField> read_counter(const TomlTable& table, const CanSignal& signal);

/// Bits in use in the frames of a bus; values of one frame must not overlap.
class FramesTaken {
 public:
  /// Takes the bits of the value and its multiplexors. @return all were free
  bool take(const CanSignal& signal);
  /// Likewise for a counter in its frame, which several values may share.
  bool take(const CanSignal& signal, const CanField& counter);

 private:
  struct Frame {
    std::vector<CanSignal> values;
    std::vector<CanField> fields;  ///< multiplexors and counters, present on every page
  };
  static bool take(Frame& frame, const CanField& field);

  std::map<std::pair<std::uint32_t, bool>, Frame> frames_;
};

}  // namespace thermocomp
