/// Buses, devices and controller of the simulated machine: values in, bytes on real buses out.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "simulator/devices/event_loop.hpp"
#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

/// Where a bus can be reached.
struct BusPlace {
  std::string name;
  SimulatedBusKind kind{SimulatedBusKind::modbus_tcp};
  int port{0};              ///< Modbus TCP
  std::string path;         ///< RTU: the link; CAN: the interface
  std::string unavailable;  ///< why it is not there (CAN only); else empty
};

class SimulatedMachine {
 public:
  /// Opens every bus. A CAN interface that is not there is reported in places() and tried again.
  /// @param columns  names of the values that update() gets
  /// @param source   what has these columns, for messages
  /// @throws std::runtime_error for a column that is missing or a bus that cannot be opened
  SimulatedMachine(EventLoop& loop, const MachineConfig& config,
                   const std::vector<std::string>& columns, const std::string& source);
  ~SimulatedMachine();

  [[nodiscard]] const std::vector<BusPlace>& places() const noexcept;
  /// Carries values and scripted events into registers and frames; all registers change between
  /// two requests of any client.
  /// @param now      real time
  /// @param row      one value a column
  /// @param new_row  every device converts now, whatever its period
  void update(nanoseconds now, double plant_time_s, std::span<const double> row, bool new_row);

  /// Offset that the controller applies to the axis of this output, in the positive direction of
  /// the axis; 0 where no axis has it.
  [[nodiscard]] double applied_um(const std::string& output) const;
  /// Whether a heartbeat has ever been seen to beat (true without a controller).
  [[nodiscard]] bool heartbeat_seen() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
