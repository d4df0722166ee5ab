/// What every kind of bus has: the error of its start, its outline, values that are messages, the
/// health of a unit.
#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "estimator/types.hpp"

namespace thermocomp {

/// What a driver throws when it cannot start; once it runs, trouble is data.
class DriverError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// How a bus is described to people before it is opened.
struct BusOutline {
  std::string kind;       ///< as the key `kind` and BusHealth tell it
  std::string interface;  ///< "can0"; empty where the bus has none
  std::size_t units{0};   ///< as many as its source's health has
  const char* unit_called{"device"};
};

/// A raw value that is a message of the device, not a temperature.
struct Sentinel {
  std::int64_t code{0};  ///< raw value before scale and offset (of the encoding's signedness)
  Fault fault{Fault::open_circuit};
  bool operator==(const Sentinel&) const = default;
};

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
