/// A table of text as other programs write it, before anything is known of its columns.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/problem_list.hpp"

namespace thermocomp {

struct TextTable {
  std::string text;                 ///< in UTF-8; what the fields point into
  std::vector<std::string> header;  ///< without quotes and blanks around them; "column 3": no name
  std::vector<std::string> units;   ///< from a row of units; empty: there is none
  bool has_header{false};
  int header_line{0};
  std::vector<std::string_view> fields;  ///< shape (rows, columns), without quotes and blanks
  std::vector<int> lines;                ///< of each row, counted from 1
  char separator{','};
  std::vector<std::string> notes;  ///< what was left out around the table

  [[nodiscard]] std::size_t columns() const noexcept { return header.size(); }
  [[nodiscard]] std::size_t rows() const noexcept { return lines.size(); }
  [[nodiscard]] std::string_view field(std::size_t row, std::size_t column) const {
    return fields[row * columns() + column];
  }
  /// Without the columns for which `leaves` is true.
  void leave_out(const std::vector<bool>& leaves);
};

/// The separator is that of `;`, tab, `,`, `|` and blanks by which the rows have the same number of
/// fields and most of these are numbers or times. The header is above the first row of values; a
/// row of units may stand between, lines of a title above, and comments anywhere.
/// @param map  may be nullptr
/// @param lines_above  of the file, in front of `text`
[[nodiscard]] TextTable read_text_table(std::string text, const ColumnMap* map, int lines_above,
                                        ProblemList& problems);

/// The name of a separator in a ColumnMap's file: "tab" or the character.
[[nodiscard]] std::string separator_name(char separator);

/// "column 3": what a column without a name is called.
[[nodiscard]] std::string unnamed(std::size_t column);
[[nodiscard]] bool is_unnamed(std::string_view header);

}  // namespace thermocomp
