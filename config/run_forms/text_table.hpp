/// A text table of another program, while it is read as a run: its columns, the user's map of them,
/// and the detected properties.
#pragma once

#include <algorithm>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/spelled_unit.hpp"

namespace thermocomp {

struct TextColumn {
  std::string header;       ///< without surrounding quotes and blanks; "column 3": no name
  std::string unit_in_row;  ///< from a row of units; empty: none
  std::string unit;     ///< as written in the header, the row of units or the cells; empty: none
  bool is_time{false};  ///< a part of the time
  std::vector<std::string_view> fields;  ///< by row, without quotes and blanks

  [[nodiscard]] bool has_one_value() const {
    return std::ranges::all_of(fields, [&](std::string_view field) { return field == fields[0]; });
  }
};

/// Whether `value_of` each field has a value, greater than that of the field before.
template <typename ValueOf>
[[nodiscard]] bool increases(const TextColumn& column, ValueOf value_of) {
  std::optional<double> last;
  return std::ranges::all_of(column.fields, [&](std::string_view field) {
    const std::optional<double> value = value_of(field);
    return value && value > std::exchange(last, value);
  });
}

struct TextTable {
  TextTable(const ColumnMap& column_map, ProblemList& problem_list)
      : map(column_map), problems(problem_list) {}

  const ColumnMap& map;
  ProblemList& problems;
  std::string text;  ///< UTF-8; storage of the fields
  std::vector<TextColumn> columns;
  std::vector<int> lines;       ///< line number of each row, counted from 1
  std::vector<int> references;  ///< lines of an export's comments "command reference"
  int header_line{0};
  bool has_header{false};
  bool has_unit_row{false};
  bool has_own_names{false};  ///< it comes from a form whose names are ours
  char separator{','};
  NumberForm form;
  std::vector<std::string> notes;  ///< how it was read, and text skipped around it
  std::deque<std::string> joined;  ///< storage of fields made of a value and its unit

  [[nodiscard]] std::size_t rows() const noexcept { return lines.size(); }
  /// The number in a field; nullopt: none.
  [[nodiscard]] std::optional<double> number(std::string_view field) const {
    return number_of(field, form);
  }
  /// First column of that name; the number of columns: none.
  [[nodiscard]] std::size_t find(std::string_view header) const;

  void refuse_field(std::size_t row, std::size_t column, std::string rule) const;
  void refuse_column(std::size_t column, std::string rule) const;
  void refuse_map(std::string key, std::string_view value, std::string rule) const {
    problems.add({map.file, 0, std::move(key), std::string(value), std::move(rule)});
  }
};

/// The separator is the one of `;`, tab, `,`, `|` and blank that gives rows of equal length with
/// mostly numbers or times. The header precedes the first row of values, possibly with a row of
/// units between; title lines may precede it, and comments may be anywhere.
[[nodiscard]] TextTable read_text_table(PlainTable plain, const ColumnMap& map,
                                        ProblemList& problems);

}  // namespace thermocomp
