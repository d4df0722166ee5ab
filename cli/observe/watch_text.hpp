/// The live table of `thermocomp watch`, as a screen for a terminal or as lines for a log. Pure.
#pragma once

#include <string>

#include "cli/observe/axis_trends.hpp"
#include "cli/observe/truth_file.hpp"
#include "status/status.hpp"

namespace thermocomp::cli {

/// A whole screen. @param truth  what the tool really does, where it is simulated; else nullptr
/// @param trends  how the offsets went; nullptr: not shown
[[nodiscard]] std::string watch_screen(const Status& status, const TruthRow* truth, bool colours,
                                       const AxisTrends* trends = nullptr);
/// Two lines: what the columns of watch_line() are.
[[nodiscard]] std::string watch_header(const Status& status, const TruthRow* truth);
[[nodiscard]] std::string watch_line(const Status& status, const TruthRow* truth);

}  // namespace thermocomp::cli
