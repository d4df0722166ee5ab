/// Where values stand in the frames of a simulated machine's CAN nodes.
#pragma once

#include <map>
#include <optional>
#include <utility>
#include <vector>

#include "config/toml/toml_reader.hpp"
#include "drivers/can/signal_codec.hpp"

namespace thermocomp {

/// What a value's offset is called, and its sign. Only temperatures may be multiplexed.
enum class CanUse { temperature, signal, bits };

[[nodiscard]] CanSignal read_can(const TomlTable& table, CanUse use);
/// A counter in the frames of the signal, if the table has one.
[[nodiscard]] std::optional<CanField> read_counter(const TomlTable& table, const CanSignal& signal);

/// Which bits of the frames of a bus are taken: two values of one frame must not share any.
class FramesTaken {
 public:
  /// @return whether all bits of the value and its multiplexors were free; takes them
  bool take(const CanSignal& signal);
  /// The same for a counter in its frame; several values may name one counter.
  bool take(const CanSignal& signal, const CanField& counter);

 private:
  struct Frame {
    std::vector<CanSignal> values;
    std::vector<CanField> fields;  ///< multiplexors and counters, which are in every frame
  };
  static bool take(Frame& frame, const CanField& field);

  std::map<std::pair<std::uint32_t, bool>, Frame> frames_;
};

}  // namespace thermocomp
