/// What carries the bytes of a Modbus line and knows the time: a TCP socket, a serial port, or a
/// simulation of either. ModbusConnection decides which bytes are a frame and what it answers.
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
    bytes,    ///< `size` of them, at least one
    nothing,  ///< none there yet
    lost      ///< the line is gone
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

  /// @param bytes  a whole frame. @return whether all of it was taken
  virtual bool send(std::span<const std::uint8_t> bytes) noexcept = 0;
  /// Waits until something can be received, or something is wrong with the line.
  virtual PortWait wait_for_input(nanoseconds deadline) noexcept = 0;
  /// What is there, without waiting.
  virtual PortBytes receive(std::span<std::uint8_t> into) noexcept = 0;

  /// Why the newest request was refused; empty: the code of the exception says all.
  [[nodiscard]] virtual std::string refusal() const { return {}; }

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

/// A data block of an S7 CPU behind the face of a Modbus TCP line, so that time-outs, late answers
/// and lost connections are handled in one place.
/// @param tcp  carries the bytes. @param timeout  for each answer while it opens
[[nodiscard]] std::unique_ptr<ModbusPort> make_s7_port(const S7Block& block,
                                                       std::unique_ptr<ModbusPort> tcp,
                                                       nanoseconds timeout);

}  // namespace thermocomp
