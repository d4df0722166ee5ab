/// A socket to a host and port, of a stream or of datagrams. Only for the .cpp files of this
/// folder.
#pragma once

#include <memory>
#include <string>

#include "drivers/modbus/name_lookup.hpp"
#include "drivers/modbus/port.hpp"
#include "drivers/modbus/port_wait.hpp"

namespace thermocomp {

class TcpPort final : public ModbusPort {
 public:
  /// @param connect_max  the longest that connecting may take
  TcpPort(const ModbusTcp& tcp, nanoseconds connect_max) : tcp_(tcp), connect_max_(connect_max) {}
  ~TcpPort() override { close_socket(); }

  [[nodiscard]] nanoseconds now() const noexcept override;
  bool open(std::string& why) override;
  void close() noexcept override { close_socket(); }
  bool send(std::span<const std::uint8_t> bytes) noexcept override;
  PortWait wait_for_input(nanoseconds deadline) noexcept override;
  PortBytes receive(std::span<std::uint8_t> into) noexcept override;
  bool pause_until(nanoseconds time) noexcept override { return wait_.pause_until(time); }
  void cancel() noexcept override { wait_.cancel(); }
  [[nodiscard]] bool cancelled() const noexcept override { return wait_.cancelled(); }

 private:
  bool open_socket(const SocketAddress& address, std::string& why);
  void close_socket() noexcept;

  ModbusTcp tcp_;
  nanoseconds connect_max_;
  InterruptibleWait wait_;
  std::unique_ptr<NameLookup> lookup_;
  int fd_{-1};
};

}  // namespace thermocomp
