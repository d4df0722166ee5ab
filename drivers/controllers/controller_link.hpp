/// Link to a machine controller that takes offsets and reports what it applies.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "estimator/types.hpp"

namespace thermocomp {

/// Result of the writes to a controller.
struct WriteHealth {
  std::uint64_t refused{0};     ///< answered with an exception
  std::uint64_t unanswered{0};  ///< not answered, or (CAN) not sent by the interface
  std::uint64_t late{0};        ///< exchanges (reads and writes) longer than the link's period
  nanoseconds confirmed_at{};   ///< CLOCK_MONOTONIC of the newest confirmed write; 0: none
  std::string error;            ///< of the newest write; empty: it succeeded
  // Modbus, of the newest write if it failed; else 0
  int function{0};
  int address{0};
  int exception{0};
};

struct ControllerHealth {
  std::string name;
  std::string kind;  ///< "modbus_tcp", "modbus_rtu", "can", "linuxcnc", "dry_run"
  bool connected{false};
  std::uint64_t connects{0};
  std::uint64_t writes{0};  ///< offsets sent
  std::uint64_t write_errors{0};
  std::uint64_t reads{0};
  std::uint64_t read_errors{0};
  WriteHealth write;
  std::string last_error;  ///< empty if the last exchange and the last write were good
  /// CAN: "down", "active", "warning", "passive" or "bus_off"; else empty
  std::string state;
  nanoseconds state_since{};  ///< CLOCK_MONOTONIC of the change to `state`
  std::uint64_t bus_offs{0};  ///< CAN: number of times the interface left the bus
  /// Dry run of a controller that is read: offsets really applied [um]; NaN: unknown.
  std::optional<std::array<double, axes_max>> shown_um{};
};

/// Rule of the link: after every (re)connection and every failed write it takes a new epoch, reads
/// back the applied offsets, publishes both together, and sends only offsets marked with that
/// epoch. So the first offset sent starts from the applied one.
class ControllerLink {
 public:
  ControllerLink() = default;
  ControllerLink(const ControllerLink&) = delete;
  ControllerLink& operator=(const ControllerLink&) = delete;
  virtual ~ControllerLink() = default;

  virtual void start() = 0;                                       ///< @throws DriverError
  virtual void stop() noexcept = 0;                               ///< within a second
  virtual void newest(ControllerState& state) noexcept = 0;       ///< wait-free; one reader
  virtual void offer(const OffsetCommand& command) noexcept = 0;  ///< wait-free; one writer
  [[nodiscard]] virtual ControllerHealth health() const = 0;
};

}  // namespace thermocomp
