/// What carries the bytes of a Modbus line and knows the time: a TCP socket, a serial port, or a
/// simulation of either. ModbusConnection decides which bytes answer what.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

enum class PortWait : std::uint8_t { ready, late, cancelled };

/// What a port had to give.
struct PortBytes {
  enum class Kind : std::uint8_t {
    bytes,           ///< `size` of them, at least one
    nothing,         ///< TCP: none there yet. Serial: a frame for nobody here
    wrong_checksum,  ///< serial
    too_long,        ///< serial: longer than any frame
    broke_off,       ///< serial: the rest of the frame did not come in time
    lost             ///< the line is gone
  };
  Kind kind{Kind::nothing};
  std::size_t size{0};
};

/// One thread uses a port; only cancel() may come from another. Closed at first.
class ModbusPort {
 public:
  ModbusPort() = default;
  ModbusPort(const ModbusPort&) = delete;
  ModbusPort& operator=(const ModbusPort&) = delete;
  virtual ~ModbusPort() = default;

  [[nodiscard]] virtual nanoseconds now() const noexcept = 0;  ///< CLOCK_MONOTONIC

  /// @pre closed
  /// @return whether it is open; if not, `why` says what is wrong
  virtual bool open(std::string& why) = 0;
  virtual void close() noexcept = 0;  ///< also when closed

  /// TCP: a whole frame with its head. Serial: unit and PDU; the checksum is the port's, and what
  /// has come unasked is thrown away.
  /// @return whether all of it was taken
  virtual bool send(std::span<const std::uint8_t> bytes) noexcept = 0;
  /// Waits until something can be received, or something is wrong with the line.
  virtual PortWait wait_for_input(nanoseconds deadline) noexcept = 0;
  /// TCP: what is there of the stream, without waiting. Serial: one frame of which the first byte
  /// is there, without its checksum; the rest of it may take `rest`.
  virtual PortBytes receive(std::span<std::uint8_t> into, nanoseconds rest) noexcept = 0;
  /// Serial: throws away what still comes until the line is silent for `silence`; bounded.
  virtual void drain(nanoseconds silence) noexcept = 0;

  /// @return false when cancelled
  virtual bool pause_until(nanoseconds time) noexcept = 0;
  /// For good: every present and future wait ends at once.
  virtual void cancel() noexcept = 0;
  [[nodiscard]] virtual bool cancelled() const noexcept = 0;
};

/// The real port of a line, not opened yet.
/// @pre check_line() has passed
/// @throws DriverError when the system has no more descriptors
[[nodiscard]] std::unique_ptr<ModbusPort> make_modbus_port(const ModbusLine& line);

}  // namespace thermocomp
