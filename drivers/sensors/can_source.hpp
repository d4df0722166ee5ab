/// Thermocouple readings from the frames of one CAN interface.
#pragma once

#include <atomic>
#include <cstddef>
#include <mutex>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/sensors/sensor_bus_config.hpp"
#include "drivers/sensors/sensor_source.hpp"
#include "drivers/wait_free_slot.hpp"
#include "drivers/wake_event.hpp"

namespace thermocomp {

/// Listens only. A reading's time is that of its frame's arrival at the interface. While the
/// interface is missing, down or bus-off its readings are no_answer; it is tried again for ever.
class CanSource final : public SensorSource {
 public:
  /// @throws InvalidValue for a signal, interface or number of identifiers that cannot be
  explicit CanSource(CanBusConfig config);
  ~CanSource() override;

  /// @throws DriverError when the system has no CAN sockets at all
  void start() override;
  void stop() noexcept override;
  void newest(std::span<Reading> all) noexcept override;
  [[nodiscard]] BusHealth health() const override;

 private:
  struct Channel {
    CanId id;
    CanSignal signal;
    std::size_t device{0};  ///< index in the bus' configuration
    std::size_t sensor{0};  ///< index in the whole configuration
  };

  void run();
  bool open();
  void take(std::span<const CanFrame> frames);
  void take(const CanFrame& frame);
  void lose_all();
  void publish();
  void note_health();

  const CanBusConfig config_;
  std::vector<Channel> channels_;  ///< in the order of the identifiers
  CanSocket socket_;
  WakeEvent wake_;
  std::atomic<bool> stopping_{false};
  std::vector<Reading> readings_;       ///< one a channel; the thread's own
  std::vector<nanoseconds> last_good_;  ///< arrival of each device's last good frame; 0: none
  WaitFreeSlot<std::vector<Reading>> slot_;
  mutable std::mutex health_mutex_;
  BusHealth health_;
  BusThread thread_;
};

}  // namespace thermocomp
