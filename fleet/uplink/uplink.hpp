/// From a daemon's history to the store: what is new, again and again, within a share of a core.
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

/// Thrown where a signal ended the program.
struct Stopped {};

/// Sleeps so long that the program takes its share of a core at most.
class Pace {
 public:
  /// @param ending  blocked signals that end a sleep
  Pace(double cpu_percent_max, const sigset_t& ending)
      : rest_per_work_(100.0 / cpu_percent_max - 1.0), ending_(ending) {}
  /// For what was computed since the last time. Cheap where that is little. @throws Stopped
  void rest();
  /// @throws Stopped
  void sleep(std::chrono::duration<double> time) const;

 private:
  static constexpr double work_s_max = 0.002;
  double rest_per_work_;
  sigset_t ending_;
  double rested_at_s_{0.0};  ///< of the process' own time
};

class Uplink {
 public:
  Uplink(const UplinkSettings& settings, Pace& pace);

  /// Sends what is new in all histories. After an error the next one begins with a new connection,
  /// and with what the store then says it has.
  /// @return whether there was anything. @throws pqxx::failure, HistoryError, Stopped
  bool send_new();
  /// The connection is given up; the next send_new() makes another.
  void hang_up() noexcept;

 private:
  struct Source {
    std::filesystem::path file;
    std::optional<MachineRows> rows;
    std::optional<HistoryMeans> means;
    std::int64_t event_run{0};
    std::uint64_t event_number{0};
  };
  bool send_new(Source& source);
  bool send_events(Source& source);
  void exchange();

  const UplinkSettings& settings_;
  Pace& pace_;
  std::optional<pqxx::connection> store_;
  std::vector<Source> sources_;
  std::string reported_error_;  ///< of releases, wrong since
};

}  // namespace thermocomp::fleet
