/// Transport and clock of a Modbus line: TCP socket, serial port, or a simulation of either.
/// ModbusConnection does the framing.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "drivers/modbus/modbus_config.hpp"

namespace thermocomp {

enum class PortWait : std::uint8_t { ready, late, cancelled };

/// Result of receive().
struct PortBytes {
  enum class Kind : std::uint8_t {
    bytes,    ///< `size` of them, at least one
    nothing,  ///< none yet
    lost      ///< the line is gone
  };
  Kind kind{Kind::nothing};
  std::size_t size{0};
};

/// For one thread, except cancel(). Closed at first.
class ModbusPort {
 public:
  ModbusPort() = default;
  ModbusPort(const ModbusPort&) = delete;
  ModbusPort& operator=(const ModbusPort&) = delete;
  virtual ~ModbusPort() = default;

  [[nodiscard]] virtual nanoseconds now() const noexcept = 0;  ///< CLOCK_MONOTONIC

  /// @pre closed
  /// @return true if open; else `why` has the reason
  virtual bool open(std::string& why) = 0;
  virtual void close() noexcept = 0;  ///< allowed when closed

  /// @param bytes  a whole frame. @return true if all of it was taken
  virtual bool send(std::span<const std::uint8_t> bytes) noexcept = 0;
  /// Waits for input or an error of the line.
  virtual PortWait wait_for_input(nanoseconds deadline) noexcept = 0;
  /// Received bytes, without waiting.
  virtual PortBytes receive(std::span<std::uint8_t> into) noexcept = 0;

  /// Reason of the refusal of the newest request; empty: see the exception code.
  [[nodiscard]] virtual std::string refusal() const { return {}; }

  /// @return false when cancelled
  virtual bool pause_until(nanoseconds time) noexcept = 0;
  /// Ends every present and future wait at once; irreversible.
  virtual void cancel() noexcept = 0;
  [[nodiscard]] virtual bool cancelled() const noexcept = 0;
};

/// Port of a line, closed.
/// @pre check_line() has passed
/// @throws DriverError when the system has no more descriptors
[[nodiscard]] std::unique_ptr<ModbusPort> make_modbus_port(const ModbusLine& line);

/// Access to a data block of an S7 CPU through the interface of a Modbus TCP line, so that
/// time-outs, late answers and lost connections are handled in one place.
/// @param tcp  transport. @param timeout  for each answer during open()
[[nodiscard]] std::unique_ptr<ModbusPort> make_s7_port(const S7Block& block,
                                                       std::unique_ptr<ModbusPort> tcp,
                                                       nanoseconds timeout);

}  // namespace thermocomp
