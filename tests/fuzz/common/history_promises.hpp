/// What reading, replaying and exporting promise, however damaged the history is.
#pragma once

#include <cstdint>
#include <filesystem>

#include "daemon/history/replay/replay.hpp"

namespace thermocomp::fuzz {

struct HistoryUse {
  bool replayed{false};
  bool exported{false};
  ReplaySummary summary;
};
/// Nothing but HistoryError and ConfigurationError leaves, and a HistoryError names the file; what
/// was exported is a run file.
HistoryUse use_history(const std::filesystem::path& file, const SetupParser& parser);

}  // namespace thermocomp::fuzz
