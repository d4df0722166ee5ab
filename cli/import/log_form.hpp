/// Logs of other programs that no table of numbers is, as run files. Each form is known by a mark
/// that no other has; whatever else comes is a table, read by config/run_forms.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/run_data.hpp"

namespace thermocomp::cli {

enum class LogForm {
  table,              ///< of rows with a header: config/run_forms
  halsampler,         ///< LinuxCNC: numbers between blanks, no header
  temperature_store,  ///< Moonraker: JSON
  toa5,               ///< Campbell Scientific: four lines above the rows
  kw_watcher          ///< Panasonic: seven lines above the rows
};

/// What a person says about a log that does not say it itself.
struct LogOptions {
  std::vector<std::string> names;  ///< of the columns of a log without a header
  std::optional<double> period_s;  ///< between two rows, where the log has no time
};

/// @param text  of the whole file
[[nodiscard]] LogForm log_form(std::string_view text);

/// Rows of `sampler`, with the sample's number in front (option -t) or without it. Where the buffer
/// ran over the rows that are missing leave a gap in numbered rows; without numbers the file is
/// refused, because nothing tells how long the gap is.
/// @throws ConfigurationError naming the line to write
[[nodiscard]] RunFile read_halsampler(std::string_view text, const std::string& name,
                                      const LogOptions& options);

/// The answer of `server/temperature_store`: the last values of each heater and sensor, the newest
/// at the end, one a second unless the period says otherwise. Temperatures become `<name>_degC`;
/// targets and powers are signals.
[[nodiscard]] RunFile read_temperature_store(std::string_view text, const std::string& name,
                                             const LogOptions& options);

/// The same rows under one header with units in brackets, for config/run_forms.
struct PlainTable {
  std::string text;
  std::vector<std::string> said;  ///< what was taken off, a line each
};
[[nodiscard]] PlainTable plain_toa5(std::string_view text, const std::string& name);
[[nodiscard]] PlainTable plain_kw_watcher(std::string_view text, const std::string& name);

}  // namespace thermocomp::cli
