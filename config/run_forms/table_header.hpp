/// Finds the header of a text table.
#pragma once

#include <optional>
#include <string_view>
#include <vector>

namespace thermocomp {

enum class FieldKind { text, nothing, number, time };
[[nodiscard]] FieldKind kind_of_field(std::string_view field);

using TableFields = std::vector<std::string_view>;

/// Whether no field is a number or a time.
[[nodiscard]] bool is_all_words(const TableFields& fields);

/// Indices of lines.
struct TableHeader {
  std::size_t row_begin{0};            ///< first row of data
  std::optional<std::size_t> names;    ///< nullopt: none
  std::optional<std::size_t> units;    ///< a row of units below the names
  std::optional<std::size_t> unclear;  ///< factors, or numbers below the names that are no row
};

/// The header is the lowest line above the first row that names the time or a unit, else the lowest
/// one of words; it has as many fields as the rows. Lines of units, types, channel numbers and
/// statistics between it and the first row are recognised; other numbers there are unclear.
/// @param lines  the fields of the first lines
/// @param begin  the first line with `columns` fields, if names are not in line 0
/// @param is_first  the names are in line 0
[[nodiscard]] TableHeader find_table_header(const std::vector<TableFields>& lines,
                                            std::size_t begin, std::size_t columns, bool is_first);

/// The unit in a field of a row of units, without brackets; empty: none.
[[nodiscard]] std::string_view unit_in_row(std::string_view field);

}  // namespace thermocomp
