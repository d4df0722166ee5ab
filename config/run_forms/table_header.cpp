#include "config/run_forms/table_header.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_name.hpp"
#include "config/run_forms/time_stamp.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t header_rows_max = 10;

/// Kinds of values in a row of types, and statistics of a column.
constexpr auto type_words = std::to_array<std::string_view>(
    {"smp", "avg", "std", "tot", "string", "text", "double", "float", "real", "int", "integer",
     "long", "bool", "boolean", "datetime"});
constexpr auto statistic_words =
    std::to_array<std::string_view>({"min", "max", "mean", "average", "minimum", "maximum",
                                     "mittelwert", "lower limit", "upper limit"});

/// The kind of each column in the lower half of the lines.
std::vector<FieldKind> column_kinds(const std::vector<TableFields>& lines, std::size_t begin,
                                    std::size_t columns) {
  std::vector<std::array<std::size_t, 4>> counts(columns);
  for (std::size_t i = (begin + lines.size()) / 2; i < lines.size(); ++i)
    for (std::size_t k = 0; k < columns && lines[i].size() == columns; ++k)
      ++counts[k][static_cast<std::size_t>(kind_of_field(lines[i][k]))];
  std::vector<FieldKind> kinds;
  for (const auto& [texts, nothing, numbers, times] : counts)
    kinds.push_back(times > texts + numbers                   ? FieldKind::time
                    : numbers >= texts + times && numbers > 0 ? FieldKind::number
                                                              : FieldKind::text);
  return kinds;
}

/// The column that tells rows from other lines: the first of times, else the first of numbers.
std::optional<std::size_t> key_column(const std::vector<FieldKind>& kinds) {
  for (const FieldKind kind : {FieldKind::time, FieldKind::number})
    if (const auto found = std::find(kinds.begin(), kinds.end(), kind); found != kinds.end())
      return static_cast<std::size_t>(found - kinds.begin());
  return std::nullopt;
}

/// Names of columns that are not a quantity: time stamp, record number.
bool is_word_of_logger(std::string_view field) {
  return field == "TS" || field == "RN" || field == "NO." || field == "Time";
}

/// A row of units has more units than other fields.
bool is_row_of_units(const TableFields& fields) {
  std::size_t known = 0;
  std::size_t other = 0;
  for (const std::string_view field : fields) {
    if (field.empty() || field == "-") continue;
    ++(is_word_of_logger(field) || spelled_unit(unit_in_row(field)) != nullptr ? known : other);
  }
  return known > other;
}

bool is_row_of_types(const TableFields& fields) {
  return std::all_of(fields.begin(), fields.end(), [](std::string_view field) {
    return field.empty() || is_one_of(type_words, field.substr(0, field.find(':')));
  });
}

/// Channel numbers, 1 2 3, or the statistics of each column.
bool is_known_row_of_numbers(const TableFields& fields) {
  if (is_one_of(statistic_words, fields[0].substr(0, fields[0].find_first_of(".:")))) return true;
  std::vector<double> numbers;
  for (const std::string_view field : fields) {
    if (kind_of_field(field) == FieldKind::time) return false;
    if (looks_like_number(field)) numbers.push_back(finite_number(field).value_or(NAN));
  }
  return numbers.size() > 1 && (numbers[0] == 0 || numbers[0] == 1) &&
         std::adjacent_find(numbers.begin(), numbers.end(),
                            [](double a, double b) { return !(b == a + 1); }) == numbers.end();
}

/// Whether the key column has its kind, or is missing in a line without any word.
bool may_be_row(const TableFields& fields, const std::vector<FieldKind>& kinds, std::size_t key) {
  if (fields.size() != kinds.size()) return false;
  const FieldKind here = kind_of_field(fields[key]);
  if (here != FieldKind::nothing) return here == kinds[key];
  return kinds[key] == FieldKind::number && !is_all_words(fields) &&
         !is_known_row_of_numbers(fields) &&
         std::none_of(fields.begin(), fields.end(), [](std::string_view field) {
           return kind_of_field(field) == FieldKind::text;
         });
}

/// Whether also half of the numbers are there.
bool is_row(const TableFields& fields, const std::vector<FieldKind>& kinds, std::size_t key) {
  if (!may_be_row(fields, kinds, key)) return false;
  std::ptrdiff_t alike = 0;
  for (std::size_t k = 0; k < kinds.size(); ++k)
    if (kinds[k] == FieldKind::number && kind_of_field(fields[k]) == FieldKind::number) ++alike;
  return 2 * alike >= std::count(kinds.begin(), kinds.end(), FieldKind::number);
}

/// The first row, with those before it whose values are missing.
std::size_t first_row(const std::vector<TableFields>& lines, std::size_t begin,
                      const std::vector<FieldKind>& kinds) {
  const auto key = key_column(kinds);
  if (!key) return std::min(begin + 1, lines.size());
  for (const auto& is : {is_row, may_be_row}) {
    std::size_t row = begin;
    while (row < lines.size() && !is(lines[row], kinds, *key)) ++row;
    if (row == lines.size()) continue;
    while (row > begin && may_be_row(lines[row - 1], kinds, *key)) --row;
    return row;
  }
  return std::min(begin + 1, lines.size());
}

/// 1 0.1 0.1 below a row of units.
bool may_be_factors(const TableFields& fields) {
  constexpr std::array powers{0.001, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0};
  bool all_one = true;
  for (const std::string_view field : fields) {
    const auto number = finite_number(field);
    if (!number || std::find(powers.begin(), powers.end(), *number) == powers.end()) return false;
    all_one = all_one && *number == 1.0;
  }
  return !all_one;
}

/// "Scale,0.1,0.1" above the names.
bool is_named_row_of_factors(const TableFields& fields) {
  constexpr auto names = std::to_array<std::string_view>(
      {"scale", "scaling", "factor", "gain", "multiplier", "skalierung", "faktor"});
  if (fields.empty() || !is_one_of(names, fields[0])) return false;
  return std::any_of(fields.begin() + 1, fields.end(), [](std::string_view field) {
    const auto number = finite_number(field);
    return number && *number != 1.0;
  });
}

bool names_time_or_unit(const TableFields& fields) {
  return std::any_of(fields.begin(), fields.end(), [](std::string_view field) {
    return names_time(field) || !unit_of_time_name(field).empty() ||
           spelled_name(field).known != nullptr;
  });
}

bool holds_time(const TableFields& fields) {
  return std::any_of(fields.begin(), fields.end(), [](std::string_view field) {
    return kind_of_field(field) == FieldKind::time;
  });
}

/// Finds names and units above the first row.
void find_names(const std::vector<TableFields>& lines, std::size_t columns, TableHeader& header) {
  bool is_found = false;
  for (std::size_t up = 1; up <= std::min(header.row_begin, header_rows_max); ++up) {
    const std::size_t i = header.row_begin - up;
    const TableFields& fields = lines[i];
    if (fields.size() != columns) {
      // Names of another count: one too few is explained, others are refused.
      if (!header.names && is_all_words(fields)) header.names = i;
      return;
    }
    if (is_row_of_units(fields) && i > 0) {
      if (!header.units) header.units = i;
      continue;
    }
    const std::size_t named =
        columns - static_cast<std::size_t>(std::count(fields.begin(), fields.end(), ""));
    const bool has_names = named >= 2 || 2 * named >= columns;
    if (is_found || !has_names || holds_time(fields) || is_row_of_types(fields)) continue;
    is_found = names_time_or_unit(fields);
    if (is_found || (!header.names && is_all_words(fields))) header.names = i;
  }
}

}  // namespace

FieldKind kind_of_field(std::string_view field) {
  if (is_missing(field)) return FieldKind::nothing;
  if (looks_like_number(field)) return FieldKind::number;
  return parse_time_stamp(field) ? FieldKind::time : FieldKind::text;
}

bool is_all_words(const TableFields& fields) {
  return std::none_of(fields.begin(), fields.end(), [](std::string_view field) {
    const FieldKind kind = kind_of_field(field);
    return kind == FieldKind::number || kind == FieldKind::time;
  });
}

std::string_view unit_in_row(std::string_view field) {
  if (is_word_of_logger(field)) return {};
  const bool has = field.size() > 2 && (field.front() == '[' || field.front() == '(');
  return has ? trimmed(field.substr(1, field.size() - 2)) : field;
}

TableHeader find_table_header(const std::vector<TableFields>& lines, std::size_t begin,
                              std::size_t columns, bool is_first) {
  TableHeader header;
  header.row_begin = first_row(lines, is_first ? 1 : begin, column_kinds(lines, begin, columns));
  if (is_first) {
    header.names = 0;
    for (std::size_t i = 1; i < header.row_begin; ++i)
      if (lines[i].size() == columns && is_row_of_units(lines[i])) header.units = i;
  } else {
    find_names(lines, columns, header);
  }
  if (!header.names && header.row_begin > 0 && lines[header.row_begin - 1].size() == columns &&
      !is_all_words(lines[header.row_begin - 1]))
    header.unclear = header.row_begin - 1;
  if (!header.names) return header;
  for (std::size_t i = 0; i < *header.names; ++i)
    if (is_named_row_of_factors(lines[i])) header.unclear = i;
  for (std::size_t i = *header.names + 1; i < header.row_begin; ++i)
    if (!header.unclear && !is_all_words(lines[i]) && i != header.units &&
        !is_known_row_of_numbers(lines[i]))
      header.unclear = i;
  if (header.units && header.row_begin + 1 < lines.size() &&
      may_be_factors(lines[header.row_begin]) && !may_be_factors(lines[header.row_begin + 1]))
    header.unclear = header.row_begin;
  return header;
}

}  // namespace thermocomp
