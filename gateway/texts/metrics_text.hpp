/// Snapshot in Prometheus' text format 0.0.4: base units (celsius, meters, seconds), one set of
/// labels per sensor, axis, bus.
#pragma once

#include <string>

#include "gateway/feed/snapshot.hpp"

namespace thermocomp::gateway {

/// Figures of the gateway itself.
struct GatewayFigures {
  std::uint64_t pages{0};     ///< open event streams
  std::uint64_t requests{0};  ///< answered requests
  std::uint64_t refused{0};   ///< of these, refused by a rule of the gateway
  bool mqtt_enabled{false};
  bool mqtt_connected{false};
  std::uint64_t mqtt_dropped{0};  ///< messages dropped because the buffer was full
};

/// While the daemon is away, only `thermocomp_up` (0) and the gateway's own figures are written, so
/// that other series end instead of repeating old values.
[[nodiscard]] std::string metrics_text(const Snapshot& snapshot, const GatewayFigures& figures);

}  // namespace thermocomp::gateway
