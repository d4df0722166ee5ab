/// `--columns MAP.toml`: what a person says about the form of files that do not say it themselves.
/// config/examples/columns.toml shows every key.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace thermocomp {

struct MappedColumn {
  std::string name;  ///< ours, with our unit: "z_um"
  std::string unit;  ///< theirs, "mm"; empty: that in the header, or that of `name`
};

enum class DateOrder { unknown, day_month_year, month_day_year, year_month_day };

struct ColumnMap {
  std::string file;               ///< for messages
  std::optional<char> separator;  ///< ',', ';', '|', tab or blank
  std::optional<char> decimal;    ///< '.' or ','
  std::optional<char> thousands;  ///< between groups of three digits
  int header_line{0};             ///< counted from 1; 0: the first that is not a comment
  DateOrder date_order{DateOrder::unknown};
  std::vector<std::string> time;  ///< column, or date and clock time; empty: found
  std::string time_unit;  ///< "s", "ms", "us", "ns", "min", "h", "day", "hh:mm", "mm:ss" or empty
  std::vector<std::string> names;    ///< of the columns of a table without a header
  std::optional<double> period_s;    ///< between two rows of a table without time
  std::vector<std::string> pivot;    ///< columns of a series' name and, maybe, of its value
  std::vector<std::string> missing;  ///< further words for a missing value
  std::vector<std::string> ignored;  ///< columns that are left out; "": those without a name
  bool takes_signals{false};         ///< a column without unit is a signal; `import` says so
  std::map<std::string, MappedColumn> columns;  ///< by the name in the header
};

/// @throws ConfigurationError with every problem of the file
[[nodiscard]] ColumnMap load_column_map(const std::filesystem::path& path);
/// @param name stands for the file in problems
[[nodiscard]] ColumnMap parse_column_map(const std::string& text, const std::string& name);

}  // namespace thermocomp
