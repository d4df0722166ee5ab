/// The state with which the daemon starts, by the state file or else by the history, and what the
/// operator must know about it.
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

/// The machine's state when the daemon last ran, by the history.
struct RecordedState {
  /// The history has, or had, something in it: this is not the first start of this machine.
  bool has_run{false};
  /// As after the last recorded cycle of the newest segment that is sound; none: there is none.
  std::optional<PersistentState> state;
  /// Nothing newer is damaged, so no command can have come later than the last commit.
  bool is_newest{true};
  std::string problem;  ///< what is wrong with the newest segment, or with the file
};

/// Steps the newest sound segment again to its end; a segment of 6 h at 100 Hz takes some seconds.
/// Never throws because of the file.
[[nodiscard]] RecordedState last_recorded_state(const std::filesystem::path& history,
                                                const SetupParser& parser = parse_setup);

struct StartState {
  PersistentState state;
  bool is_on_disk{true};       ///< false: came from elsewhere than the file, and must be written
  bool reference_lost{false};  ///< nobody knows the machine's reference: stay disabled
  ReferenceRecord reference;   ///< when that of `state` was taken, as far as the file says
  std::vector<std::string> warnings;
};

/// The state file's content. Where that is missing or unusable:
///   no history, or an empty one   missing: the first start; unusable: disabled, reference lost
///   newest segment sound          all from there
///   only older ones sound         all from the newest of them, but disabled: what an operator did
///                                 since is not known
///   none sound                    disabled, reference lost
/// A state file that is unusable is moved aside. May take some seconds, as last_recorded_state().
///
/// Offsets beyond this configuration's bounds are left out, with a warning; so are those that were
/// sent to another controller or with another sign, where an axis would have to start from them.
/// @param recorded  of the last-sent record
[[nodiscard]] StartState find_start_state(const DaemonConfig& config, Offsets recorded = {});

}  // namespace thermocomp
