/// The servers of bench/modbus_poll: libmodbus' own server over TCP, and a paced serial line.
#pragma once

#include <string>

namespace bench {

/// A listening socket on a free port of this machine.
class TcpListener {
 public:
  TcpListener();
  TcpListener(const TcpListener&) = delete;
  TcpListener& operator=(const TcpListener&) = delete;
  ~TcpListener();
  [[nodiscard]] int port() const noexcept { return port_; }
  [[nodiscard]] int socket() const noexcept { return socket_; }

 private:
  int socket_{-1};
  int port_{0};
};

class PseudoTerminal {
 public:
  PseudoTerminal();
  PseudoTerminal(const PseudoTerminal&) = delete;
  PseudoTerminal& operator=(const PseudoTerminal&) = delete;
  ~PseudoTerminal();
  [[nodiscard]] const std::string& device() const noexcept { return device_; }
  [[nodiscard]] int master() const noexcept { return master_; }

 private:
  int master_{-1};
  int keep_open_{-1};  ///< so that the line stays when a client closes it
  std::string device_;
};

/// Serves one client after the other, for ever: 64 input registers, 32 floats.
[[noreturn]] void serve_tcp(const TcpListener& listener);

/// Serves the units 1..living; others are silent. Answers after the time the request and the
/// answer take at 19200 baud, plus 3 ms for the device.
[[noreturn]] void serve_rtu(const PseudoTerminal& line, std::size_t living);

}  // namespace bench
