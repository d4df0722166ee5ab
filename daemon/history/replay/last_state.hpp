/// The machine's state when the daemon last ran, by the history: for a start without a usable state
/// file.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include "daemon/history/replay/replay_setup.hpp"
#include "estimator/pipeline/estimator.hpp"

namespace thermocomp {

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

}  // namespace thermocomp
