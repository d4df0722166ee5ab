/// The whole configuration of thermocompd, as loaded and validated from one TOML file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/text/problems.hpp"
#include "drivers/controllers/controller_config.hpp"
#include "drivers/sensors/bus_config.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/thermal_model.hpp"

namespace thermocomp {

enum class RealTimeRule { require, warn };

struct LoopConfig {
  double rate_hz{100.0};                       ///< 1..1000
  int priority{60};                            ///< SCHED_FIFO priority, 1..98
  int cpu{-1};                                 ///< -1: any
  RealTimeRule real_time{RealTimeRule::warn};  ///< where FIFO or memory locking is not allowed
  bool operator==(const LoopConfig&) const = default;
};

struct HistoryConfig {
  bool enabled{true};
  std::filesystem::path file{"/var/lib/thermocomp/history.db"};
  double size_MB_max{512.0};
  double age_days_max{90.0};
  double commit_s{5.0};          ///< 0.1..10
  double offsets_period_s{1.0};  ///< offsets are noted this often, for people and for proof
  double segment_h{6.0};         ///< a state snapshot this often: where a replay can start
  bool operator==(const HistoryConfig&) const = default;
};

struct SocketConfig {
  std::filesystem::path path{"/run/thermocomp/status.sock"};
  std::string read_group{"thermocomp"};
  std::string operator_group{"thermocomp-operator"};
  std::string bridge_group{"thermocomp-bridge"};
  std::string model_group{"thermocomp-model"};  ///< may change which model runs
  bool operator==(const SocketConfig&) const = default;
};

/// `[model] candidate`: runs beside the model, is scored and never sent. One that cannot run keeps
/// nothing from working.
struct CandidateModel {
  std::filesystem::path file;
  std::string problem;  ///< why it does not run; empty: it does, and the rest is there
  std::string checksum;
  EstimatorConfig estimator;
  ThermalModel model;
};

struct DaemonConfig {
  std::filesystem::path file;        ///< where it was read from
  std::filesystem::path model_file;  ///< resolved against the configuration's folder
  std::filesystem::path state_file{"/var/lib/thermocomp/state.json"};
  std::string log_level{"info"};
  LoopConfig loop;
  EstimatorConfig estimator;
  std::vector<BusConfig> buses;  ///< by kind, those of one kind as in the file
  ControllerConfig controller;
  bool dry_run{false};  ///< the controller is read and nothing is written to it
  HistoryConfig history;
  SocketConfig socket;
  /// The texts as read, kept with the history so that a replay needs nothing else.
  std::string text;
  std::string model_text;
  std::string model_checksum;  ///< SHA-256 of the model file, hexadecimal
  /// What is odd but forbids nothing, a line each: flaws of bus files that nothing here stands on.
  std::vector<std::string> remarks;
  ThermalModel model;
  std::optional<CandidateModel> candidate;
};

/// Reads the daemon's file and the model file that it names. Paths in it may be relative to the
/// folder of the file.
/// @throws ConfigurationError with every problem of both files
[[nodiscard]] DaemonConfig load_daemon_config(const std::filesystem::path& path);

/// The same from texts, as the history keeps them. The names stand for the files in problems; no
/// file is opened, so that devices with a preset and CANopen objects by name are left out of
/// the buses.
/// @throws ConfigurationError
[[nodiscard]] DaemonConfig parse_daemon_config(const std::string& config_text,
                                               const std::string& config_name,
                                               const std::string& model_text,
                                               const std::string& model_name);

/// Differences between the two that a running daemon cannot take over; empty: a reload will do.
/// A reload takes over model, blocks, screening, smoothing, limiter, compensation and log_level.
[[nodiscard]] std::vector<std::string> restart_needed(const DaemonConfig& running,
                                                      const DaemonConfig& next);

/// The model that runs beside in place of the one named; an empty path: none. What is wrong with it
/// is its `problem`.
void set_candidate(DaemonConfig& config, const std::filesystem::path& file);

}  // namespace thermocomp
