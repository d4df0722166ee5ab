/// A Modbus line with its thread and its users. Sensors and a controller at one address share the
/// connection, because many gateways serve one client at a time and a serial line has one master.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "drivers/modbus/connection.hpp"

namespace thermocomp {

/// A user of a line; users take turns.
class LineUser {
 public:
  LineUser() = default;
  LineUser(const LineUser&) = delete;
  LineUser& operator=(const LineUser&) = delete;
  virtual ~LineUser() = default;

  [[nodiscard]] virtual const ModbusLine& line() const noexcept = 0;  ///< with its own timing
  /// Time of the next act() (CLOCK_MONOTONIC).
  [[nodiscard]] virtual nanoseconds next_action_at() const noexcept = 0;
  virtual void act() = 0;
  virtual void end() {}  ///< last call
};

class SharedLine {
 public:
  /// The line of this address, which exists as long as it has an owner.
  /// @throws DriverError as check_line()
  [[nodiscard]] static std::shared_ptr<SharedLine> of(const ModbusLine& line);
  explicit SharedLine(const ModbusLine& line) : connection_(line) {}

  [[nodiscard]] ModbusConnection& connection() noexcept { return connection_; }
  /// @param name  of the thread, for the first user
  /// @throws DriverError when the system cannot create a thread
  void join(LineUser& user, const std::string& name);
  /// Ends the use within `patience`; afterwards the user is not called.
  void leave(LineUser& user, nanoseconds patience) noexcept;

 private:
  struct Member {
    LineUser* user{nullptr};
    bool is_leaving{false};
  };
  void run();
  [[nodiscard]] const Member& next_member() const noexcept;
  void remove(const LineUser& user) noexcept;
  [[nodiscard]] bool has(const LineUser& user) const noexcept;

  ModbusConnection connection_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<Member> members_;
  const LineUser* acting_{nullptr};
  BusThread thread_;
};

}  // namespace thermocomp
