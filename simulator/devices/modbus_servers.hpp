/// Modbus units on a TCP port and on a serial line.
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

/// What a unit answers; none: it stays silent.
using ModbusAnswerer =
    std::function<std::optional<WireAnswer>(std::uint8_t unit, std::span<const std::uint8_t> pdu)>;

class ModbusTcpServer {
 public:
  static constexpr std::size_t clients_max = 128;

  /// Listens at once. @param port 0: any free one. @throws std::runtime_error
  ModbusTcpServer(EventLoop& loop, const std::string& host, int port, ModbusAnswerer answerer);
  ~ModbusTcpServer();
  ModbusTcpServer(const ModbusTcpServer&) = delete;
  ModbusTcpServer& operator=(const ModbusTcpServer&) = delete;

  [[nodiscard]] int port() const noexcept { return port_; }
  void close_connections();
  /// Also refuses new connections, as a device without power.
  void switch_off();
  /// Listens again at the same port; tried again at the next call where the port is taken.
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

/// A serial line with Modbus RTU units on a pseudo terminal, on the simulator's loop.
struct RtuLineTiming {
  int baud{9600};
  bool line_delay{false};  ///< request, 3.5 characters of silence and answer take their time
};

class ModbusRtuLine {
 public:
  /// Opens a pty and puts a symbolic link to its other end at `link`, replacing a link that is
  /// there already. @throws std::runtime_error
  ModbusRtuLine(EventLoop& loop, std::filesystem::path link, RtuLineTiming timing,
                ModbusAnswerer answerer);
  ~ModbusRtuLine();  ///< removes the link where it is still ours
  ModbusRtuLine(const ModbusRtuLine&) = delete;
  ModbusRtuLine& operator=(const ModbusRtuLine&) = delete;

  [[nodiscard]] const std::string& terminal() const noexcept { return terminal_; }
  void discard();  ///< forgets what has been received of a request, and answers under way

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
  int slave_{-1};  ///< kept open so that the line survives a client that closes it
  std::string terminal_;
  std::vector<std::uint8_t> received_;
  /// Counts receptions; what was scheduled before the line was discarded compares it and gives up.
  std::uint64_t receptions_{0};
  std::uint64_t discards_{0};
  std::shared_ptr<bool> alive_{std::make_shared<bool>(true)};
};

}  // namespace thermocomp
