/// Rewrites logs that are not tables with a header into such tables. Each form is a file in forms/
/// and a line of the table in log_form.cpp; other files are read unchanged.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/run_forms/column_map.hpp"

namespace thermocomp {

/// The values under one header, with units in brackets.
struct PlainTable {
  std::string text;
  std::vector<std::string> notes;  ///< how it was read, one line each
  int lines_above{0};              ///< lines of the file before the first line of `text`
  std::vector<int> numbers{};      ///< of each line of `text` in the file; empty: they follow
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

// Each returns nullopt when the text is of another form.

/// LinuxCNC's sampler: numbers separated by blanks, with -t preceded by the sample's number. Rows
/// lost by an overrun are a gap if numbered, else an error. Also numbers of other programs if one
/// of the names is a time.
std::optional<PlainTable> halsampler(const Log& log);

/// LinuxCNC's oscilloscope: "Sampling period is N ns", then a label before each value.
std::optional<PlainTable> halscope(const Log& log);

/// JSON: Moonraker's temperature store, lines or lists of records, records by their time.
std::optional<PlainTable> json_log(const Log& log);

/// Panasonic's KW Watcher: seven lines above the rows.
std::optional<PlainTable> kw_watcher(const Log& log);

/// LabVIEW's LVM: a header of keys, then names.
std::optional<PlainTable> lvm(const Log& log);

/// TwinCAT's scope: keys of each channel above rows without names.
std::optional<PlainTable> twincat(const Log& log);

/// Lines with a time and "name: value" pairs: serial consoles, decoded CAN frames, logfmt.
std::optional<PlainTable> labelled(const Log& log);

/// Splits at separators; removes quotes and blanks. At least one field.
std::vector<std::string> fields_of(std::string_view line, char separator = ',');

/// Quotes a field of a comma-separated line.
std::string in_quotes(std::string_view field);
/// "PTemp [C]", quoted.
std::string with_unit(std::string_view name, std::string_view unit);

/// Columns in the order in which their names appear.
class NamedColumns {
 public:
  /// @param units  by name
  explicit NamedColumns(std::map<std::string, std::string> units = {}) : units_(std::move(units)) {}
  /// @param header  as it is to be written
  std::size_t add(const std::string& header);
  /// A name of the log, added if it is new.
  std::size_t find_or_add(const std::string& name);
  /// To be written as it is; makes the rows up to this one.
  std::string& cell(std::size_t row, std::size_t column);
  [[nodiscard]] std::size_t rows() const noexcept { return rows_.size(); }
  void keep_rows(std::size_t rows) { rows_.resize(rows); }
  /// @param lines  of each row; empty: one after the other
  [[nodiscard]] std::string text(const std::vector<int>& lines = {}) const;

 private:
  std::map<std::string, std::string> units_;
  std::vector<std::string> headers_;
  std::map<std::string, std::size_t> index_;
  std::vector<std::vector<std::string>> rows_;
};

}  // namespace forms

}  // namespace thermocomp
