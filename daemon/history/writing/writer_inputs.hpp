/// What the writer of a history is given besides the records.
#pragma once

#include <functional>
#include <string>

#include "estimator/types.hpp"

namespace thermocomp {

/// What a replay needs besides the records.
struct HistorySetup {
  std::string config_text;
  std::string model_text;
  std::string model_checksum;
};

/// Where the writer gets its times from.
struct WriterClocks {
  std::function<nanoseconds()> monotonic;  ///< the grid's
  std::function<nanoseconds()> wall;       ///< since 1970, may be stepped
};
[[nodiscard]] WriterClocks system_clocks();

}  // namespace thermocomp
