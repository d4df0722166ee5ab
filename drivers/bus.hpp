/// Types common to all kinds of buses: start error, outline, sentinels, health of a unit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "estimator/types.hpp"

namespace thermocomp {

/// Thrown by a driver that cannot start; later faults are data.
class DriverError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Description of a bus before it is opened.
struct BusOutline {
  std::string kind;       ///< value of the key `kind`, as in BusHealth
  std::string interface;  ///< "can0"; empty for a bus without interface
  std::size_t units{0};   ///< number of units in the health of its source
  const char* unit_called{"device"};
};

/// A raw value that is a status code of the device, not a temperature.
struct Sentinel {
  std::int64_t code{0};  ///< raw value before scale and offset, with the encoding's signedness
  Fault fault{Fault::open_circuit};
  bool operator==(const Sentinel&) const = default;
};

/// Counters of one bus unit (Modbus unit, CAN node).
struct UnitHealth {
  std::string name;
  bool answering{false};
  std::uint64_t requests{0};  ///< Modbus: requests sent. CAN: 0
  std::uint64_t answers{0};   ///< good answers or frames
  std::uint64_t timeouts{0};
  std::uint64_t exceptions{0};  ///< Modbus exception answers
  std::uint64_t bad_frames{0};  ///< garbled, wrong length, wrong id
  double round_trip_ms{0.0};    ///< of the last good answer
  std::string last_error;       ///< empty if the last exchange was good
};

}  // namespace thermocomp
