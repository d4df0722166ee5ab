/// Polling of the units of one Modbus line, and the readings from their answers.
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

/// Each device is read at its period on an absolute schedule. `taken_at` of a reading is the
/// arrival of the last answer with its value (with a renewal counter: the last answer in which the
/// counter had changed); a reading with a fault keeps it and has no value.
///
/// A request for several values that a device refuses from the first time on (exception 2 or 3) is
/// split: first without the registers between the values, then one request per value.
///
/// A failed request is retried as often as the line's `retries` (for a unit that answered until
/// then); a unit without answer is asked with growing pauses (UnitBackoff), alone on its line at
/// least every `reconnect_s` (serial: every 3 s, for late answers). A lost line is reopened every
/// `reconnect_s`.
class ModbusPoller final : public LineUser {
 public:
  /// @param connection  of the configuration's line; outlives the poller
  /// @throws DriverError naming the device and the problem
  ModbusPoller(const ModbusBusConfig& config, ModbusConnection& connection);

  [[nodiscard]] const ModbusLine& line() const noexcept override { return config_.line; }
  /// Time of the next act(), which waits until then by itself.
  [[nodiscard]] nanoseconds next_action_at() const noexcept override;
  /// Connects, runs one device's requests, or reports the loss of the line.
  /// @pre the connection is not cancelled
  void act() override;

  /// For the one reading thread: wait-free.
  void newest(std::span<Reading> all) noexcept;
  /// For any ordinary thread.
  [[nodiscard]] BusHealth health() const;

  /// Result of the newest request for a channel's value or status, for callers between two act().
  struct Answer {
    const Exchange& exchange;
    PlannedRequest planned;
    std::span<const std::uint16_t> words;  ///< of the value, from the last good answer
  };
  [[nodiscard]] Answer value_of(std::size_t device, std::size_t channel) const;
  [[nodiscard]] std::optional<Answer> status_of(std::size_t device, std::size_t channel) const;
  /// Every request of the device was made, with its retries.
  [[nodiscard]] bool has_asked(std::size_t device) const noexcept;
  /// The device refuses requests for several values and gets smaller ones.
  [[nodiscard]] bool is_split(std::size_t device) const noexcept {
    return devices_[device].is_split;
  }

 private:
  /// State of one request.
  struct Request {
    PlannedRequest planned;
    std::vector<std::uint16_t> words;
    Exchange newest{};
    nanoseconds arrived_at{};
    Fault fault{Fault::never_read};
    bool settled{false};  ///< answered in this round
  };
  struct Device {
    ModbusDeviceConfig config;
    ModbusPlan plan;
    std::vector<Request> requests;
    UnitBackoff backoff;
    std::size_t first_reading{0};  ///< index of its first channel in readings_
    std::size_t cursor{0};         ///< first request of the next round
    int tries{0};                  ///< failed attempts at the cursor
    std::size_t rounds{0};         ///< completed
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
  std::vector<std::size_t> sensors_;  ///< one per reading: index in the configuration
  std::vector<Reading> readings_;     ///< of the thread
  WaitFreeSlot<std::vector<Reading>> slot_;
  nanoseconds next_connect_at_{0};
  bool lost_{true};  ///< the line is lost, or not open yet
  bool loss_reported_{false};
  std::uint64_t connects_{0};  ///< of the connection at the last check
  mutable std::mutex health_mutex_;
  BusHealth health_;
};

}  // namespace thermocomp
