#include "config/run_forms/foreign_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <utility>

#include "config/run_forms/column_meanings.hpp"
#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/number_form.hpp"
#include "config/run_forms/row_order.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_lines.hpp"
#include "config/run_forms/text_table.hpp"
#include "config/run_forms/time_column.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

/// Usual words for a missing value, in lower case.
constexpr std::string_view missing_words =
    "|na|n/a|#n/a|#nv|null|none|inf|ol|open|overflow|overload|burnout|burn out|unavailable"
    "|unknown|err|error|fault|no data|bad|invalid|#div/0!|#value!|undef|n.a.|disconnected|over"
    "|under|overrange|over range|underrange|under range|\\n|no value|nodata|logged|nan|";

/// Those words, perhaps with a sign, or a field of signs only: "--.-", "+OVER", "#####".
bool is_word_for_missing(std::string_view field) {
  const bool is_signs = std::ranges::all_of(
      field, [](char c) { return std::string_view("-.*#?+_ ").find(c) != std::string_view::npos; });
  if (field.starts_with('+') || field.starts_with('-')) field.remove_prefix(1);
  return is_signs || is_one_of(missing_words, field);
}

/// A temperature below is a fault code, such as -9999.
constexpr double degC_min = -273.15;
constexpr double degC_max = 2500.0;

/// A separator at the end of every line does not make a column.
void leave_empty_columns_out(TextTable& table) {
  std::erase_if(table.columns, [](const TextColumn& column) {
    return is_unnamed(column.header) &&
           std::ranges::all_of(column.fields, [](std::string_view field) { return field.empty(); });
  });
}

/// A time for each channel is needed only once if all are the same.
void leave_repeated_times_out(TextTable& table) {
  for (std::size_t i = table.columns.size(); i-- > 1;) {
    const TextColumn& column = table.columns[i];
    const auto end = table.columns.begin() + static_cast<std::ptrdiff_t>(i);
    const auto is_same = [&](const TextColumn& earlier) {
      return spelled_name(earlier.header).base == spelled_name(column.header).base &&
             earlier.fields == column.fields;
    };
    if (!names_time(column.header) || std::none_of(table.columns.begin(), end, is_same)) continue;
    table.notes.push_back("'" + column.header + "' left out: repeats the time");
    table.columns.erase(end);
  }
}

/// Replaces columns of year, month, day, hour, minute and perhaps second by one of time stamps.
void join_calendar(TextTable& table) {
  constexpr std::array<std::string_view, 6> names{"|year|jahr|",  "|month|monat|",
                                                  "|day|tag|",    "|hour|stunde|",
                                                  "|minute|min|", "|second|sekunde|sec|"};
  constexpr std::string_view signs = "-- :: ";
  std::size_t begin = 0;
  while (begin < table.columns.size() && !is_one_of(names[0], table.columns[begin].header)) ++begin;
  std::size_t parts = 0;
  while (parts < names.size() && begin + parts < table.columns.size() &&
         is_one_of(names[parts], table.columns[begin + parts].header))
    ++parts;
  if (parts < 5 || !table.map.time.empty()) return;
  TextColumn joined;
  joined.header = "time";
  for (std::size_t row = 0; row < table.rows(); ++row) {
    std::string& stamp = table.joined.emplace_back();
    for (std::size_t i = 0; i < parts; ++i)
      stamp.append(table.columns[begin + i].fields[row]).append(i + 1 < parts ? 1 : 0, signs[i]);
    joined.fields.push_back(stamp);
  }
  const auto first = table.columns.begin() + static_cast<std::ptrdiff_t>(begin);
  *first = std::move(joined);
  table.columns.erase(first + 1, first + static_cast<std::ptrdiff_t>(parts));
}

void note_layout(TextTable& table, std::vector<std::string> notes, bool from_latin1) {
  const char sign = table.separator;
  const std::string separator = sign == '\t' ? "tab" : sign == ' ' ? "blank" : std::string(1, sign);
  std::string note =
      "separator '" + separator + "', decimal " + (table.form.decimal == ',' ? "comma" : "point");
  if (table.form.thousands != '\0')
    note += std::string(", thousands '") + table.form.thousands + "'";
  if (from_latin1) note += ", letters Latin-1";
  if (table.has_unit_row) note += ", units in a row of their own";
  if (!table.has_header) note += ", no header";
  notes.push_back(note);
  table.notes.insert(table.notes.begin(), notes.begin(), notes.end());
}

class ValueReader {
 public:
  explicit ValueReader(const TextTable& table) : table_(table) {}

  std::vector<double> read(const ColumnMeaning& meaning) {
    const std::string_view suffix = unit_of(meaning.name).suffix;
    std::vector<double> values;
    values.reserve(table_.rows());
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string_view field = meaning.source->fields[row];
      const NumberText parts = number_text_of(field);
      std::optional<double> number = table_.number(parts.digits);
      const bool missing = takes_as_missing(field, number);
      if (missing) number.reset();
      if (number && parts.unit != nullptr)
        number = in_unit_of_column(*meaning.source, *number, *parts.unit);
      if (!number && suffix == "_on") number = switch_word(field);
      if (!number && !missing) ask_for_word(row, *meaning.source);
      double value = number.value_or(not_a_number);
      if (!meaning.conversion.is_identity())
        value = meaning.conversion.factor * value + meaning.conversion.offset;
      if (std::isinf(value)) value = not_a_number;
      if (suffix == "_degC" && (value < degC_min || value > degC_max)) {
        is_impossible_ = is_impossible_ || words_.empty();
        ask_for_word(row, *meaning.source);
      }
      values.push_back(value);
    }
    return values;
  }

  /// One problem for all words that are not numbers, and for impossible temperatures.
  void ask_for_words() const {
    if (words_.empty()) return;
    constexpr std::size_t words_max = 12;
    std::string list;
    std::size_t count = 0;
    for (const std::string& word : words_)
      if (count++ < words_max) list += (list.empty() ? "" : ", ") + toml_text(shortened(word));
    const std::string& header = first_column_->header;
    const std::string_view first = first_column_->fields[first_row_];
    const std::string decimal = table_.form.decimal == ',' ? "comma" : "point";
    const std::string switch_name = plain_name(spelled_name(header).base) + "_on";
    const std::string rule =
        switch_word(first)
            ? "is a switch: " + write_column(header, toml_text(switch_name))
            : (is_impossible_ ? "must be between -273.15 and 2500 degC"
                              : "must be a number with a decimal " + decimal) +
                  ", or empty: if it means a missing value, write missing = [" + list +
                  (count > words_max ? ", ..." : "") + "], to leave the column out " +
                  ignore_column(header) + " in the file of --columns";
    table_.problems.add(table_.lines[first_row_], header, first, rule);
  }

  void note_missing(std::vector<std::string>& notes) const {
    if (missing_ > 0)
      notes.push_back("missing: " + std::to_string(missing_) + " fields like '" + missing_as_ +
                      "'");
  }

 private:
  /// Converts a cell in another unit than its column: 850 mA among A.
  static std::optional<double> in_unit_of_column(const TextColumn& column, double number,
                                                 const SpelledUnit& unit) {
    const SpelledUnit* of_column = spelled_unit(column.unit);
    if (of_column == nullptr || of_column->dimension != unit.dimension) return std::nullopt;
    if (of_column->measures_as(unit)) return number;
    return (unit.factor * number + unit.offset - of_column->offset) / of_column->factor;
  }

  void ask_for_word(std::size_t row, const TextColumn& column) {
    if (words_.empty()) {
      first_row_ = row;
      first_column_ = &column;
    }
    words_.emplace(column.fields[row]);
  }

  /// Missing: words, entries of the map, and the infinity of SCPI instruments, 9.9E37.
  bool takes_as_missing(std::string_view field, const std::optional<double>& number) {
    constexpr double overload_min = 1e37;
    if (is_missing(field)) return true;
    const std::vector<std::string>& listed = table_.map.missing;
    const bool is_overload = number && std::abs(*number) >= overload_min;
    if (!is_word_for_missing(field) && !is_overload &&
        std::ranges::find(listed, field) == listed.end())
      return false;
    if (missing_++ == 0) missing_as_ = field;
    return true;
  }

  const TextTable& table_;
  std::set<std::string> words_;  ///< neither numbers nor known words for missing values
  std::size_t first_row_{0};     ///< of them
  const TextColumn* first_column_{nullptr};
  bool is_impossible_{false};  ///< the first of them is a number, but no temperature
  std::size_t missing_{0};
  std::string missing_as_;
};

}  // namespace

bool is_own_form(std::string_view header) {
  bool has_time = false;
  std::string_view field;
  while (take(header, ',', field)) {
    field = trimmed(field);
    has_time = has_time || field == "time_s";
    if (spelled_name(field).known != nullptr) return false;
  }
  return has_time;
}

RunFile read_foreign_run(std::string_view text, const std::string& name, const ColumnMap* map) {
  RunFile run;
  run.name = name;
  ProblemList problems(name);
  ColumnMap own_map = map == nullptr ? ColumnMap() : *map;
  RunText read = run_text(text, name, own_map.encoding);
  run.wall_zero = stated_wall_zero(read.text);
  PlainTable plain = plain_table(std::move(read.text), name, own_map);
  if (!run.wall_zero) run.wall_zero = stated_wall_zero(plain.text);
  if (plain.has_own_names) own_map.names.clear();  // already used by the form
  std::vector<std::string> notes = std::move(plain.notes);
  TextTable table = read_text_table(std::move(plain), own_map, problems);
  problems.throw_any();
  leave_empty_columns_out(table);
  leave_repeated_times_out(table);
  join_calendar(table);
  read_units(table);
  table.form = number_form(table);
  problems.throw_any();
  note_layout(table, std::move(notes), read.from_latin1);
  const auto columns = find_time(table);
  problems.throw_any();
  if (own_map.period_s && !columns->columns.empty() && !table.has_own_names)
    table.refuse_map("period_s", number_text(*own_map.period_s),
                     "is for a table without time; in " + name + " '" +
                         table.columns[columns->columns[0]].header + "' is the time");
  problems.throw_any();
  RunTime time = read_time(table, *columns);
  problems.throw_any();
  if (!time.wall_zero) time.wall_zero = run.wall_zero;
  order_rows(table, time, *columns);
  problems.throw_any();
  run.wall_zero = time.wall_zero;
  for (const int line : table.references) {
    const auto row = std::ranges::lower_bound(table.lines, line) - table.lines.begin();
    if (row > 0 && (run.references.empty() || std::cmp_less(run.references.back(), row)))
      run.references.push_back(static_cast<std::size_t>(row));
  }
  run.columns.emplace_back("time_s");
  run.values.push_back(std::move(time.time_s));
  ValueReader values(table);
  const std::vector<ColumnMeaning> meanings = column_meanings(table);
  problems.throw_any();
  for (const ColumnMeaning& meaning : meanings) {
    run.columns.push_back(meaning.name);
    run.values.push_back(values.read(meaning));
  }
  values.ask_for_words();
  problems.throw_any();
  values.note_missing(table.notes);
  run.understood = std::move(table.notes);
  return run;
}

}  // namespace thermocomp
