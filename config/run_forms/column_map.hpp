/// `--columns MAP.toml`: the form of run files that do not define it themselves.
/// config/examples/columns.toml shows every key.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace thermocomp {

struct MappedColumn {
  std::string name;  ///< our name, with our unit: "z_um"
  std::string
      unit;  ///< the file's unit, "mm", "0.1 degC"; empty: as in the header, or as in `name`
};

enum class DateOrder { unknown, day_month_year, month_day_year, year_month_day };

struct ColumnMap {
  std::string file;               ///< for messages
  std::string encoding;           ///< of iconv(3); empty: detected
  std::optional<char> separator;  ///< ',', ';', '|', tab or blank
  std::optional<char> decimal;    ///< '.' or ','
  std::optional<char> thousands;  ///< between groups of three digits
  int header_line{0};             ///< counted from 1; 0: the first line that is not a comment
  DateOrder date_order{DateOrder::unknown};
  std::vector<std::string> time;  ///< column, or columns of date and time; empty: detected
  std::string
      time_unit;  ///< "s", "ms", "us", "ns", "min", "h", "day", "hh:mm", "mm:ss", "hhmmss" or empty
  std::vector<std::string> names;  ///< column names of a table without a header
  std::optional<double> period_s;  ///< row period of a table without time
  std::vector<std::string> pivot;  ///< columns with a series' name and, optionally, its value
  double scan_s{0};  ///< values of one row per value within it of the first become one row
  std::vector<std::string> missing;  ///< additional words for a missing value
  std::vector<std::string> ignored;  ///< columns left out; "": those without a name
  bool is_of_several{false};         ///< of several files: a column may be in another one
  bool takes_signals{false};         ///< columns without a unit are signals; set by `import`
  std::map<std::string, MappedColumn> columns;  ///< by the name in the header

  [[nodiscard]] bool ignores(std::string_view header) const;
  /// Description of the column; nullptr: none.
  [[nodiscard]] const MappedColumn* find(const std::string& header) const;
  /// True if the map describes the column or leaves it out.
  [[nodiscard]] bool uses(const std::string& header) const;
};

/// Parts of messages: write "T1" = `value` under [columns] in the file of --columns;
/// ignore = ["T1"]; either, for a column that may name the sensor of each row.
[[nodiscard]] std::string write_column(std::string_view header, const std::string& value);
[[nodiscard]] std::string ignore_column(std::string_view header);
[[nodiscard]] std::string pivot_or_ignore(std::string_view header);

/// "column 3": name of a column without one.
[[nodiscard]] std::string unnamed(std::size_t column);
[[nodiscard]] bool is_unnamed(std::string_view header);

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] ColumnMap load_column_map(const std::filesystem::path& path);
/// @param name  file name in problems
[[nodiscard]] ColumnMap parse_column_map(const std::string& text, const std::string& name);

}  // namespace thermocomp
