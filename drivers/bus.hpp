/// Types common to all kinds of buses: start error, outline, sentinels, health, the source of
/// readings, and the slot between two threads.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>
#include <vector>

#include "estimator/types.hpp"

namespace thermocomp {

/// Thrown by a driver that cannot start; later faults are data.
class DriverError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Description of a bus before it is opened.
struct BusOutline {
  std::string kind;       ///< value of the key `kind`, as in BusHealth
  std::string interface;  ///< "can0"; empty for a bus without interface
  std::size_t units{0};   ///< number of units in the health of its source
  const char* unit_called{"device"};
};

/// A raw value that is a status code of the device, not a temperature.
struct Sentinel {
  std::int64_t code{0};  ///< raw value before scale and offset, with the encoding's signedness
  Fault fault{Fault::open_circuit};
  bool operator==(const Sentinel&) const = default;
};

/// Counters of one bus unit (Modbus unit, CAN node).
struct UnitHealth {
  std::string name;
  bool answering{false};
  std::uint64_t requests{0};  ///< Modbus: requests sent. CAN: 0
  std::uint64_t answers{0};   ///< good answers or frames
  std::uint64_t timeouts{0};
  std::uint64_t exceptions{0};  ///< Modbus exception answers
  std::uint64_t bad_frames{0};  ///< garbled, wrong length, wrong id
  double round_trip_ms{0.0};    ///< of the last good answer
  std::string last_error;       ///< empty if the last exchange was good
};

struct BusHealth {
  std::string name;
  std::string kind;  ///< value of the key `kind`: "modbus_tcp", "can", ...
  bool connected{false};
  std::uint64_t connects{0};
  std::string last_error;
  std::vector<UnitHealth> units;
  /// CAN: "down", "active", "warning", "passive" or "bus_off"; else empty
  std::string state;
  nanoseconds state_since{};      ///< CLOCK_MONOTONIC of the change to `state`
  std::uint64_t error_frames{0};  ///< CAN: of every kind
  std::uint64_t bus_offs{0};      ///< CAN: number of times the interface left the bus
  std::uint64_t restarts{0};      ///< CAN: restarts of the interface by its driver
  std::uint64_t dropped{0};       ///< CAN: frames lost because they were not read fast enough
};

/// A bus with readings: opened once, read by the cycle without waiting.
class SensorSource {
 public:
  SensorSource() = default;
  SensorSource(const SensorSource&) = delete;
  SensorSource& operator=(const SensorSource&) = delete;
  virtual ~SensorSource() = default;

  /// Starts the bus' thread. A missing bus is no error: opening is retried for ever.
  /// @throws DriverError when the configuration cannot work on this system
  virtual void start() = 0;
  /// Ends the thread within a second. The readings do not change.
  virtual void stop() noexcept = 0;
  /// Copies this bus' newest readings into `all` (one entry per configured sensor; entries of other
  /// buses are unchanged). Wait-free, no allocation; for one reading thread.
  virtual void newest(std::span<Reading> all) noexcept = 0;
  /// For any ordinary thread; may lock.
  [[nodiscard]] virtual BusHealth health() const = 0;
};

/// Passes the newest value from one writer to one reader; neither waits for the other. The writer
/// fills back(), then calls publish(); the reader calls fresh() and reads front(). A triple buffer
/// for exactly one thread each: no allocation after construction.
template <class T>
class WaitFreeSlot {
 public:
  WaitFreeSlot() = default;
  explicit WaitFreeSlot(const T& initial) : buffers_{initial, initial, initial} {}

  /// The writer's buffer, which holds an earlier value: write all of it.
  [[nodiscard]] T& back() noexcept { return buffers_[back_]; }
  void publish() noexcept {
    back_ =
        shared_.exchange(static_cast<std::uint8_t>(back_ | fresh_bit), std::memory_order_acq_rel) &
        index_mask;
  }

  /// Takes the newest published value, for the reader. @return true if front() changed
  bool fresh() noexcept {
    if ((shared_.load(std::memory_order_relaxed) & fresh_bit) == 0) return false;
    front_ = shared_.exchange(front_, std::memory_order_acq_rel) & index_mask;
    return true;
  }
  [[nodiscard]] const T& front() const noexcept { return buffers_[front_]; }

 private:
  static constexpr std::uint8_t fresh_bit = 4;
  static constexpr std::uint8_t index_mask = 3;
  std::array<T, 3> buffers_{};
  std::uint8_t back_{0};
  std::atomic<std::uint8_t> shared_{1};
  std::uint8_t front_{2};
};

}  // namespace thermocomp
