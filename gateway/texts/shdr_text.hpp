/// A snapshot as an MTConnect adapter tells it (SHDR, "simple hierarchical data representation"):
/// lines `time|item|value|...` and `time|item|level|code|severity|qualifier|text`, and the device
/// file that gives the items their meaning. Pure.
/// Source: MTConnect Institute, cppagent, "Adapter Agent Protocol", version 2.
#pragma once

#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// What is sent of one data item; a condition has as many entries as it has reasons.
using ShdrStates = std::map<std::string, std::vector<std::string>>;

/// Data items: `avail`; `temp_<sensor>` [degC]; `offset_<axis>`, `displacement_<axis>` [mm or deg];
/// `mode`; conditions `system`, `sensor_<sensor>`, `bus_<bus>`. UNAVAILABLE while the daemon is
/// away.
[[nodiscard]] ShdrStates shdr_states(const Snapshot& snapshot);

/// Lines for what differs between two states; all of `now` where `before` is empty. What has gone
/// (a sensor of another configuration) becomes UNAVAILABLE. Each line ends with "\n".
[[nodiscard]] std::string shdr_lines(const ShdrStates& before, const ShdrStates& now,
                                     double wall_s);

/// `* PONG 10000` for `* PING`; empty for anything else.
[[nodiscard]] std::string shdr_answer(std::string_view line, double heartbeat_s);

/// Letters, digits and `_`, as an item of SHDR and an id of XML may have them: distinct_name().
[[nodiscard]] std::string item_name(const std::string& kind, const std::string& name);

/// The device file (MTConnectDevices 1.8) of a machine with these sensors, axes and buses.
[[nodiscard]] std::string device_file(const Snapshot& snapshot, const std::string& machine);

}  // namespace thermocomp::gateway
