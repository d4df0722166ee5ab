/// Thermocouples on a Modbus line: the requests for all values of a device (pure), the polling of
/// the units, and the readings from their answers.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <mutex>
#include <optional>
#include <vector>

#include "drivers/bus.hpp"
#include "drivers/modbus/modbus_config.hpp"
#include "drivers/modbus/shared_line.hpp"

namespace thermocomp {

inline constexpr int registers_per_request_limit = 125;  ///< of the protocol
inline constexpr int bits_per_request_limit = 2000;      ///< of the protocol

/// Read of `count` registers or bits of one table from `address` on.
struct PlannedRequest {
  ModbusTable table{ModbusTable::input};
  std::uint16_t address{0};  ///< 0-based
  std::uint16_t count{0};
};

/// Place of a value's first register or bit in the answers.
struct WordPlace {
  std::size_t request{0};  ///< index into ModbusPlan::requests
  std::size_t offset{0};   ///< words from the answer's first
};

struct ChannelPlace {
  WordPlace value;
  std::optional<WordPlace> status;
};

/// Requests for all values of a device, and the place of each value in the answers.
struct ModbusPlan {
  std::size_t words_a_register{1};  ///< in the answers; 2: of 32-bit registers
  std::vector<PlannedRequest> requests;
  std::vector<ChannelPlace> channels;  ///< in the order of the device's channels
  /// Counter in the first request: read before the values, it never makes old values new.
  std::optional<WordPlace> renewal;
};

/// Neighbouring values share a request if the unused words between them are at most
/// `gap_registers_max` (bits: 16 times that), and its length at most `registers_per_request_max`,
/// `line_registers_max` and the protocol's limit. A value is never split. `one_register_a_request`:
/// each value, status and counter has its own request.
/// @pre the limits are at least as large as the largest value
[[nodiscard]] ModbusPlan plan_requests(const ModbusDeviceConfig& device,
                                       int line_registers_max = registers_per_request_limit);

/// Pauses between requests to a unit that does not answer. Pure; the time is passed in. They double
/// from `pause_first` to `pause_max`; an answer ends them at once. From the third failure on they
/// also limit the time-outs of all dead units of the line to `line_share_max` of its time, as far
/// as `stretch_max` times `pause_max` allows.
class UnitBackoff {
 public:
  using nanoseconds = std::chrono::nanoseconds;
  static constexpr double line_share_max = 0.02;
  static constexpr int failures_before_budget = 2;
  static constexpr double stretch_max = 1.8;

  explicit UnitBackoff(nanoseconds pause_first) noexcept : pause_first_(pause_first) {}

  void answered() noexcept {
    failures_ = 0;
    not_before_ = nanoseconds{0};
  }

  /// All attempts failed at `now`.
  /// @param cost        line time of the failed request
  /// @param dead_units  units of the line without answer, with this one
  void failed(nanoseconds now, nanoseconds cost, std::size_t dead_units,
              nanoseconds pause_max) noexcept {
    pause_ = std::min(failures_ == 0 ? pause_first_ : 2 * pause_, pause_max);
    ++failures_;
    nanoseconds pause = pause_;
    if (failures_ > failures_before_budget) {
      const double budget =
          static_cast<double>(cost.count()) * static_cast<double>(dead_units) / line_share_max;
      const auto ceiling = stretch_max * static_cast<double>(pause_max.count());
      pause =
          std::max(pause, nanoseconds{static_cast<nanoseconds::rep>(std::min(budget, ceiling))});
    }
    not_before_ = now + pause;
  }

  [[nodiscard]] bool dead() const noexcept { return failures_ != 0; }
  [[nodiscard]] nanoseconds not_before() const noexcept { return not_before_; }

 private:
  nanoseconds pause_first_;
  nanoseconds pause_{0};
  nanoseconds not_before_{0};
  int failures_{0};
};

/// Each device is read at its period on an absolute schedule. `taken_at` of a reading is the
/// arrival of the last answer with its value (with a renewal counter: the last answer with a
/// changed counter); a reading with a fault keeps it and has no value.
///
/// If a device refuses a request for several values from the first time on (exception 2 or 3), the
/// request is split: first without the registers between the values, then one request per value.
///
/// A failed request is retried as often as the line's `retries` (if the unit answered until then).
/// A unit without answer is asked with growing pauses (UnitBackoff); alone on its line, at least
/// every `reconnect_s` (serial: every 3 s, for late answers). A lost line is reopened every
/// `reconnect_s`.
class ModbusPoller final : public LineUser {
 public:
  /// @param connection  of the configuration's line; outlives the poller
  /// @throws DriverError naming the device and the problem
  ModbusPoller(const ModbusBusConfig& config, ModbusConnection& connection);

  [[nodiscard]] const ModbusLine& line() const noexcept override { return config_.line; }
  /// Time of the next act().
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
  /// True if every request of the device was made, with its retries.
  [[nodiscard]] bool has_asked(std::size_t device) const noexcept;
  /// True if the device refuses requests for several values and gets smaller ones.
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
