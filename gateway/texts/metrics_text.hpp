/// A snapshot in Prometheus' text format, version 0.0.4: base units (celsius, meters, seconds), one
/// set of labels a sensor, axis, bus.
#pragma once

#include <string>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// What the gateway says of itself.
struct GatewayFigures {
  std::uint64_t pages{0};     ///< open event streams
  std::uint64_t requests{0};  ///< answered
  std::uint64_t refused{0};   ///< of those, by a rule of the gateway
  bool mqtt_enabled{false};
  bool mqtt_connected{false};
  std::uint64_t mqtt_dropped{0};  ///< messages that the buffer had no room for
};

/// While the daemon is away only `thermocomp_up` (0) and the gateway's own figures are given: a
/// value that nobody measures must end, not stand still.
[[nodiscard]] std::string metrics_text(const Snapshot& snapshot, const GatewayFigures& figures);

}  // namespace thermocomp::gateway
