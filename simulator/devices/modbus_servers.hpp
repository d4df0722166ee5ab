/// Servers of Modbus units on a TCP port and on a serial line.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "simulator/devices/event_loop.hpp"
#include "simulator/devices/modbus_frames.hpp"

namespace thermocomp {

/// A unit's answer; nullopt: silence.
using ModbusAnswerer =
    std::function<std::optional<WireAnswer>(std::uint8_t unit, std::span<const std::uint8_t> pdu)>;

class ModbusTcpServer {
 public:
  static constexpr std::size_t clients_max = 128;

  /// Starts listening. @param port 0: any free port. @throws std::runtime_error
  ModbusTcpServer(EventLoop& loop, const std::string& host, int port, ModbusAnswerer answerer);
  ~ModbusTcpServer();
  ModbusTcpServer(const ModbusTcpServer&) = delete;
  ModbusTcpServer& operator=(const ModbusTcpServer&) = delete;

  [[nodiscard]] int port() const noexcept { return port_; }
  void close_connections();
  /// Closes all connections and refuses new ones, as a device without power.
  void switch_off();
  /// Listens again on the same port; if it is taken, call again.
  void switch_on();

 private:
  struct Client;

  void listen_at(int port);
  void accept_client();
  void client_ready(const std::shared_ptr<Client>& client, short happened);
  void read_requests(const std::shared_ptr<Client>& client);
  void send(const std::shared_ptr<Client>& client, std::span<const std::uint8_t> bytes);
  void flush(const std::shared_ptr<Client>& client);
  void close_client(const std::shared_ptr<Client>& client);

  EventLoop& loop_;
  std::string host_;
  ModbusAnswerer answerer_;
  int listener_{-1};
  int port_{0};
  std::map<int, std::shared_ptr<Client>> clients_;
};

/// Serial line with Modbus RTU units on a pseudo terminal.
struct RtuLineTiming {
  int baud{9600};
  bool line_delay{false};  ///< request, 3.5 characters of silence and answer take real time
};

class ModbusRtuLine {
 public:
  /// Opens a pty and creates or replaces the symbolic link to its other end. @throws
  /// std::runtime_error
  ModbusRtuLine(EventLoop& loop, std::filesystem::path link, RtuLineTiming timing,
                ModbusAnswerer answerer);
  ~ModbusRtuLine();  ///< removes the link unless it was replaced
  ModbusRtuLine(const ModbusRtuLine&) = delete;
  ModbusRtuLine& operator=(const ModbusRtuLine&) = delete;

  [[nodiscard]] const std::string& terminal() const noexcept { return terminal_; }
  void discard();  ///< drops a partial request and pending answers

 private:
  void open_terminal();
  void place_link();
  void readable();
  void handle(bool after_silence);
  void answer(const ModbusFrame& frame);
  void write(std::span<const std::uint8_t> bytes);

  EventLoop& loop_;
  std::filesystem::path link_;
  RtuLineTiming timing_;
  ModbusAnswerer answerer_;
  int master_{-1};
  int slave_{-1};  ///< kept open, so the line survives a client's close
  std::string terminal_;
  std::vector<std::uint8_t> received_;
  /// Timers compare these counts and do nothing if one has changed since.
  std::uint64_t receptions_{0};
  std::uint64_t discards_{0};
  std::shared_ptr<bool> alive_{std::make_shared<bool>(true)};
};

}  // namespace thermocomp
