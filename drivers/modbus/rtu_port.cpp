#include "drivers/modbus/rtu_port.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <poll.h>
#include <unistd.h>

#include <sys/select.h>

#include "drivers/driver_error.hpp"
#include "drivers/monotonic_clock.hpp"

namespace thermocomp {

RtuPort::RtuPort(const ModbusRtu& rtu)
    : rtu_(rtu),
      context_(
          modbus_new_rtu(rtu.device.c_str(), rtu.baud, rtu.parity, rtu.data_bits, rtu.stop_bits)) {
  if (!context_) throw DriverError(std::string("Modbus line: ") + modbus_strerror(errno));
  modbus_set_error_recovery(context_.get(), MODBUS_ERROR_RECOVERY_NONE);
  modbus_set_byte_timeout(context_.get(), 0, 0);  // one time-out for the rest of a frame
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
  if (fd() >= FD_SETSIZE) {  // libmodbus waits with select()
    why = "too many open files for libmodbus";
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
  modbus_set_slave(context_.get(), bytes[0]);
  modbus_flush(context_.get());  // whatever is there answers nothing that was asked
  return modbus_send_raw_request(context_.get(), bytes.data(), static_cast<int>(bytes.size())) > 0;
}

PortWait RtuPort::wait_for_input(nanoseconds deadline) noexcept {
  return wait_.wait_for(fd(), POLLIN, deadline);
}

PortBytes RtuPort::receive(std::span<std::uint8_t> into, nanoseconds rest) noexcept {
  constexpr std::size_t checksum_bytes = 2;
  const auto rest_us = std::chrono::duration_cast<std::chrono::microseconds>(rest).count();
  modbus_set_response_timeout(context_.get(), static_cast<std::uint32_t>(rest_us / 1000000),
                              static_cast<std::uint32_t>(rest_us % 1000000));
  std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> frame{};
  const int received = modbus_receive_confirmation(context_.get(), frame.data());
  if (received == 0) return {PortBytes::Kind::nothing};  // a frame of another unit
  if (received > static_cast<int>(checksum_bytes)) {
    const std::size_t size =
        std::min(static_cast<std::size_t>(received) - checksum_bytes, into.size());
    std::copy_n(frame.begin(), size, into.begin());
    return {PortBytes::Kind::bytes, size};
  }
  if (errno == EMBBADCRC) return {PortBytes::Kind::wrong_checksum};
  if (errno == EMBBADDATA) return {PortBytes::Kind::too_long};
  if (errno == ETIMEDOUT) return {PortBytes::Kind::broke_off};
  return {PortBytes::Kind::lost};
}

void RtuPort::drain(nanoseconds silence) noexcept {
  constexpr std::chrono::milliseconds drain_max{300};
  const nanoseconds give_up_at = monotonic_now() + drain_max;
  modbus_flush(context_.get());
  while (monotonic_now() < give_up_at) {
    if (wait_.wait_for(fd(), POLLIN, monotonic_now() + silence) != PortWait::ready) break;
    std::array<std::uint8_t, 256> rubbish{};
    if (::read(fd(), rubbish.data(), rubbish.size()) <= 0) break;
  }
}

}  // namespace thermocomp
