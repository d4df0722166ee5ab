/// The servers of the Modbus benchmarks: libmodbus's own server over TCP, and a paced serial line.
#pragma once

#include <csignal>
#include <cstddef>
#include <string>
#include <unistd.h>

#include <sys/wait.h>

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
  int keep_open_{-1};  ///< keeps the line when a client closes it
  std::string device_;
};

/// Serves clients one after the other, for ever: 64 input registers, 32 floats.
[[noreturn]] void serve_tcp(const TcpListener& listener);

/// Serves the units 1..living; others are silent. Answers after the transmission time of request
/// and answer at 19200 baud, plus 3 ms for the device.
[[noreturn]] void serve_rtu(const PseudoTerminal& line, std::size_t living);

/// Binds server and client to different processors: with the scheduler's choice a round is two to
/// three times as fast when both share one, and the rounds' ratios are meaningless.
void stay_on_processor(unsigned number);

/// A server in its own process, ended with this object.
class ServerProcess {
 public:
  /// @param body  called in the new process, on the second processor
  template <class Body>
  explicit ServerProcess(Body body) : process_(::fork()) {
    if (process_ == 0) {
      stay_on_processor(1);
      body();
      ::_exit(0);
    }
  }
  ServerProcess(const ServerProcess&) = delete;
  ServerProcess& operator=(const ServerProcess&) = delete;
  ~ServerProcess() {
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }

 private:
  pid_t process_;
};

}  // namespace bench
