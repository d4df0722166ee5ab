/// The configuration of thermocompd, loaded from a TOML file and validated.
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
  double rate_hz{100.0};  ///< 1..1000
  int priority{60};       ///< SCHED_FIFO priority, 1..98
  int cpu{-1};            ///< -1: any
  RealTimeRule real_time{
      RealTimeRule::warn};  ///< behaviour if FIFO or memory locking is not permitted
  bool operator==(const LoopConfig&) const = default;
};

struct HistoryConfig {
  bool enabled{true};
  std::filesystem::path file{"/var/lib/thermocomp/history.db"};
  double size_MB_max{512.0};
  double age_days_max{90.0};
  double commit_s{5.0};          ///< 0.1..10
  double offsets_period_s{1.0};  ///< period of recording offsets
  double segment_h{6.0};         ///< period of state snapshots, the start points of a replay
  bool operator==(const HistoryConfig&) const = default;
};

struct SocketConfig {
  std::filesystem::path path{"/run/thermocomp/status.sock"};
  std::string read_group{"thermocomp"};
  std::string operator_group{"thermocomp-operator"};
  std::string bridge_group{"thermocomp-bridge"};
  std::string model_group{"thermocomp-model"};  ///< may change the model
  bool operator==(const SocketConfig&) const = default;
};

/// `[model] candidate`: runs beside the model, is scored, never sent. A candidate that cannot run
/// has no effect on the rest.
struct CandidateModel {
  std::filesystem::path file;
  std::string problem;  ///< why it does not run; empty: it does, and the other members are valid
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
  std::vector<BusConfig> buses;  ///< by kind, within a kind in file order
  ControllerConfig controller;
  bool dry_run{false};  ///< the controller is read, but not written
  HistoryConfig history;
  SocketConfig socket;
  /// The texts as read, stored in the history to make a replay self-contained.
  std::string text;
  std::string model_text;
  std::string model_checksum;  ///< SHA-256 of the model file, hexadecimal
  /// Warnings, one line each: such as flaws of bus files in unused entries.
  std::vector<std::string> remarks;
  ThermalModel model;
  std::optional<CandidateModel> candidate;
};

/// Reads the daemon's file and its model file. Paths in it may be relative to the file's folder.
/// @throws ConfigurationError with every problem of both files
[[nodiscard]] DaemonConfig load_daemon_config(const std::filesystem::path& path);

/// The same from texts, as stored in the history, with their names for problems. Opens no file:
/// devices with a preset and CANopen objects given by name are omitted from the buses.
/// @throws ConfigurationError
[[nodiscard]] DaemonConfig parse_daemon_config(const std::string& config_text,
                                               const std::string& config_name,
                                               const std::string& model_text,
                                               const std::string& model_name);

/// Differences that require a restart; empty: a reload suffices. A reload covers model, blocks,
/// screening, smoothing, limiter, compensation and log_level.
[[nodiscard]] std::vector<std::string> restart_needed(const DaemonConfig& running,
                                                      const DaemonConfig& next);

/// Replaces the candidate; an empty path: none. Errors are its `problem`.
void set_candidate(DaemonConfig& config, const std::filesystem::path& file);

}  // namespace thermocomp
