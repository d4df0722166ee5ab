/// The state with which the daemon starts, and what the operator must be told about it.
#pragma once

#include <string>
#include <vector>

#include "config/daemon/daemon_config.hpp"
#include "daemon/recording/last_sent.hpp"
#include "daemon/state/reference_record.hpp"
#include "estimator/pipeline/persistent_state.hpp"

namespace thermocomp {

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
/// A state file that is unusable is moved aside. May take some seconds (last_state.hpp).
///
/// Offsets beyond this configuration's bounds are left out, with a warning; so are those that were
/// sent to another controller or with another sign, where an axis would have to start from them.
/// @param recorded  of the last-sent record
[[nodiscard]] StartState find_start_state(const DaemonConfig& config, Offsets recorded = {});

}  // namespace thermocomp
