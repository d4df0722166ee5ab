/// A bus that brings readings: opened once, read by the cycle without ever waiting.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "drivers/bus.hpp"
#include "estimator/types.hpp"

namespace thermocomp {

struct BusHealth {
  std::string name;
  std::string kind;  ///< of the configuration: "modbus_tcp", "can", ...
  bool connected{false};
  std::uint64_t connects{0};  ///< times the bus was opened
  std::string last_error;
  std::vector<UnitHealth> units;
  /// CAN: "down", "active", "warning", "passive" or "bus_off"; else empty
  std::string state;
  nanoseconds state_since{};      ///< CLOCK_MONOTONIC when it was entered
  std::uint64_t error_frames{0};  ///< CAN: error frames of every kind
  std::uint64_t bus_offs{0};      ///< CAN: times the interface left the bus
  std::uint64_t restarts{0};      ///< CAN: times its driver restarted the interface
  std::uint64_t dropped{0};       ///< CAN: frames lost because they came faster than they were read
};

class SensorSource {
 public:
  SensorSource() = default;
  SensorSource(const SensorSource&) = delete;
  SensorSource& operator=(const SensorSource&) = delete;
  virtual ~SensorSource() = default;

  /// Starts the bus' thread. A bus that is not there yet is not an error: it is tried again for
  /// ever.
  /// @throws DriverError when the configuration cannot work on this system at all
  virtual void start() = 0;
  /// Ends the thread within a second. The readings stay as they were.
  virtual void stop() noexcept = 0;
  /// Copies this bus' newest readings into `all` (one entry per configured sensor, in the order of
  /// the configuration; entries of other buses are left alone). Wait-free, no allocation; called
  /// by one thread only.
  virtual void newest(std::span<Reading> all) noexcept = 0;
  /// For the operator; any ordinary thread, may lock.
  [[nodiscard]] virtual BusHealth health() const = 0;
};

}  // namespace thermocomp
