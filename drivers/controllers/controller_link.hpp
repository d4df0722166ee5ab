/// A machine controller that takes offsets and tells what it does with them.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "estimator/types.hpp"

namespace thermocomp {

/// What becomes of the writes to a controller.
struct WriteHealth {
  std::uint64_t refused{0};     ///< answered with an exception
  std::uint64_t unanswered{0};  ///< not answered, or (CAN) not sent by the interface
  std::uint64_t late{0};        ///< turns of the link, reads and writes, longer than its period
  nanoseconds confirmed_at{};   ///< CLOCK_MONOTONIC of the newest that was confirmed; 0: none
  std::string error;            ///< why the newest failed; empty: it did not
  // Modbus, of the newest where it failed; 0 else
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
  std::string last_error;  ///< empty when the last exchange was good, and the last write
  /// CAN: "down", "active", "warning", "passive" or "bus_off"; else empty
  std::string state;
  nanoseconds state_since{};  ///< CLOCK_MONOTONIC when it was entered
  std::uint64_t bus_offs{0};  ///< CAN: times the interface left the bus
  /// Dry run of a controller that is read: what it really applies [um], NaN: not known.
  std::optional<std::array<double, axes_max>> shown_um{};
};

/// Rule of the link: after every (re)connection and after every write that failed the link takes a
/// new epoch, reads back what the controller applies, publishes both together, and sends no offset
/// that is not marked with that epoch. So the first offset sent starts from what is applied.
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
