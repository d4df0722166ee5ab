/// Promises of reading, replaying and exporting any damaged history.
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
/// Throws only HistoryError, which names the file, and ConfigurationError; exports are run files.
HistoryUse use_history(const std::filesystem::path& file, const SetupParser& parser);

}  // namespace thermocomp::fuzz
