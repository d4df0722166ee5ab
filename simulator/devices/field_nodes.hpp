/// Simulated CANopen and J1939 nodes on their interfaces.
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

/// Simulated node on CAN without I/O: takes frames, times and temperatures, gives frames.
class FieldNode {
 public:
  FieldNode() = default;
  FieldNode(const FieldNode&) = delete;
  FieldNode& operator=(const FieldNode&) = delete;
  virtual ~FieldNode() = default;

  virtual void take(const CanFrame& frame, nanoseconds now) = 0;
  /// @param temps_degC  by channel
  virtual void update(nanoseconds now, std::span<const double> temps_degC) = 0;
  [[nodiscard]] virtual std::optional<CanFrame> next_frame() = 0;
};

[[nodiscard]] std::unique_ptr<FieldNode> switch_on(const SimulatedCanopenNode& node,
                                                   nanoseconds now);
[[nodiscard]] std::unique_ptr<FieldNode> switch_on(const SimulatedJ1939Node& node, nanoseconds now);

class FieldNodes {
 public:
  /// @throws std::runtime_error for a missing column
  FieldNodes(const MachineConfig& config, const std::vector<std::string>& columns,
             const std::string& source);
  ~FieldNodes();

  /// Powers the nodes up; their event times count from here.
  void switch_on(nanoseconds now);
  /// Location of a node, for the ready line.
  struct Place {
    std::string name;
    std::string interface;
    std::string unavailable;  ///< reason why its interface is missing; else empty
  };
  [[nodiscard]] std::vector<Place> places() const;
  /// @param row  one value per column; ignored before switch_on()
  void update(nanoseconds now, std::span<const double> row);

 private:
  struct Node;
  std::vector<std::unique_ptr<Node>> nodes_;
};

}  // namespace thermocomp
