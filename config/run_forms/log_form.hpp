/// Logs that are no table of rows under a header, rewritten as one. Each form is a file of forms/
/// and a line of the table in log_form.cpp; whatever else comes is read as it is.
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/column_map.hpp"

namespace thermocomp {

/// The same values under one header with units in brackets.
struct PlainTable {
  std::string text;
  std::vector<std::string> notes;  ///< what was understood, a line each
  int lines_above{0};              ///< of the file, in front of the first line of `text`
  bool has_own_names{false};       ///< the columns are called as in our own form
};

/// @param text  UTF-8
/// @param map  what a person says; may be nullptr
/// @return nullopt when the text is no such log
/// @throws ConfigurationError
[[nodiscard]] std::optional<PlainTable> plain_table(std::string_view text, const std::string& name,
                                                    const ColumnMap* map);

namespace forms {

/// A file, as its form reads it.
struct Log {
  std::string_view text;
  const std::string& name;
  const ColumnMap& map;

  [[noreturn]] void refuse(int line, const std::string& key, const std::string& value,
                           std::string rule) const;
};

/// LinuxCNC's sampler: numbers between blanks, the sample's number in front with -t. Where the
/// buffer ran over, rows are missing: a gap in numbered rows, else an error. Numbers of other
/// programs whose time is one of the names.
bool is_halsampler(std::string_view text);
PlainTable plain_halsampler(const Log& log);

/// LinuxCNC's oscilloscope: "Sampling period is N ns", then a label before each value.
bool is_halscope(std::string_view text);
PlainTable plain_halscope(const Log& log);

/// JSON: Moonraker's temperature store, lines or lists of records, records by their time.
bool is_json(std::string_view text);
PlainTable plain_json(const Log& log);

/// Panasonic's KW Watcher: seven lines above the rows.
bool is_kw_watcher(std::string_view text);
PlainTable plain_kw_watcher(const Log& log);

/// LabVIEW's LVM: a header of keys, names below it.
bool is_lvm(std::string_view text);
PlainTable plain_lvm(const Log& log);

/// TwinCAT's scope: keys of each channel above rows without names.
bool is_twincat(std::string_view text);
PlainTable plain_twincat(const Log& log);

/// Lines of a time and "name: value" pairs: serial consoles, decoded CAN frames, logfmt.
bool is_labelled(std::string_view text);
PlainTable plain_labelled(const Log& log);

/// Takes the first line off `text`; it comes without its end.
std::string_view take_line(std::string_view& text);

/// Fields between separators, without quotes and blanks.
std::vector<std::string> fields_of(std::string_view line, char separator = ',');

/// As one field of a line between commas.
std::string in_quotes(std::string_view field);
/// "PTemp [C]", quoted.
std::string with_unit(std::string_view name, std::string_view unit);

}  // namespace forms

}  // namespace thermocomp
