/// A Modbus line that is open or not: one exchange at a time, every wait bounded and interruptible,
/// every answer checked to be the answer to this request.
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
  exception,     ///< the unit answered with a Modbus exception
  timeout,       ///< nothing came in time
  bad_frame,     ///< something came that is not a valid answer to the request
  disconnected,  ///< the line is not open, or was lost in this exchange
  cancelled      ///< cancel() was called
};

/// Exceptions with a remedy of their own.
inline constexpr int illegal_function = 1;
inline constexpr int illegal_address = 2;
inline constexpr int illegal_value = 3;

/// How one exchange ended.
struct Exchange {
  ExchangeOutcome outcome{ExchangeOutcome::disconnected};
  int exception_code{0};     ///< 1..255 when outcome is exception
  nanoseconds sent_at{};     ///< CLOCK_MONOTONIC
  nanoseconds arrived_at{};  ///< the whole answer was here; 0 without one
  std::string detail{};      ///< what came, for a person; empty when ok

  [[nodiscard]] bool ok() const noexcept { return outcome == ExchangeOutcome::ok; }
  /// The fault a reading gets: busy (6) device_busy; a gateway's 10 and 11, a time-out and a lost
  /// line no_answer; other exceptions device_error; a bad frame bad_frame.
  [[nodiscard]] Fault fault() const noexcept;
  /// The unit itself is there: a value or an exception of its own (not a gateway's on its behalf).
  [[nodiscard]] bool unit_answered() const noexcept;
};

/// Checks a line before anything is opened.
/// @throws DriverError naming what cannot work (unknown baud rate, parity, port, empty host, ...)
void check_line(const ModbusLine& line);

/// How long a gateway may wait for a unit that does not answer.
inline constexpr nanoseconds gateway_wait_max = std::chrono::seconds(3);

/// Silence kept between frames on the line: as configured, else 3.5 characters, 1.75 ms above
/// 19200 baud; TCP: 0 unless configured.
[[nodiscard]] nanoseconds inter_frame_delay(const ModbusLine& line) noexcept;

/// The time that a frame of `bytes` bytes takes on the line; TCP: 0.
[[nodiscard]] nanoseconds time_on_line(const ModbusLine& line, std::size_t bytes) noexcept;

/// One thread uses a connection; only cancel() may come from another.
///
/// Late answers. TCP: each request has a transaction id of its own; an answer with another one is
/// thrown away while the wait goes on. RTU has no such id: after a request without answer its unit
/// is not asked again before ready_at(), while the answers of one unit that arrive during an
/// exchange with another are thrown away. The exchange calls wait for ready_at() by themselves;
/// whoever has other units to ask looks at it first.
///
/// A gateway that still waits for a silent unit answers nobody: the next unit that is asked over
/// TCP is waited for until the gateway must have given the silent one up (gateway_wait_max).
///
/// A peer that closes a connection which has brought answers is connected again within the
/// exchange; one that closes after each answer gets a connection for each request.
class ModbusConnection {
 public:
  /// @throws DriverError as check_line()
  explicit ModbusConnection(const ModbusLine& line);
  /// Over a port other than the line's own, whose clock then times every exchange.
  /// @throws DriverError as check_line()
  ModbusConnection(const ModbusLine& line, std::unique_ptr<ModbusPort> port);
  ModbusConnection(const ModbusConnection&) = delete;
  ModbusConnection& operator=(const ModbusConnection&) = delete;
  ~ModbusConnection();

  /// Opens the line; at once true when open. Bounded by the line's time-out (an answer of the
  /// name service: 2 s, in which cancel() works too).
  /// @return whether it is open; if not, last_error() says why
  bool connect();
  void disconnect() noexcept;
  [[nodiscard]] bool connected() const noexcept;
  [[nodiscard]] const std::string& last_error() const noexcept;
  /// Times the line was opened; of them, those by connect(): a line that connect() opens is another
  /// one, of whose far end nothing is known.
  [[nodiscard]] std::uint64_t connects() const noexcept;
  [[nodiscard]] std::uint64_t links() const noexcept;
  /// Those by connect(), and those after a peer closed that does not close after each answer: it
  /// may have restarted.
  [[nodiscard]] std::uint64_t breaks() const noexcept;
  /// How long the last unit without an answer kept a gateway from answering others.
  [[nodiscard]] nanoseconds held() const noexcept;
  /// A silent unit keeps nobody waiting here: the next one is not waited for longer than others.
  void forget_silence() noexcept;
  void share() noexcept;  ///< others than sensors ask on this line too
  [[nodiscard]] bool is_shared() const noexcept;
  /// The timing of `line` from now on: of several users of one line each has its own.
  void time_as(const ModbusLine& line) noexcept;

  /// Reads words.size() registers (at most 125), or bits, one per word (at most 2000).
  /// `words` is written only when the outcome is ok.
  /// @param wide  a register has 32 bits, two of the words
  Exchange read(int unit, ModbusTable table, std::uint16_t address, std::span<std::uint16_t> words,
                bool wide = false);
  /// Writes one holding register (function 6). ok: the unit has confirmed it.
  Exchange write_register(int unit, std::uint16_t address, std::uint16_t word);
  /// Writes holding registers (function 16; at most 123). ok: the unit has confirmed them.
  Exchange write_registers(int unit, std::uint16_t address, std::span<const std::uint16_t> words);

  /// Before this time the unit is not asked for these registers, because an answer to an earlier
  /// request may still come; 0: at any time.
  [[nodiscard]] nanoseconds ready_at(int unit, ModbusTable table, std::uint16_t address,
                                     std::size_t words) const noexcept;

  [[nodiscard]] nanoseconds now() const noexcept;  ///< of the port
  /// Waits until `time` (CLOCK_MONOTONIC) without using the processor.
  /// @return false when cancelled
  bool pause_until(nanoseconds time) noexcept;

  /// From any thread, and for good: every present and future call soon returns `cancelled`.
  void cancel() noexcept;
  [[nodiscard]] bool cancelled() const noexcept;

 private:
  class Implementation;
  std::unique_ptr<Implementation> implementation_;
};

}  // namespace thermocomp
