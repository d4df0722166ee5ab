// Checks and timing of a Modbus line that need no open port.
#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "drivers/bus.hpp"
#include "drivers/modbus/connection.hpp"

namespace thermocomp {
namespace {

// libmodbus silently uses 9600 for an unknown rate, so the list is checked here.
constexpr std::array<int, 20> bauds{110,    300,    600,     1200,    2400,    4800,   9600,
                                    19200,  38400,  57600,   115200,  230400,  460800, 500000,
                                    576000, 921600, 1000000, 1152000, 1500000, 2000000};

void check(bool holds, const std::string& what) {
  if (!holds) throw DriverError("Modbus line: " + what);
}

void check_tcp(const ModbusTcp& tcp) {
  check(!tcp.host.empty(), "host is empty");
  check(tcp.port >= 1 && tcp.port <= 65535,
        "port " + std::to_string(tcp.port) + " must be in 1..65535");
}

void check_rtu(const ModbusRtu& rtu) {
  check(!rtu.device.empty(), "device is empty");
  check(std::find(bauds.begin(), bauds.end(), rtu.baud) != bauds.end(),
        "baud " + std::to_string(rtu.baud) + " is not a rate of serial ports");
  check(rtu.parity == 'N' || rtu.parity == 'E' || rtu.parity == 'O', "parity must be N, E or O");
  check(rtu.data_bits == 8, "Modbus RTU needs 8 data bits");
  check(rtu.stop_bits == 1 || rtu.stop_bits == 2, "stop_bits must be 1 or 2");
}

nanoseconds time_of_characters(const ModbusRtu& rtu, double characters) noexcept {
  const int bits = 1 + rtu.data_bits + (rtu.parity == 'N' ? 0 : 1) + rtu.stop_bits;
  return nanoseconds{std::llround(characters * bits * 1e9 / rtu.baud)};
}

}  // namespace

void check_line(const ModbusLine& line) {
  if (const auto* tcp = std::get_if<ModbusTcp>(&line.link)) check_tcp(*tcp);
  if (const auto* rtu = std::get_if<ModbusRtu>(&line.link)) check_rtu(*rtu);
  check(line.timeout_ms >= 1.0 && line.timeout_ms <= 60000.0, "timeout_ms must be in 1..60000");
  check(line.inter_frame_delay_ms <= 1000.0, "inter_frame_delay_ms must be at most 1000");
  check(line.reconnect_s >= 0.01 && line.reconnect_s <= 3600.0,
        "reconnect_s must be in 0.01..3600");
  check(line.backoff_s_max >= 0.01 && line.backoff_s_max <= 3600.0,
        "backoff_s_max must be in 0.01..3600");
  check(line.retries >= 0 && line.retries <= 10, "retries must be in 0..10");
}

nanoseconds inter_frame_delay(const ModbusLine& line) noexcept {
  if (line.inter_frame_delay_ms >= 0.0) {
    return nanoseconds{std::llround(line.inter_frame_delay_ms * 1e6)};
  }
  const auto* rtu = std::get_if<ModbusRtu>(&line.link);
  if (rtu == nullptr) return nanoseconds{0};
  // "MODBUS over serial line specification and implementation guide V1.02", 2.5.1.1.
  if (rtu->baud > 19200) return std::chrono::microseconds(1750);
  return time_of_characters(*rtu, 3.5);
}

nanoseconds time_on_line(const ModbusLine& line, std::size_t bytes) noexcept {
  const auto* rtu = std::get_if<ModbusRtu>(&line.link);
  return rtu == nullptr ? nanoseconds{0} : time_of_characters(*rtu, static_cast<double>(bytes));
}

}  // namespace thermocomp
