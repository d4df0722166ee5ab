/// Configuration of a J1939 bus.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/bus.hpp"

namespace thermocomp {

/// Place of a suspect parameter (SPN) in a parameter group (PGN); unsigned, as in J1939-71.
struct J1939Parameter {
  std::uint32_t pgn{0};  ///< 18 bits
  int start_byte{0};     ///< counted from 0; in documents from 1
  int start_bit{0};      ///< of that byte, counted from 0; in documents from 1
  int length_bits{16};   ///< 2..32
  double scale{1.0};     ///< value = raw * scale + offset
  double offset{0.0};
  std::vector<Sentinel> sentinels;           ///< take precedence over the ranges of the standard
  Fault error{Fault::device_error};          ///< fault for the standard's "error"
  Fault not_available{Fault::device_error};  ///< fault for the standard's "not available"
  bool operator==(const J1939Parameter&) const = default;
};

struct J1939Channel {
  std::size_t sensor{0};  ///< index of the sensor in the configuration
  J1939Parameter parameter;
  bool operator==(const J1939Channel&) const = default;
};

struct J1939NodeConfig {
  std::string name;
  /// Source address, 0..253; nullopt: only the address that its NAME claims.
  std::optional<int> address;
  std::optional<std::uint64_t> name_claimed;  ///< the device's NAME; nullopt: any
  std::vector<J1939Channel> channels;
  bool operator==(const J1939NodeConfig&) const = default;
};

struct J1939BusConfig {
  static constexpr std::array kinds{"j1939"};
  std::string name;
  std::string interface;
  double reconnect_s{0.5};  ///< pause between attempts to open the interface
  /// Address to claim; needed for messages sent to one node (RTS/CTS). nullopt: only the request
  /// for the other nodes' NAMEs is sent.
  std::optional<int> own_address;
  std::uint64_t own_name{0};
  std::vector<J1939NodeConfig> nodes;
  [[nodiscard]] BusOutline outline() const { return {kinds[0], interface, nodes.size(), "device"}; }
  bool operator==(const J1939BusConfig&) const = default;
};

}  // namespace thermocomp
