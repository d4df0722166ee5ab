/// A Modbus TCP server with any number of clients, on the simulator's loop.
#pragma once

#include <cstdint>
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

}  // namespace thermocomp
