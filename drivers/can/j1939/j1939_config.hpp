/// What a J1939 bus is built from: plain structures, filled by config/ or by a test.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "drivers/bus.hpp"

namespace thermocomp {

/// Where a suspect parameter (SPN) stands in a parameter group (PGN). Unsigned, as J1939-71 has it.
struct J1939Parameter {
  std::uint32_t pgn{0};  ///< 18 bits
  int start_byte{0};     ///< counted from 0; in documents from 1
  int start_bit{0};      ///< of that byte, counted from 0; in documents from 1
  int length_bits{16};   ///< 2..32
  double scale{1.0};     ///< value = raw * scale + offset
  double offset{0.0};
  std::vector<Sentinel> sentinels;           ///< take precedence over the standard's ranges
  Fault error{Fault::device_error};          ///< what the standard's "error" means here
  Fault not_available{Fault::device_error};  ///< ... and "not available"
  bool operator==(const J1939Parameter&) const = default;
};

struct J1939Channel {
  std::size_t sensor{0};  ///< index of the sensor in the configuration
  J1939Parameter parameter;
  bool operator==(const J1939Channel&) const = default;
};

struct J1939NodeConfig {
  std::string name;
  /// Source address, 0..253; nullopt: only the one that its NAME claims.
  std::optional<int> address;
  std::optional<std::uint64_t> name_claimed;  ///< the device's NAME; nullopt: any
  std::vector<J1939Channel> channels;
  bool operator==(const J1939NodeConfig&) const = default;
};

struct J1939BusConfig {
  static constexpr std::array kinds{"j1939"};
  std::string name;
  std::string interface;    ///< "can0"
  double reconnect_s{0.5};  ///< pause before the interface is tried again
  /// Claimed for us; needed to take messages that are sent to one node (RTS/CTS). nullopt: we send
  /// nothing but the request for the others' NAMEs.
  std::optional<int> own_address;
  std::uint64_t own_name{0};
  std::vector<J1939NodeConfig> nodes;
  [[nodiscard]] BusOutline outline() const { return {kinds[0], interface, nodes.size(), "device"}; }
  bool operator==(const J1939BusConfig&) const = default;
};

}  // namespace thermocomp
