#include "drivers/modbus/rtu_port.hpp"

#include <cerrno>
#include <cstring>
#include <poll.h>
#include <unistd.h>

#include "drivers/driver_error.hpp"
#include "drivers/monotonic_clock.hpp"

namespace thermocomp {

RtuPort::RtuPort(const ModbusRtu& rtu)
    : rtu_(rtu),
      context_(
          modbus_new_rtu(rtu.device.c_str(), rtu.baud, rtu.parity, rtu.data_bits, rtu.stop_bits)) {
  if (!context_) throw DriverError(std::string("Modbus line: ") + modbus_strerror(errno));
}

nanoseconds RtuPort::now() const noexcept {
  return monotonic_now();
}

bool RtuPort::open(std::string& why) {
  if (modbus_connect(context_.get()) != 0) {
    why = rtu_.device + ": " + std::strerror(errno);
    modbus_close(context_.get());
    return false;
  }
  if (rtu_.rs485 && modbus_rtu_set_serial_mode(context_.get(), MODBUS_RTU_RS485) != 0) {
    why = rtu_.device + ": RS-485 mode is not supported by this port: " + std::strerror(errno);
    modbus_close(context_.get());
    return false;
  }
  modbus_flush(context_.get());
  open_ = true;
  return true;
}

void RtuPort::close_device() noexcept {
  if (!open_) return;
  open_ = false;
  // Bytes that cannot be sent any more would make close() of a serial port wait for them.
  modbus_flush(context_.get());
  modbus_close(context_.get());
}

bool RtuPort::send(std::span<const std::uint8_t> bytes) noexcept {
  return ::write(fd(), bytes.data(), bytes.size()) == static_cast<ssize_t>(bytes.size());
}

PortWait RtuPort::wait_for_input(nanoseconds deadline) noexcept {
  return wait_.wait_for(fd(), POLLIN, deadline);
}

PortBytes RtuPort::receive(std::span<std::uint8_t> into) noexcept {
  const ssize_t count = ::read(fd(), into.data(), into.size());
  if (count > 0) return {PortBytes::Kind::bytes, static_cast<std::size_t>(count)};
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return {PortBytes::Kind::nothing};
  if (count < 0) return {PortBytes::Kind::lost};
  // 0: nothing is there, or the port is gone.
  pollfd port{fd(), POLLIN, 0};
  const timespec at_once{};
  const bool is_gone = ::ppoll(&port, 1, &at_once, nullptr) > 0 && (port.revents & ~POLLIN) != 0;
  return {is_gone ? PortBytes::Kind::lost : PortBytes::Kind::nothing};
}

}  // namespace thermocomp
