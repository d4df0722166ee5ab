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
  std::vector<std::string> header;  ///< names without quotes and blanks around them
  int header_line{0};
  std::vector<std::string_view> fields;  ///< shape (rows, columns), without quotes and blanks
  std::vector<int> lines;                ///< of each row, counted from 1
  char separator{','};
  bool from_latin1{false};

  [[nodiscard]] std::size_t columns() const noexcept { return header.size(); }
  [[nodiscard]] std::size_t rows() const noexcept { return lines.size(); }
  [[nodiscard]] std::string_view field(std::size_t row, std::size_t column) const {
    return fields[row * columns() + column];
  }
};

/// Comments, empty lines and rows of empty fields at the end are left out. The separator is that
/// of `;`, tab and `,` by which every row has as many fields as the header.
/// @param map  may be nullptr
[[nodiscard]] TextTable read_text_table(std::string_view text, const ColumnMap* map,
                                        ProblemList& problems);

/// The name of a separator in a ColumnMap's file: "tab" or the character.
[[nodiscard]] std::string separator_name(char separator);

}  // namespace thermocomp
