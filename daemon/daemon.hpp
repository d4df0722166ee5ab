/// thermocompd as a whole: constructs the parts, runs and supervises the cycle, serves the socket.
#pragma once

#include <filesystem>
#include <memory>

namespace thermocomp {

class Daemon {
 public:
  /// Loads the configuration and constructs all parts without starting them.
  /// @throws ConfigurationError, DriverError, SocketError, HistoryError, InvalidValue
  explicit Daemon(const std::filesystem::path& config_file);
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  /// Runs as main's thread until SIGTERM or SIGINT; SIGHUP reloads.
  /// @throws RealTimeError when real time is required and not available
  void run();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
