/// A Modbus line with its thread and all who ask on it: sensors and a controller behind one address
/// share the connection, because many gateways serve one client at a time and a serial line has one
/// master.
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "drivers/bus_thread.hpp"
#include "drivers/modbus/connection.hpp"

namespace thermocomp {

/// Who asks on a line, each in its turn.
class LineUser {
 public:
  LineUser() = default;
  LineUser(const LineUser&) = delete;
  LineUser& operator=(const LineUser&) = delete;
  virtual ~LineUser() = default;

  [[nodiscard]] virtual const ModbusLine& line() const noexcept = 0;  ///< with its own timing
  /// When act() is to be called next (CLOCK_MONOTONIC).
  [[nodiscard]] virtual nanoseconds next_action_at() const noexcept = 0;
  virtual void act() = 0;
  virtual void end() {}  ///< the last thing that is asked of it
};

class SharedLine {
 public:
  /// The line of this address, which exists as long as somebody has it.
  /// @throws DriverError as check_line()
  [[nodiscard]] static std::shared_ptr<SharedLine> of(const ModbusLine& line);
  explicit SharedLine(const ModbusLine& line) : connection_(line) {}

  [[nodiscard]] ModbusConnection& connection() noexcept { return connection_; }
  /// @param name  of the thread, if it is the first
  /// @throws DriverError when the system gives no thread
  void join(LineUser& user, const std::string& name);
  /// Lets the user end, for as long as `patience`; afterwards it is not called any more.
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
