/// A serial line with Modbus RTU units on a pseudo terminal, on the simulator's loop.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "simulator/devices/event_loop.hpp"
#include "simulator/devices/modbus_tcp_server.hpp"

namespace thermocomp {

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
