/// The state at start, from the state file or else the history, with warnings for the operator.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "daemon/history/replay/segment_walk.hpp"
#include "daemon/recording/last_sent.hpp"
#include "daemon/state/state_file.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

/// The machine's state when the daemon last ran, from the history.
struct RecordedState {
  /// True if the history has, or had, content: this is not the machine's first start.
  bool has_run{false};
  /// After the last recorded cycle of the newest sound segment; none: no segment is sound.
  std::optional<PersistentState> state;
  /// True if no newer data is damaged, so that no command came after the last commit.
  bool is_newest{true};
  std::string problem;  ///< error of the newest segment, or of the file
};

/// Replays the newest sound segment to its end; 6 h at 100 Hz take some seconds.
/// Never throws because of the file.
[[nodiscard]] RecordedState last_recorded_state(const std::filesystem::path& history,
                                                const SetupParser& parser = parse_setup);

struct StartState {
  PersistentState state;
  bool is_on_disk{true};       ///< false: not from the file; must be written
  bool reference_lost{false};  ///< the machine's reference is unknown: stay disabled
  ReferenceRecord reference;   ///< origin of the reference of `state`, if in the file
  std::vector<std::string> warnings;
};

/// Reads the state file. If it is missing or unusable:
///   no history, or an empty one   missing: first start; unusable: disabled, reference lost
///   newest segment sound          everything from the history
///   only older segments sound     everything from the newest of them, but disabled: later
///                                 commands are unknown
///   no segment sound              disabled, reference lost
/// Moves an unusable state file aside. May take some seconds, see last_recorded_state().
///
/// Drops, with a warning, offsets beyond the configured bounds, and the corridor of an axis whose
/// offset was sent to another controller or with another sign.
/// @param recorded  offsets of the last-sent record [um]
[[nodiscard]] StartState find_start_state(const DaemonConfig& config, Offsets recorded = {});

}  // namespace thermocomp
