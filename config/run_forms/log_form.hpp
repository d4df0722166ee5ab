/// Rewrites logs that are not tables with a header into such tables. Each form is a file in forms/
/// and a line of the table in log_form.cpp; other files are read unchanged.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/column_map.hpp"

namespace thermocomp {

/// The values under one header, with units in brackets.
struct PlainTable {
  std::string text;
  std::vector<std::string> notes;  ///< how it was read, one line each
  int lines_above{0};              ///< lines of the file before the first line of `text`
  bool has_own_names{false};       ///< columns have names of our own form
};

/// @param text  UTF-8; returned as it is when it is not such a log
/// @throws ConfigurationError
[[nodiscard]] PlainTable plain_table(std::string text, const std::string& name,
                                     const ColumnMap& map);

namespace forms {

/// A file, as input of its form.
struct Log {
  std::string_view text;
  const std::string& name;
  const ColumnMap& map;

  [[noreturn]] void refuse(int line, const std::string& key, const std::string& value,
                           std::string rule) const;
};

/// LinuxCNC's sampler: numbers separated by blanks, with -t preceded by the sample's number. Rows
/// lost by an overrun are a gap if numbered, else an error. Also numbers of other programs if one
/// of the names is a time.
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

/// LabVIEW's LVM: a header of keys, then names.
bool is_lvm(std::string_view text);
PlainTable plain_lvm(const Log& log);

/// TwinCAT's scope: keys of each channel above rows without names.
bool is_twincat(std::string_view text);
PlainTable plain_twincat(const Log& log);

/// Lines with a time and "name: value" pairs: serial consoles, decoded CAN frames, logfmt.
bool is_labelled(std::string_view text);
PlainTable plain_labelled(const Log& log);

/// Takes the first line off `text`; returned without its line end.
std::string_view take_line(std::string_view& text);

/// Splits at separators; removes quotes and blanks. At least one field.
std::vector<std::string> fields_of(std::string_view line, char separator = ',');

/// Quotes a field of a comma-separated line.
std::string in_quotes(std::string_view field);
/// "PTemp [C]", quoted.
std::string with_unit(std::string_view name, std::string_view unit);

}  // namespace forms

}  // namespace thermocomp
