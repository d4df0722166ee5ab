/// The parts of the daemon's file that describe CAN interfaces and signals.
#pragma once

#include <cstdint>

#include "config/toml_reader.hpp"
#include "drivers/sensors/sensor_bus_config.hpp"

namespace thermocomp::sections {

/// A network interface's name. Required.
[[nodiscard]] std::string read_interface(const TomlTable& table);

enum class CanUse {
  temperature,  ///< scale, offset_degC, lists of codes
  signal,       ///< scale, offset
  offset,       ///< of an axis, sent or applied: scale
  bits          ///< heartbeat, valid bits: an unsigned number without scale
};
/// What `own` leaves out is as in `base` (which may be `own` again).
[[nodiscard]] CanSignal read_can_signal(const TomlTable& own, const TomlTable& base, CanUse use);

/// The bits of the frame that the signal takes, bit 8 n + k of the mask for bit k of byte n.
/// 0 when it does not fit into 8 bytes.
[[nodiscard]] std::uint64_t frame_bits(const CanSignal& signal);

/// The numbers that raw * scale + offset can be, least and greatest.
[[nodiscard]] Range reach(const CanSignal& signal);

}  // namespace thermocomp::sections
