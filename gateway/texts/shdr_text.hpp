/// Snapshot as lines of an MTConnect adapter (SHDR, "simple hierarchical data representation"),
/// `time|item|value|...` and `time|item|level|code|severity|qualifier|text`, and the device file
/// that defines the items. Pure.
/// Source: MTConnect Institute, cppagent, "Adapter Agent Protocol", version 2.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// Values by data item; a condition has one entry per reason.
using ShdrStates = std::map<std::string, std::vector<std::string>>;

/// Data items: `avail`; `temp_<sensor>` [degC]; `offset_<axis>`, `displacement_<axis>` [mm or deg];
/// `mode`; conditions `system`, `sensor_<sensor>`, `bus_<bus>`. UNAVAILABLE while the daemon is
/// away.
[[nodiscard]] ShdrStates shdr_states(const Snapshot& snapshot);

/// Lines for the differences of two states; all of `now` if `before` is empty. Items no longer
/// present (a sensor of another configuration) become UNAVAILABLE. Each line ends with "\n".
[[nodiscard]] std::string shdr_lines(const ShdrStates& before, const ShdrStates& now,
                                     double wall_s);

/// `* PONG 10000` to `* PING`; empty otherwise.
[[nodiscard]] std::string shdr_answer(std::string_view line, double heartbeat_s);

/// Only letters, digits and `_`, as SHDR items and XML ids allow: see distinct_name().
[[nodiscard]] std::string item_name(const std::string& kind, const std::string& name);

/// Device file (MTConnectDevices 1.8) of a machine with these sensors, axes and buses.
[[nodiscard]] std::string device_file(const Snapshot& snapshot, const std::string& machine);

}  // namespace thermocomp::gateway
