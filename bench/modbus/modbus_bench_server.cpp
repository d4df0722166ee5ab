#include "modbus_bench_server.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <sched.h>
#include <stdlib.h>
#include <termios.h>
#include <thread>
#include <unistd.h>
#include <vector>

#include <modbus/modbus.h>
#include <netinet/in.h>
#include <netinet/tcp.h>
#include <sys/socket.h>

namespace bench {
namespace {

[[noreturn]] void fail(const char* what) {
  std::perror(what);
  std::exit(1);
}

std::uint16_t checksum(const std::vector<std::uint8_t>& bytes) {
  unsigned sum = 0xFFFF;
  for (const std::uint8_t byte : bytes) {
    sum ^= byte;
    for (int i = 0; i < 8; ++i) sum = (sum & 1) != 0 ? (sum >> 1) ^ 0xA001 : sum >> 1;
  }
  return static_cast<std::uint16_t>(sum);
}

/// The answer to a request for `count` registers: 20.0f, high word first, repeated.
std::vector<std::uint8_t> answer_of(std::uint8_t unit, std::uint8_t function, unsigned count) {
  std::vector<std::uint8_t> frame{unit, function, static_cast<std::uint8_t>(2 * count)};
  for (unsigned i = 0; i < count; ++i) {
    const bool high = i % 2 == 0;
    frame.push_back(high ? 0x41 : 0x00);
    frame.push_back(high ? 0xA0 : 0x00);
  }
  const unsigned sum = checksum(frame);
  frame.push_back(static_cast<std::uint8_t>(sum & 0xFF));
  frame.push_back(static_cast<std::uint8_t>(sum >> 8));
  return frame;
}

}  // namespace

TcpListener::TcpListener() : socket_(::socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  auto* plain = reinterpret_cast<sockaddr*>(&address);
  if (::bind(socket_, plain, size) != 0 || ::listen(socket_, 4) != 0) fail("bind");
  ::getsockname(socket_, plain, &size);
  port_ = ntohs(address.sin_port);
}

TcpListener::~TcpListener() {
  ::close(socket_);
}

PseudoTerminal::PseudoTerminal() : master_(::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC)) {
  if (master_ < 0 || ::grantpt(master_) != 0 || ::unlockpt(master_) != 0) fail("pty");
  std::array<char, 64> name{};
  ::ptsname_r(master_, name.data(), name.size());
  device_ = name.data();
  keep_open_ = ::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC);
  termios raw{};
  ::tcgetattr(keep_open_, &raw);
  ::cfmakeraw(&raw);
  ::tcsetattr(keep_open_, TCSANOW, &raw);
}

PseudoTerminal::~PseudoTerminal() {
  ::close(keep_open_);
  ::close(master_);
}

void serve_tcp(const TcpListener& listener) {
  modbus_t* context = modbus_new_tcp("127.0.0.1", listener.port());
  modbus_mapping_t* mapping = modbus_mapping_new(0, 0, 0, 64);
  if (context == nullptr || mapping == nullptr) fail("libmodbus");
  for (int i = 0; i < 64; i += 2) mapping->tab_input_registers[i] = 0x41A0;  // 20.0f
  std::array<std::uint8_t, MODBUS_TCP_MAX_ADU_LENGTH> query{};
  while (true) {
    const int client = ::accept(listener.socket(), nullptr, nullptr);
    if (client < 0) fail("accept");
    const int on = 1;
    ::setsockopt(client, IPPROTO_TCP, TCP_NODELAY, &on, sizeof on);
    modbus_set_socket(context, client);
    while (true) {
      const int size = modbus_receive(context, query.data());
      if (size < 0) break;
      modbus_reply(context, query.data(), size, mapping);
    }
    ::close(client);
  }
}

void serve_rtu(const PseudoTerminal& line, std::size_t living) {
  constexpr double baud = 19200.0;
  constexpr double device_s = 3e-3;
  std::vector<std::uint8_t> buffer;
  while (true) {
    std::array<std::uint8_t, 64> bytes{};
    const auto count = ::read(line.master(), bytes.data(), bytes.size());
    if (count <= 0) fail("pty");
    buffer.insert(buffer.end(), bytes.begin(), bytes.begin() + count);
    if (buffer.size() < 8) continue;
    const unsigned registers = buffer[5];
    const std::uint8_t unit = buffer[0];
    const std::uint8_t function = buffer[1];
    buffer.clear();
    if (unit < 1 || unit > living) continue;
    const auto answer = answer_of(unit, function, registers);
    const double line_s = (8.0 + static_cast<double>(answer.size())) * 10.0 / baud;
    std::this_thread::sleep_for(std::chrono::duration<double>(line_s + device_s));
    if (::write(line.master(), answer.data(), answer.size()) < 0) fail("pty");
  }
}

void stay_on_processor(unsigned number) {
  const unsigned processors = std::max(1U, std::thread::hardware_concurrency());
  cpu_set_t set;
  CPU_ZERO(&set);
  CPU_SET(number % processors, &set);
  ::sched_setaffinity(0, sizeof set, &set);  // if refused, measurements are only noisier
}

}  // namespace bench
