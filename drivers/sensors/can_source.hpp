/// Thermocouple readings from the frames of one CAN interface.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "drivers/can/can_socket.hpp"
#include "drivers/sensors/sensor_bus_config.hpp"
#include "drivers/sensors/sensor_source.hpp"
#include "drivers/wait_free_slot.hpp"
#include "drivers/wake_event.hpp"

namespace thermocomp {

/// Listens only. A reading's time is that of its frame's arrival at the interface. A frame whose
/// counter shows what it showed before is none: neither value nor time change (the first frame
/// after the bus was lost has nothing before it). While the interface is missing, down or bus-off
/// its readings are no_answer; it is tried again for ever.
///
/// Frames are fetched in batches, each 10 ms at the earliest after the one before: their times are
/// the kernel's, and a full bus costs little.
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
    std::optional<CanField> counter;
    std::size_t device{0};  ///< index in the bus' configuration
    std::size_t sensor{0};  ///< index in the whole configuration
    /// What the counter showed in the last frame of the identifier, and in the last of these that
    /// carried the signal. Devices count frames or rounds of all pages: either is progress.
    std::optional<std::uint64_t> count_of_frame{};
    std::optional<std::uint64_t> count_of_page{};
  };
  enum class Arrival { other_page, stood_still, renewed, bad_frame };

  void run();
  bool open();
  void receive();
  void take(std::span<const CanFrame> frames);
  void take(const CanFrame& frame);
  static Arrival arrival_of(const CanFrame& frame, Channel& channel) noexcept;
  static void note_arrival(Arrival arrival, UnitHealth& unit);
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
