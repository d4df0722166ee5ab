/// Sends new data of the daemon's history to the store within a share of a core.
#pragma once

#include <chrono>
#include <ctime>
#include <filesystem>
#include <optional>
#include <pqxx/connection>
#include <signal.h>
#include <string>
#include <vector>

#include "daemon/history/replay/history_means.hpp"
#include "fleet/store/machine_rows.hpp"
#include "fleet/uplink/uplink_settings.hpp"

namespace thermocomp::fleet {

/// Thrown when a signal ends the program.
struct Stopped {};

/// Limits the program to its share of a core by sleeping.
class Pace {
 public:
  /// @param ending  blocked signals that end a sleep
  Pace(double cpu_percent_max, const sigset_t& ending)
      : rest_per_work_(100.0 / cpu_percent_max - 1.0), ending_(ending) {}
  /// Sleeps in proportion to the CPU time since the last sleep. @throws Stopped
  void rest();
  /// @throws Stopped
  void sleep(std::chrono::duration<double> time) const;

 private:
  static constexpr double work_s_max = 0.002;
  double rest_per_work_;
  sigset_t ending_;
  double rested_at_s_{0.0};  ///< process CPU time
};

class Uplink {
 public:
  Uplink(const UplinkSettings& settings, Pace& pace);

  /// Sends new data of all histories; an unreadable one is reported and does not stop the others.
  /// After an error the next call reconnects and resumes.
  /// @return true if there was new data. @throws pqxx::failure, std::runtime_error, Stopped
  bool send_new();
  /// True if all histories were readable at the last send_new().
  [[nodiscard]] bool all_readable() const noexcept;
  /// Closes the connection; the next send_new() reconnects.
  void hang_up() noexcept;

 private:
  struct Source {
    std::filesystem::path file;
    std::optional<MachineRows> rows;
    std::optional<HistoryMeans> means;
    std::int64_t event_run{0};
    std::uint64_t event_number{0};
    bool by_another{false};  ///< reported that another uplink sends it, too
    std::string error;       ///< reason why the history cannot be read; empty: readable
  };
  bool send_if_readable(Source& source);
  bool send_new(Source& source);
  bool send_events(Source& source);
  void exchange();

  const UplinkSettings& settings_;
  Pace& pace_;
  std::optional<pqxx::connection> store_;
  std::vector<Source> sources_;
  std::string reported_error_;  ///< last reported problem with releases
};

}  // namespace thermocomp::fleet
