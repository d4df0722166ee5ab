/// Simulated nodes above CAN frames as the machine's file gives them.
#pragma once

#include <algorithm>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"

namespace thermocomp {

/// What a device can say of a channel instead of its temperature.
enum class ChannelFault { open_circuit, short_circuit, over_range, under_range, error };
/// Raw codes for it; the first of a list is shown unless an event names another.
using FaultCodes = std::map<ChannelFault, std::vector<std::int64_t>>;

/// The code that is shown for the fault: `named` if it is listed, else the first listed; nullopt:
/// no fault, or no code for it.
[[nodiscard]] inline std::optional<std::int64_t> code_for(const FaultCodes& codes,
                                                          std::optional<ChannelFault> fault,
                                                          std::optional<std::int64_t> named) {
  if (!fault) return std::nullopt;
  const auto found = codes.find(*fault);
  if (found == codes.end()) return std::nullopt;
  const auto& listed = found->second;
  const bool is_listed = named && std::find(listed.begin(), listed.end(), *named) != listed.end();
  return is_listed ? *named : listed.front();
}

/// Numbers of a status beside a value of a CAN device.
struct CanStatusCodes {
  std::int64_t good{0};
  FaultCodes codes;
};

enum class NodeEventKind {
  open_circuit,  ///< of a channel: its codes; else an emergency message, or J1939's error code
  short_circuit,
  over_range,
  under_range,
  channel_error,
  heartbeat_loss,  ///< all but the heartbeat goes on; CANopen only
  sdo_abort,       ///< each SDO request is answered with an abort; CANopen only
  silence          ///< nothing is sent, nothing answered
};

struct NodeEvent {
  NodeEventKind kind{NodeEventKind::silence};
  std::size_t channel{0};
  double at_s{0.0};  ///< real time since the node was switched on
  double duration_s{0.0};
  std::optional<std::int64_t> code{};  ///< none: the first that the channel has for it
};

/// The channel's fault that an event of this kind is; none: it is of the whole node.
[[nodiscard]] std::optional<ChannelFault> channel_fault(NodeEventKind kind);

struct CanopenNodeChannel {
  std::string column;  ///< of the plant or of the replayed run file
  /// Where its preset has it; none: object 7130, an int16 of 0.1 degC a count, in TPDO 1.
  std::optional<CanopenChannel> place{};
  FaultCodes codes{};  ///< in place of the value
  CanStatusCodes status{};
};

/// Shows its channels where they belong, and what TPDO 1 has in its object dictionary; what is
/// written there is kept until a reset.
struct SimulatedCanopenNode {
  std::string name;
  std::string interface;
  int node{1};
  std::uint32_t cob_id{0};  ///< of TPDO 1
  double period_s{0.05};    ///< of the TPDOs; 0: sent after each SYNC
  double heartbeat_s{0.0};  ///< until object 1017 is written; 0: none
  EmergencyForm emergency{EmergencyForm::jumo};
  std::vector<CanopenNodeChannel> channels;
  std::vector<NodeEvent> events;
};

struct J1939NodeChannel {
  std::string column;
  J1939Parameter place;
  FaultCodes codes{};  ///< in place of the value; beside them those of the standard
};

struct SimulatedJ1939Node {
  std::string name;
  std::string interface;
  int address{0};
  std::uint64_t name_claimed{0};
  double period_s{0.1};  ///< of each group; those of more than 8 bytes are broadcast in packets
  std::vector<J1939NodeChannel> channels;
  std::vector<NodeEvent> events;
};

/// Every kind. It has besides read_node() (simulator/files) and switch_on() (simulator/devices).
using SimulatedNode = std::variant<SimulatedCanopenNode, SimulatedJ1939Node>;

}  // namespace thermocomp
