/// Configuration of simulated CANopen and J1939 nodes.
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

/// Fault that a device can report instead of a temperature.
enum class ChannelFault { open_circuit, short_circuit, over_range, under_range, error };
/// Raw codes by fault; the first of a list is shown unless an event selects another.
using FaultCodes = std::map<ChannelFault, std::vector<std::int64_t>>;

/// Code shown for the fault: `named` if listed, else the first listed; nullopt: no fault or code.
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

/// Codes of a value's status in a CAN device.
struct CanStatusCodes {
  std::int64_t good{0};
  FaultCodes codes;
};

enum class NodeEventKind {
  open_circuit,  ///< the channel's code; else an emergency message, or J1939's error code
  short_circuit,
  over_range,
  under_range,
  channel_error,
  heartbeat_loss,  ///< only the heartbeat stops; CANopen only
  sdo_abort,       ///< each SDO request is answered with an abort; CANopen only
  silence          ///< neither sends nor answers
};

struct NodeEvent {
  NodeEventKind kind{NodeEventKind::silence};
  std::size_t channel{0};
  double at_s{0.0};  ///< real time since power-up
  double duration_s{0.0};
  std::optional<std::int64_t> code{};  ///< none: the channel's first for the fault
};

/// Channel fault of this kind of event; nullopt: the event concerns the whole node.
[[nodiscard]] std::optional<ChannelFault> channel_fault(NodeEventKind kind);

struct CanopenNodeChannel {
  std::string column;  ///< of the plant or of the replayed run file
  /// From its preset; none: object 7130, an int16 of 0.1 degC per count, in TPDO 1.
  std::optional<CanopenChannel> place{};
  FaultCodes codes{};  ///< instead of the value
  CanStatusCodes status{};
};

/// Its object dictionary has the channels' places and TPDO 1; a reset restores it.
struct SimulatedCanopenNode {
  std::string name;
  std::string interface;
  int node{1};
  std::uint32_t cob_id{0};  ///< TPDO 1
  double period_s{0.05};    ///< period of the TPDOs; 0: sent after each SYNC
  double heartbeat_s{0.0};  ///< initial value of object 1017; 0: none
  EmergencyForm emergency{EmergencyForm::jumo};
  std::vector<CanopenNodeChannel> channels;
  std::vector<NodeEvent> events;
};

struct J1939NodeChannel {
  std::string column;
  J1939Parameter place;
  FaultCodes codes{};  ///< instead of the value, in addition to the standard's
};

struct SimulatedJ1939Node {
  std::string name;
  std::string interface;
  int address{0};
  std::uint64_t name_claimed{0};
  double period_s{0.1};  ///< period of each group; more than 8 bytes are broadcast in packets
  std::vector<J1939NodeChannel> channels;
  std::vector<NodeEvent> events;
};

/// Each kind needs read_node() (simulator/files) and switch_on() (simulator/devices).
using SimulatedNode = std::variant<SimulatedCanopenNode, SimulatedJ1939Node>;

}  // namespace thermocomp
