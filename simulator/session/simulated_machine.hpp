/// Buses, devices and controller of the simulated machine; transfers values to real buses.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "simulator/devices/event_loop.hpp"
#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

[[nodiscard]] inline double seconds_of(std::chrono::nanoseconds time) {
  return std::chrono::duration<double>(time).count();
}

struct BusPlace {
  std::string name;
  SimulatedBusKind kind{SimulatedBusKind::modbus_tcp};
  int port{0};              ///< Modbus TCP
  std::string path;         ///< RTU: the link; CAN: the interface
  std::string unavailable;  ///< reason why it is missing (CAN only); else empty
};

class SimulatedMachine {
 public:
  /// Opens every bus. A missing CAN interface is reported in places() and retried.
  /// @param columns  names of update()'s values
  /// @param source   origin of the columns, for messages
  /// @throws std::runtime_error for a missing column or a bus that cannot be opened
  SimulatedMachine(EventLoop& loop, const MachineConfig& config,
                   const std::vector<std::string>& columns, const std::string& source);
  ~SimulatedMachine();

  [[nodiscard]] const std::vector<BusPlace>& places() const noexcept;
  /// Transfers values and scripted events to registers and frames, between two requests.
  /// @param now      real time
  /// @param row      one value per column
  /// @param new_row  every device converts now, regardless of its period
  void update(nanoseconds now, double plant_time_s, std::span<const double> row, bool new_row);

  /// Offset applied to this output's axis, in its positive direction; 0: no such axis.
  [[nodiscard]] double applied_um(const std::string& output) const;
  /// The heartbeat has ever changed (true without a controller).
  [[nodiscard]] bool heartbeat_seen() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
