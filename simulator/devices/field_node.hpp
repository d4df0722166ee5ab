/// A simulated node above CAN frames: fed with frames, times and temperatures, asked for frames.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "drivers/can/can_socket.hpp"
#include "simulator/plant/field_node_config.hpp"

namespace thermocomp {

class FieldNode {
 public:
  FieldNode() = default;
  FieldNode(const FieldNode&) = delete;
  FieldNode& operator=(const FieldNode&) = delete;
  virtual ~FieldNode() = default;

  virtual void take(const CanFrame& frame, nanoseconds now) = 0;
  /// @param temps_degC  one a channel
  virtual void update(nanoseconds now, std::span<const double> temps_degC) = 0;
  [[nodiscard]] virtual std::optional<CanFrame> next_frame() = 0;
};

/// Switches the node on.
#define THERMOCOMP_DECLARE_NODE(table, Config) \
  [[nodiscard]] std::unique_ptr<FieldNode> switch_on(const Config& node, nanoseconds now);
THERMOCOMP_FIELD_NODES(THERMOCOMP_DECLARE_NODE)
#undef THERMOCOMP_DECLARE_NODE

}  // namespace thermocomp
