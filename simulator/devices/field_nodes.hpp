/// The simulated CANopen and J1939 nodes on their interfaces.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/can/can_socket.hpp"
#include "simulator/plant/field_node_config.hpp"
#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

/// A simulated node above CAN frames: fed with frames, times and temperatures, asked for frames.
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
[[nodiscard]] std::unique_ptr<FieldNode> switch_on(const SimulatedCanopenNode& node,
                                                   nanoseconds now);
[[nodiscard]] std::unique_ptr<FieldNode> switch_on(const SimulatedJ1939Node& node, nanoseconds now);

class FieldNodes {
 public:
  /// @throws std::runtime_error for a column that is missing
  FieldNodes(const MachineConfig& config, const std::vector<std::string>& columns,
             const std::string& source);
  ~FieldNodes();

  /// Their lives, and with them the times of their events, begin.
  void switch_on(nanoseconds now);
  /// Where each node is, for the line that says that the simulator is ready.
  struct Place {
    std::string name;
    std::string interface;
    std::string unavailable;  ///< why its interface is not there; else empty
  };
  [[nodiscard]] std::vector<Place> places() const;
  /// @param row  one value a column; nothing happens before switch_on()
  void update(nanoseconds now, std::span<const double> row);

 private:
  struct Node;
  std::vector<std::unique_ptr<Node>> nodes_;
};

}  // namespace thermocomp
