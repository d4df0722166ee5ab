/// A Modbus line: one exchange at a time, every wait bounded and interruptible, every answer
/// checked against its request.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "drivers/modbus/modbus_config.hpp"
#include "drivers/modbus/port.hpp"

namespace thermocomp {

enum class ExchangeOutcome : std::uint8_t {
  ok,
  exception,  ///< the unit answered with a Modbus exception
  timeout,
  bad_frame,     ///< no valid answer to the request
  disconnected,  ///< the line is not open, or was lost in this exchange
  cancelled
};

/// Exceptions with a specific remedy.
inline constexpr int illegal_function = 1;
inline constexpr int illegal_address = 2;
inline constexpr int illegal_value = 3;

/// Result of one exchange.
struct Exchange {
  ExchangeOutcome outcome{ExchangeOutcome::disconnected};
  int exception_code{0};     ///< 1..255 when outcome is exception
  nanoseconds sent_at{};     ///< CLOCK_MONOTONIC
  nanoseconds arrived_at{};  ///< the answer was complete; 0: no answer
  std::string detail{};      ///< received data or reason, for display; empty when ok

  [[nodiscard]] bool ok() const noexcept { return outcome == ExchangeOutcome::ok; }
  /// Fault of the reading: device_busy for exception 6; no_answer for a gateway's 10 and 11, a
  /// time-out and a lost line; device_error for other exceptions; bad_frame for a bad frame.
  [[nodiscard]] Fault fault() const noexcept;
  /// True if the unit itself answered: a value or its own exception, not a gateway's.
  [[nodiscard]] bool unit_answered() const noexcept;
};

/// Checks a line before it is opened.
/// @throws DriverError naming the problem (unknown baud rate, parity, port, empty host, ...)
void check_line(const ModbusLine& line);

/// Longest time that a gateway waits for a silent unit.
inline constexpr nanoseconds gateway_wait_max = std::chrono::seconds(3);

/// Silence between frames: as configured, else 3.5 characters, 1.75 ms above 19200 baud; TCP: 0.
[[nodiscard]] nanoseconds inter_frame_delay(const ModbusLine& line) noexcept;

/// Time of a frame of `bytes` bytes on the line; TCP: 0.
[[nodiscard]] nanoseconds time_on_line(const ModbusLine& line, std::size_t bytes) noexcept;

/// For one thread, except cancel().
///
/// Late answers. TCP: each request has its own transaction id; an answer with another id is
/// Late answers. TCP: each request has its own transaction id; an answer with another id is
/// discarded. RTU has no id: after a request without answer, its unit is not asked again before
/// ready_at(), and answers of another unit that arrive during an exchange are discarded. The
/// exchange calls wait for ready_at(); callers with other units to ask check it first.
///
/// A gateway that waits for a silent unit answers no other: over TCP the next unit's answer is
/// awaited until the gateway must have stopped waiting (gateway_wait_max).
///
/// If a peer closes a connection that has brought answers, it is reconnected within the exchange;
/// if it closes after each answer, each request gets a new connection.
class ModbusConnection {
 public:
  /// @throws DriverError as check_line()
  explicit ModbusConnection(const ModbusLine& line);
  /// Uses a port other than the line's own; its clock times every exchange.
  /// @throws DriverError as check_line()
  ModbusConnection(const ModbusLine& line, std::unique_ptr<ModbusPort> port);
  ModbusConnection(const ModbusConnection&) = delete;
  ModbusConnection& operator=(const ModbusConnection&) = delete;
  ~ModbusConnection();

  /// Opens the line if it is closed. Bounded by the line's time-out (2 s for the name service,
  /// where cancel() works too).
  /// @return true if open; else last_error() has the reason
  bool connect();
  void disconnect() noexcept;
  [[nodiscard]] bool connected() const noexcept;
  [[nodiscard]] const std::string& last_error() const noexcept;
  /// Number of times the line was opened, and of those by connect(): the latter begin another link,
  /// with unknown state of the peer.
  [[nodiscard]] std::uint64_t connects() const noexcept;
  [[nodiscard]] std::uint64_t links() const noexcept;
  /// links() plus reconnections after an unexpected close by the peer, which may have restarted.
  [[nodiscard]] std::uint64_t breaks() const noexcept;
  /// Time for which the last silent unit kept a gateway from answering.
  [[nodiscard]] nanoseconds held() const noexcept;
  /// Declares that silent units do not block others on this line: the next answer is not awaited
  /// longer.
  void reset_silence() noexcept;
  void share() noexcept;  ///< the line has users other than sensors
  [[nodiscard]] bool is_shared() const noexcept;
  /// Uses the timing of `line` from now on, since each user of a line has its own.
  void time_as(const ModbusLine& line) noexcept;

  /// Reads words.size() registers (at most 125), or bits, one per word (at most 2000). `words` is
  /// written only when the outcome is ok.
  /// @param wide  a register has 32 bits, two of the words
  Exchange read(int unit, ModbusTable table, std::uint16_t address, std::span<std::uint16_t> words,
                bool wide = false);
  /// Writes one holding register (function 6). ok: confirmed by the unit.
  Exchange write_register(int unit, std::uint16_t address, std::uint16_t word);
  /// Writes holding registers (function 16; at most 123). ok: confirmed by the unit.
  Exchange write_registers(int unit, std::uint16_t address, std::span<const std::uint16_t> words);

  /// Earliest time of a request for these registers, because an answer to an earlier request may
  /// still come; 0: any time.
  [[nodiscard]] nanoseconds ready_at(int unit, ModbusTable table, std::uint16_t address,
                                     std::size_t words) const noexcept;

  [[nodiscard]] nanoseconds now() const noexcept;  ///< clock of the port
  /// Sleeps until `time` (CLOCK_MONOTONIC).
  /// @return false when cancelled
  bool pause_until(nanoseconds time) noexcept;

  /// Makes every present and future call soon return `cancelled`; from any thread, irreversible.
  void cancel() noexcept;
  [[nodiscard]] bool cancelled() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace thermocomp
