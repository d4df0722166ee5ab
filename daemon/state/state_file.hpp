/// What survives a restart, by name: a small JSON file that is either the old or the new one,
/// whatever happens while it is written.
#pragma once

#include <filesystem>
#include <string>

#include "daemon/state/reference_record.hpp"
#include "estimator/pipeline/persistent_state.hpp"

namespace thermocomp {

struct LoadedState {
  PersistentState state;
  bool found{false};    ///< a good file was there; otherwise `state` is the caller's fallback
  bool damaged{false};  ///< something was there that could not be used
  std::string warning;  ///< what, for the log; not empty where `damaged`, memory permitting
  /// The reference in it was taken because the right one had been lost (see StateKeeper).
  bool reference_lost{false};
  ReferenceRecord reference;  ///< unknown where the file does not say
};

/// Never throws: a damaged or foreign file is moved aside (`<file>.unusable`), one of a newer
/// format too (`<file>.format-N`), and reported in `warning`.
/// @param fallback  returned where there is no usable file
[[nodiscard]] LoadedState load_state_file(const std::filesystem::path& file,
                                          const PersistentState& fallback) noexcept;

/// Writes beside the file, flushes to the disk, renames over it, flushes the folder.
/// @return empty, or what went wrong; the old file then still stands
[[nodiscard]] std::string save_state_file(const std::filesystem::path& file,
                                          const PersistentState& state, bool reference_lost = false,
                                          const ReferenceRecord& reference = {}) noexcept;

}  // namespace thermocomp
