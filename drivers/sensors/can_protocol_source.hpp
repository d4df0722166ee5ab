/// Thermocouple readings of what speaks a protocol on one CAN interface: CANopen, J1939.
#pragma once

#include <atomic>
#include <cstddef>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "drivers/can/can_protocol.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/can/canopen/canopen_config.hpp"
#include "drivers/can/j1939/j1939_config.hpp"
#include "drivers/sensors/sensor_source.hpp"
#include "drivers/wait_free_slot.hpp"
#include "drivers/wake_event.hpp"

namespace thermocomp {

/// Gives a protocol its socket, its clock and its thread. While the interface is missing, down or
/// bus-off the protocol is closed, which makes its readings no_answer; it is opened again for ever.
class CanProtocolSource final : public SensorSource {
 public:
  /// @param kind  as BusHealth tells it
  /// @throws InvalidValue for an interface or a number of identifiers that cannot be
  CanProtocolSource(std::string name, std::string kind, std::string interface, double reconnect_s,
                    std::unique_ptr<CanProtocol> protocol);
  ~CanProtocolSource() override;

  /// @throws DriverError when the system has no CAN sockets at all
  void start() override;
  void stop() noexcept override;
  void newest(std::span<Reading> all) noexcept override;
  [[nodiscard]] BusHealth health() const override;

 private:
  void run();
  void follow_link();
  void send();
  void publish();
  void note_health();

  const std::string name_;
  const double reconnect_s_;
  std::unique_ptr<CanProtocol> protocol_;
  const std::vector<std::size_t> sensors_;
  CanSocket socket_;
  WakeEvent wake_;
  std::atomic<bool> stopping_{false};
  bool usable_{false};  ///< the protocol was told that the bus is open
  WaitFreeSlot<std::vector<Reading>> slot_;
  mutable std::mutex health_mutex_;
  BusHealth health_;
  BusThread thread_;
};

/// @throws InvalidValue for a configuration that cannot work
[[nodiscard]] std::unique_ptr<SensorSource> make_source(const CanopenBusConfig& config);
[[nodiscard]] std::unique_ptr<SensorSource> make_source(const J1939BusConfig& config);

}  // namespace thermocomp
