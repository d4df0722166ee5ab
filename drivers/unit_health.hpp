/// What one device on a bus has answered, for an operator.
#pragma once

#include <cstdint>
#include <string>

namespace thermocomp {

/// Counters of one bus unit (Modbus unit, CAN node) for an operator.
struct UnitHealth {
  std::string name;  ///< the device's name in the configuration
  bool answering{false};
  std::uint64_t requests{0};  ///< Modbus: requests sent. CAN: 0
  std::uint64_t answers{0};   ///< good answers or frames
  std::uint64_t timeouts{0};
  std::uint64_t exceptions{0};  ///< Modbus exception answers
  std::uint64_t bad_frames{0};  ///< garbled, wrong length, wrong id
  double round_trip_ms{0.0};    ///< last good answer
  std::string last_error;       ///< empty when the last exchange was good
};

}  // namespace thermocomp
