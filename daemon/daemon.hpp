/// thermocompd as a whole: puts the parts together, runs the cycle, supervises it, answers.
#pragma once

#include <filesystem>
#include <memory>

namespace thermocomp {

class Daemon {
 public:
  /// Loads the configuration and makes all parts; nothing runs yet.
  /// @throws ConfigurationError, DriverError, SocketError, HistoryError, InvalidValue
  explicit Daemon(const std::filesystem::path& config_file);
  ~Daemon();
  Daemon(const Daemon&) = delete;
  Daemon& operator=(const Daemon&) = delete;

  /// Starts everything and supervises until SIGTERM or SIGINT; SIGHUP reloads. The caller's thread
  /// is main of the architecture.
  /// @throws RealTimeError when real time is required and not available
  void run();

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp
