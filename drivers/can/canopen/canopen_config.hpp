/// Configuration of a CANopen bus.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/bus.hpp"
#include "drivers/can/can_config.hpp"

namespace thermocomp {

inline constexpr std::size_t canopen_bytes_max = 8;  ///< per frame; CANopen FD is another protocol

/// Address of an entry in a node's object dictionary.
struct ObjectAddress {
  std::uint16_t index{0};
  std::uint8_t sub{0};
  bool operator==(const ObjectAddress&) const = default;
};

/// A value written to the node before it is started, and verified.
struct CanopenWrite {
  ObjectAddress object;
  std::vector<std::uint8_t> bytes;  ///< 1..4, least significant first
  bool operator==(const CanopenWrite&) const = default;
};

/// One object in a TPDO.
struct CanopenMapped {
  ObjectAddress object;  ///< indices below 0x20 are fillers
  int length_bits{0};
  bool operator==(const CanopenMapped&) const = default;
};

/// A TPDO with known mapping: its objects are consecutive from bit 0.
struct CanopenMapping {
  std::uint32_t cob_id{0};
  std::vector<CanopenMapped> objects;
  bool operator==(const CanopenMapping&) const = default;
};

enum class CanopenWay {
  pdo_bits,    ///< bits of a TPDO, given by cob_id and signal.start_bit
  pdo_object,  ///< an object, found in a mapping
  sdo          ///< an object, read every poll_s
};

/// An object that shows whether the value of a polled one is good.
struct CanopenStatus {
  ObjectAddress object;
  CanStatus number;  ///< within the object's bytes
  bool operator==(const CanopenStatus&) const = default;
};

struct CanopenChannel {
  std::size_t sensor{0};  ///< index of the sensor in the configuration
  CanopenWay way{CanopenWay::pdo_bits};
  ObjectAddress object;  ///< not for pdo_bits
  /// Format and scale; for pdo_bits also `id` and `start_bit`. length_bits is that of the object.
  CanSignal signal;
  double poll_s{1.0};
  /// Only for sdo: a value is accepted between two good statuses.
  std::optional<CanopenStatus> status{};
  int emergency_channel{0};  ///< number of the channel in emergency messages; 0: none
  /// Emergency error codes that set device_error until the errors are reset.
  std::vector<std::uint16_t> emergency_codes;
  bool operator==(const CanopenChannel&) const = default;
};

enum class EmergencyForm {
  generic,  ///< error code and register only
  jumo      ///< JUMO CANtrans: code 0x5030, byte 4 the channel, byte 5 break or short circuit
};

struct CanopenNodeConfig {
  std::string name;
  int node{1};  ///< 1..127
  /// Heartbeat period, written to the node's object 1017; 0: not written.
  double heartbeat_s{0.0};
  double heartbeat_timeout_s{0.0};  ///< lost after this long without one; 0: not watched
  double pdo_period_s{0.0};         ///< period of each TPDO; 0: unknown
  /// TPDOs are sent on change: the last one is valid while heartbeats arrive.
  bool pdo_on_change{false};
  EmergencyForm emergency{EmergencyForm::generic};
  std::vector<CanopenWrite> writes;
  std::vector<CanopenMapping> mappings;
  std::vector<int> mappings_read;  ///< numbers of TPDOs to read COB-ID and mapping from
  std::vector<CanopenChannel> channels;
  bool operator==(const CanopenNodeConfig&) const = default;
};

struct CanopenBusConfig {
  static constexpr std::array kinds{"canopen"};
  std::string name;
  std::string interface;
  double reconnect_s{0.5};  ///< pause between attempts to open the interface
  bool start_nodes{true};   ///< NMT start, also after a node's reboot
  int own_node{0};          ///< node number of our heartbeat; 0: none is sent
  double heartbeat_s{1.0};  ///< period of our heartbeat
  double sync_s{0.0};       ///< period of SYNC; 0: none is sent
  double sdo_timeout_s{0.5};
  std::vector<CanopenNodeConfig> nodes;
  [[nodiscard]] BusOutline outline() const { return {kinds[0], interface, nodes.size(), "node"}; }
  bool operator==(const CanopenBusConfig&) const = default;
};

}  // namespace thermocomp
