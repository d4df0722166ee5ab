/// A run of the simulator: plant or replayed rows, buses, record.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>

#include "simulator/plant/machine_config.hpp"

namespace thermocomp {

struct SessionOptions {
  double time_factor{1.0};         ///< plant time per real time
  double duration_s{0.0};          ///< plant time; 0: until stopped
  double tick_s{0.01};             ///< period of register updates, real time
  bool start_on_heartbeat{false};  ///< plant time waits for the heartbeat to change
  std::filesystem::path replay;    ///< run file instead of the plant; empty: none
  double row_period_s{0.0};        ///< replay: real time per row; 0: by time_s and time_factor
  std::size_t row_begin{0};        ///< replay: first row
  std::size_t row_end{std::numeric_limits<std::size_t>::max()};  ///< replay: end (exclusive)
  std::filesystem::path row_log;     ///< replay: CSV of row and CLOCK_MONOTONIC ns; empty: none
  double settle_s{1.0};              ///< replay: duration of the last row, real time
  bool stay{false};                  ///< keep running after the end
  std::filesystem::path truth;       ///< empty: none
  std::filesystem::path ports_file;  ///< empty: none
};

/// Prints the ready line, runs to the end or to SIGINT or SIGTERM, prints the summary.
/// @throws std::exception with a one-line message
void run_session(const MachineConfig& machine, const SessionOptions& options);

}  // namespace thermocomp
