/// A bus with readings: opened once, read by the cycle without waiting.
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
  std::uint64_t connects{0};
  std::string last_error;
  std::vector<UnitHealth> units;
  /// CAN: "down", "active", "warning", "passive" or "bus_off"; else empty
  std::string state;
  nanoseconds state_since{};      ///< CLOCK_MONOTONIC of the change to `state`
  std::uint64_t error_frames{0};  ///< CAN: of every kind
  std::uint64_t bus_offs{0};      ///< CAN: number of times the interface left the bus
  std::uint64_t restarts{0};      ///< CAN: restarts of the interface by its driver
  std::uint64_t dropped{0};       ///< CAN: frames lost because they were not read fast enough
};

class SensorSource {
 public:
  SensorSource() = default;
  SensorSource(const SensorSource&) = delete;
  SensorSource& operator=(const SensorSource&) = delete;
  virtual ~SensorSource() = default;

  /// Starts the bus' thread. A bus that is not there yet is no error: it is retried for ever.
  /// @throws DriverError when the configuration cannot work on this system
  virtual void start() = 0;
  /// Ends the thread within a second. The readings stay as they were.
  virtual void stop() noexcept = 0;
  /// Copies this bus' newest readings into `all` (one entry per configured sensor; entries of other
  /// buses are unchanged). Wait-free, no allocation; for one thread.
  virtual void newest(std::span<Reading> all) noexcept = 0;
  /// For any ordinary thread; may lock.
  [[nodiscard]] virtual BusHealth health() const = 0;
};

}  // namespace thermocomp
