/// Simulated CANopen and J1939 nodes as the machine's file gives them: [[canopen_node]] and
/// [[j1939_node]].
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace thermocomp {

enum class NodeEventKind {
  open_circuit,    ///< of a channel: an emergency message; J1939: the standard's error code
  short_circuit,   ///< the same; CANopen only
  heartbeat_loss,  ///< all but the heartbeat goes on; CANopen only
  sdo_abort,       ///< each SDO request is answered with an abort; CANopen only
  silence          ///< nothing is sent, nothing answered
};

struct NodeEvent {
  NodeEventKind kind{NodeEventKind::silence};
  std::size_t channel{0};
  double at_s{0.0};  ///< real time since the node was switched on
  double duration_s{0.0};
};

struct CanopenNodeChannel {
  std::string column;  ///< of the plant or of the replayed run file
};

/// Sends TPDO 1 with an int16 a channel (objects 7130:01 on, 0.1 degC a count), which its object
/// dictionary tells; what is written there is kept until a reset.
struct SimulatedCanopenNode {
  std::string name;
  std::string interface;
  int node{1};
  std::uint32_t cob_id{0};  ///< of TPDO 1
  double period_s{0.05};    ///< of TPDO 1; 0: sent after each SYNC
  double heartbeat_s{0.0};  ///< until object 1017 is written; 0: none
  std::vector<CanopenNodeChannel> channels;
  std::vector<NodeEvent> events;
};

struct J1939NodeChannel {
  std::string column;
  std::uint32_t pgn{0};
  int start_byte{0};  ///< counted from 0; 16 bits, 0.03125 degC a count, -273 degC
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

}  // namespace thermocomp
