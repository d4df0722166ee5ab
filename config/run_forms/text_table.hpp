/// A text table of another program, with its columns not yet interpreted.
#pragma once

#include <deque>
#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/problem_list.hpp"

namespace thermocomp {

struct TextTable {
  std::string text;                 ///< UTF-8; storage of the fields
  std::vector<std::string> header;  ///< without surrounding quotes and blanks; "column 3": no name
  std::vector<std::string> units;   ///< from a row of units; empty: none
  bool has_header{false};
  int header_line{0};
  std::vector<std::string_view> fields;  ///< shape (rows, columns), without quotes and blanks
  std::vector<int> lines;                ///< line number of each row, counted from 1
  char separator{','};
  std::vector<std::string> notes;  ///< text skipped around the table
  std::deque<std::string> joined;  ///< storage of fields made of a value and its unit

  [[nodiscard]] std::size_t columns() const noexcept { return header.size(); }
  [[nodiscard]] std::size_t rows() const noexcept { return lines.size(); }
  [[nodiscard]] std::string_view field(std::size_t row, std::size_t column) const {
    return fields[row * columns() + column];
  }
  /// Removes the columns for which `left_out` is true.
  void leave_out(const std::vector<bool>& left_out);
};

/// The separator is the one of `;`, tab, `,`, `|` and blank that gives rows of equal length with
/// mostly numbers or times. The header precedes the first row of values, possibly with a row of
/// units between; title lines may precede it, and comments may be anywhere.
/// @param map  may be nullptr
/// @param lines_above  lines of the file before `text`
[[nodiscard]] TextTable read_text_table(std::string text, const ColumnMap* map, int lines_above,
                                        ProblemList& problems);

/// Name of a separator in a ColumnMap's file: "tab" or the character.
[[nodiscard]] std::string separator_name(char separator);

}  // namespace thermocomp
