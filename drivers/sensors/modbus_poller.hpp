/// What is asked of the units of one Modbus line, when, and what readings the answers become.
#pragma once

#include <mutex>
#include <optional>
#include <vector>

#include "drivers/modbus/shared_line.hpp"
#include "drivers/sensors/modbus_plan.hpp"
#include "drivers/sensors/sensor_source.hpp"
#include "drivers/sensors/unit_backoff.hpp"
#include "drivers/wait_free_slot.hpp"

namespace thermocomp {

/// Each device is read at its period on an absolute schedule. A reading's `taken_at` is when the
/// last answer that gave it a value arrived (with a renewal counter: the last answer in which the
/// counter had moved); a reading with a fault keeps it and has no value.
///
/// A request for several values that a device refuses from the first time on (exception 2 or 3) is
/// split: registers between the values are no longer read, then every value alone.
///
/// A failed request is tried again as the line's `retries` say (for a unit that answered until
/// then); a unit without answer is asked again with growing pauses (UnitBackoff), alone on its
/// line at least every `reconnect_s` (serial: every 3 s, for the sake of late answers). A lost line
/// is opened again every `reconnect_s`.
class ModbusPoller final : public LineUser {
 public:
  /// @param connection  of the configuration's line; outlives the poller
  /// @throws DriverError naming the device and what cannot work
  ModbusPoller(const ModbusBusConfig& config, ModbusConnection& connection);

  [[nodiscard]] const ModbusLine& line() const noexcept override { return config_.line; }
  /// When act() has something to do next; it then waits until that time by itself.
  [[nodiscard]] nanoseconds next_action_at() const noexcept override;
  /// Does one thing: connects, runs one device's round of requests, or tells that the line is lost.
  /// @pre not called again once the connection is cancelled
  void act() override;

  /// From the one reading thread: wait-free.
  void newest(std::span<Reading> all) noexcept;
  /// From any ordinary thread.
  [[nodiscard]] BusHealth health() const;

  /// For who looks on between two calls of act(): what the newest request for a channel's value or
  /// status brought.
  struct Answer {
    const Exchange& exchange;
    PlannedRequest planned;
    std::span<const std::uint16_t> words;  ///< of the value; of the last answer that was good
  };
  [[nodiscard]] Answer value_of(std::size_t device, std::size_t channel) const;
  [[nodiscard]] std::optional<Answer> status_of(std::size_t device, std::size_t channel) const;
  /// Every request of the device was asked, and again where that is tried.
  [[nodiscard]] bool has_asked(std::size_t device) const noexcept;
  /// The device refuses requests for several values; it is asked for fewer at once.
  [[nodiscard]] bool is_split(std::size_t device) const noexcept {
    return devices_[device].is_split;
  }

 private:
  /// What the last answers to one request said.
  struct Request {
    PlannedRequest planned;
    std::vector<std::uint16_t> words;
    Exchange newest{};
    nanoseconds arrived_at{};
    Fault fault{Fault::never_read};
    bool settled{false};  ///< in the round under way
  };
  struct Device {
    ModbusDeviceConfig config;
    ModbusPlan plan;
    std::vector<Request> requests;
    UnitBackoff backoff;
    std::size_t first_reading{0};  ///< of its channels in readings_
    std::size_t cursor{0};         ///< the request a round begins with
    int tries{0};                  ///< failed ones of the request at the cursor
    std::size_t rounds{0};         ///< that came to an end
    bool is_split{false};
    nanoseconds next_due{};
    std::uint16_t counter{0};
    bool counter_known{false};
  };
  enum class Step { next, end_of_round, again, line_lost };

  void connect();
  void note_connected();
  [[nodiscard]] nanoseconds pause_max() const noexcept;
  void set_lost();
  [[nodiscard]] std::size_t most_due() const noexcept;
  [[nodiscard]] nanoseconds due(const Device& device) const noexcept;
  [[nodiscard]] nanoseconds ready_at(const Device& device, std::size_t index) const noexcept;
  void poll(Device& device);
  Step ask(Device& device, std::size_t index);
  void plan(Device& device) const;
  bool split(Device& device, std::size_t index) const;
  Step give_up(Device& device, std::size_t index, const Exchange& exchange);
  void finish_round(Device& device, bool whole_from_start);
  [[nodiscard]] bool renewed(Device& device, bool whole_from_start) const;
  [[nodiscard]] Reading evaluate(const Device& device, std::size_t channel, const Reading& before,
                                 bool renewed_now) const;
  void publish() noexcept;
  void note(std::size_t device, const Exchange& exchange);
  [[nodiscard]] std::size_t dead_units() const noexcept;

  ModbusBusConfig config_;
  nanoseconds reconnect_;
  ModbusConnection& connection_;
  std::vector<Device> devices_;
  std::vector<std::size_t> sensors_;  ///< of each reading: its index in the configuration
  std::vector<Reading> readings_;     ///< the thread's own
  WaitFreeSlot<std::vector<Reading>> slot_;
  nanoseconds next_connect_at_{0};
  bool lost_{true};  ///< no line, or not yet
  bool loss_reported_{false};
  std::uint64_t connects_{0};  ///< of the connection, when it was looked at last
  mutable std::mutex health_mutex_;
  BusHealth health_;
};

}  // namespace thermocomp
