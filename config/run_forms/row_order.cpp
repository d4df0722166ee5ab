#include "config/run_forms/row_order.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "config/run_forms/column_meanings.hpp"
#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/units.hpp"

namespace thermocomp {
namespace {

constexpr std::string_view value_names =
    "|value|_value|varvalue|state|val|wert|reading|mean|messwert|";
constexpr std::size_t series_max = 1024;

struct LongForm {
  std::vector<std::size_t> names;  ///< columns whose words together name the series
  std::size_t value{0};
  std::optional<std::size_t> unit;
};

/// The columns of a table that may be parts of a long one.
struct LongColumns {
  std::vector<std::size_t> words;  ///< columns of recurring words
  std::vector<std::size_t> one_word;
  std::vector<std::size_t> numbers;
  std::vector<std::size_t> values;  ///< columns called value
  std::optional<std::size_t> unit;
};

LongColumns long_columns(const TextTable& table) {
  LongColumns found;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const TextColumn& column = table.columns[i];
    if (column.is_time) continue;
    const auto is_empty = [](std::string_view field) { return field.empty(); };
    const auto empty = std::ranges::count_if(column.fields, is_empty);
    const bool are_numbers = 2 * std::ranges::count_if(column.fields, looks_like_number) >
                             std::ssize(column.fields) - empty;
    std::set<std::string_view> distinct;
    for (const std::string_view field : column.fields)
      if (distinct.size() <= series_max) distinct.insert(field);
    if (parse_time_stamp(column.fields[0])) continue;  // another time
    const bool named_value = is_one_of(value_names, column.header);
    if (named_value) found.values.push_back(i);
    if (!are_numbers && empty == 0 && distinct.size() == 1) found.one_word.push_back(i);
    if (names_units(column.header)) {
      found.unit = i;
    } else if (are_numbers || named_value) {
      // A number for each series, such as InfluxDB's "table", is not a value.
      if (distinct.size() > 1 || named_value) found.numbers.push_back(i);
    } else if (empty == 0 && distinct.size() > 1 && 2 * distinct.size() <= table.rows() &&
               distinct.size() <= series_max && bad_rows(column).empty() &&
               !table.map.ignores(column.header)) {
      found.words.push_back(i);
    }
  }
  return found;
}

std::string series_of(const TextTable& table, std::size_t row,
                      const std::vector<std::size_t>& names) {
  std::string name;
  for (const std::size_t column : names)
    name.append(name.empty() ? "" : " ").append(table.columns[column].fields[row]);
  return name;
}

/// Whether a word differs from the one before in most rows, as those of devices that are polled one
/// after the other.
bool alternates(const TextColumn& column) {
  std::ptrdiff_t changes = 0;
  for (std::size_t row = 1; row < column.fields.size(); ++row)
    if (column.fields[row] != column.fields[row - 1]) ++changes;
  return 2 * changes > std::ssize(column.fields);
}

void ask_for_devices(const TextTable& table, const std::vector<std::size_t>& columns) {
  for (const std::size_t i : columns) {
    if (!alternates(table.columns[i])) continue;
    table.refuse_column(i, "alternates, and may say which device a row is of: " +
                               pivot_or_ignore(table.columns[i].header));
    return;
  }
}

std::optional<LongForm> mapped_form(const TextTable& table, const LongColumns& found) {
  std::vector<std::size_t> columns;
  for (const std::string& name : table.map.pivot) {
    columns.push_back(table.find(name));
    if (columns.back() < table.columns.size()) continue;
    table.refuse_map("pivot", name, "must be a column of the run file");
    return std::nullopt;
  }
  const auto& numbers = found.values.size() == 1 ? found.values : found.numbers;
  if (columns.size() == 1 && numbers.size() != 1) {
    table.refuse_map("pivot", table.map.pivot[0],
                     "must name the column of the values too: pivot = [" +
                         toml_text(table.map.pivot[0]) + ", \"its name\"]");
    return std::nullopt;
  }
  return LongForm{{columns[0]}, columns.size() == 2 ? columns[1] : numbers[0], found.unit};
}

/// Keeps only the column of words by which each series has a time only once, if there is one.
void keep_needed_names(const TextTable& table, const std::vector<double>& time_s, LongForm& form) {
  for (const std::size_t column : form.names) {
    std::set<std::pair<std::string_view, double>> seen;
    std::size_t row = 0;
    while (row < table.rows() &&
           seen.emplace(table.columns[column].fields[row], time_s[row]).second)
      ++row;
    if (row < table.rows()) continue;
    form.names = {column};
    return;
  }
}

std::optional<LongForm> long_form(const TextTable& table, const std::vector<double>& time_s) {
  LongColumns found = long_columns(table);
  if (!table.map.pivot.empty()) return mapped_form(table, found);
  const auto header = [&](std::size_t column) { return table.columns[column].header; };
  const bool has_number = found.numbers.size() == 1;
  LongForm form{found.words, has_number ? found.numbers[0] : 0, found.unit};
  for (std::vector<std::size_t>* names : {&form.names, &found.one_word})
    std::stable_partition(names->begin(), names->end(),
                          [&](std::size_t column) { return names_series(header(column)); });
  // A single series has the same name in all rows.
  if (form.names.empty() && found.values.size() == 1)
    for (const std::size_t i : found.one_word)
      if (form.names.empty() && i != found.values[0] && i != form.unit) form.names = {i};
  // One row per axis, as in a log of corrections; each tool has its own.
  for (std::size_t i = 0; has_number && i < table.columns.size(); ++i) {
    if (table.columns[i].is_time || !std::ranges::all_of(table.columns[i].fields, is_axis_letter))
      continue;
    std::erase(form.names, i);
    form.names.insert(form.names.begin(), i);
    return form;
  }
  if (form.names.empty()) return std::nullopt;
  const bool is_ordered =
      std::ranges::adjacent_find(time_s, std::greater_equal<>()) == time_s.end() ||
      std::ranges::adjacent_find(time_s, std::less_equal<>()) == time_s.end();
  if (has_number && !table.has_header && is_ordered) {
    table.refuse_field(0, form.names[0],
                       "may say what the number of a row is: write pivot = [" +
                           toml_text(header(form.names[0])) + "] in the file of --columns, or " +
                           ignore_column(header(form.names[0])) +
                           " if all numbers are of one sensor");
    return std::nullopt;
  }
  const auto named = std::ranges::find_if(form.names, names_series, header);
  const bool is_named = named != form.names.end();
  if (found.values.size() == 1) {
    form.value = found.values[0];
  } else if (!has_number || (!is_named && is_ordered)) {
    if (is_named && !found.numbers.empty())
      table.problems.add(
          table.header_line, header(*named), table.columns[*named].fields[0],
          "names the sensor of a row, whose values are in several columns: write pivot = [" +
              toml_text(header(*named)) + ", " + toml_text(header(found.numbers[0])) +
              "] to read one of them, or " + ignore_column(header(*named)) +
              " if all rows are of one sensor");
    else if (!found.numbers.empty())
      ask_for_devices(table, form.names);
    return std::nullopt;
  }
  keep_needed_names(table, time_s, form);
  return form;
}

class Pivot {
 public:
  Pivot(TextTable& table, std::vector<double>& time_s, const LongForm& form)
      : table_(table), time_s_(time_s), form_(form), bad_(table.rows()) {
    const std::string& header = table.columns[form.value].header;
    unit_ = spelled_name(header).unit;
    if (unit_.empty()) unit_ = unit_of(header).symbol;
  }

  void run() {
    find_others();
    find_times();
    lines_.assign(times_.size(), 0);
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      if (is_switching(row)) continue;
      const std::string series = series_of(table_, row, form_.names);
      if (!index_.contains(series) && wide_.size() == series_max) {
        table_.problems.add(table_.lines[row], table_.columns[form_.names[0]].header, series,
                            "must be one of at most " + std::to_string(series_max) + " series");
        return;
      }
      add(row, series);
    }
    note();
    table_.columns = std::move(wide_);
    table_.lines = std::move(lines_);
    time_s_ = std::move(times_);
  }

 private:
  /// The columns that are left out, and the rows that one of them calls bad.
  void find_others() {
    for (std::size_t i = 0; i < table_.columns.size(); ++i) {
      if (table_.columns[i].is_time || i == form_.value || i == form_.unit ||
          std::ranges::find(form_.names, i) != form_.names.end())
        continue;
      others_.push_back(i);
      const std::vector<bool> here = bad_rows(table_.columns[i]);
      for (std::size_t row = 0; row < here.size(); ++row) bad_[row] = bad_[row] || here[row];
    }
  }

  /// WinCC: the archive was switched on or off.
  [[nodiscard]] bool is_switching(std::size_t row) const {
    return table_.columns[form_.names[0]].fields[row].starts_with("$RT_");
  }

  /// The rows of the wide table.
  void find_times() {
    for (std::size_t row = 0; row < time_s_.size(); ++row)
      if (!is_switching(row)) row_of_.emplace(time_s_[row], 0);
    for (auto& [at, row] : row_of_) {
      if (times_.empty() || at - times_.back() > table_.map.scan_s) times_.push_back(at);
      row = times_.size() - 1;
    }
  }

  void add(std::size_t row, const std::string& series) {
    const TextColumn& values = table_.columns[form_.value];
    const auto [found, is_new] = index_.emplace(series, wide_.size());
    if (is_new) wide_.push_back({series, "", "", false, {}});
    TextColumn& column = wide_[found->second];
    column.fields.resize(times_.size());
    const std::string_view unit = form_.unit ? table_.columns[*form_.unit].fields[row] : unit_;
    if (column.unit_in_row.empty()) column.unit_in_row = unit;
    std::string_view value = bad_[row] ? std::string_view() : values.fields[row];
    if (unit != column.unit_in_row && !unit.empty() && looks_like_number(value))
      value = table_.joined.emplace_back(std::string(value) + " " + std::string(unit));
    const std::size_t at = row_of_.at(time_s_[row]);
    std::string_view& cell = column.fields[at];
    if (!cell.empty() && cell != value)
      table_.problems.add(table_.lines[row], series, value,
                          (table_.map.scan_s > 0
                               ? "must be there once within scan_s; an earlier row has "
                               : "must be there once at a time; an earlier row of that time has ") +
                              shortened(cell));
    cell = value;
    if (lines_[at] == 0) lines_[at] = table_.lines[row];
  }

  void note() {
    const auto quoted = [&](std::size_t i) { return "'" + table_.columns[i].header + "'"; };
    std::string text = "a row per value: " + quoted(form_.names[0]);
    for (std::size_t i = 1; i < form_.names.size(); ++i) text += " and " + quoted(form_.names[i]);
    text += " names the series, " + quoted(form_.value) + " is the value; " +
            std::to_string(wide_.size()) + " columns";
    for (const std::size_t column : others_) text += ", " + quoted(column) + " left out";
    if (const auto count = std::ranges::count(bad_, true); count > 0)
      text += "; bad quality, hence missing: " + std::to_string(count) + " values";
    bool has_complete_row = false;
    for (std::size_t row = 0; row < times_.size() && !has_complete_row; ++row)
      has_complete_row = std::ranges::none_of(
          wide_, [row](const TextColumn& column) { return column.fields[row].empty(); });
    if (!has_complete_row)
      text +=
          "; no row has a value of each: if they are read one after the other, write scan_s = "
          "(seconds from the first to the last) in the file of --columns";
    table_.notes.push_back(text);
  }

  TextTable& table_;
  std::vector<double>& time_s_;
  const LongForm& form_;
  std::string unit_;  ///< of the value's name; a column of units comes first
  std::vector<std::size_t> others_;
  std::vector<bool> bad_;
  std::map<double, std::size_t> row_of_;  ///< of the wide table, by time
  std::vector<double> times_;
  std::map<std::string, std::size_t> index_;
  std::vector<TextColumn> wide_;
  std::vector<int> lines_;
};

/// Summer time begins and ends before 3 o'clock on a Sunday of March, April, September, October or
/// November.
bool may_be_clock_change(double wall_s) {
  const auto hour = static_cast<int>(std::floor(wall_s / 3600.0));
  const auto days = std::chrono::floor<std::chrono::days>(std::chrono::hours{hour});
  const std::chrono::sys_days day{days};
  const auto month = static_cast<unsigned>(std::chrono::year_month_day{day}.month());
  return std::chrono::weekday{day} == std::chrono::Sunday && hour - 24 * days.count() < 3 &&
         (month == 3 || month == 4 || (month >= 9 && month <= 11));
}

/// Follows a local clock that is set forward by an hour in a night of spring, and back in autumn,
/// while the rows continue.
void follow_summer_time(TextTable& table, RunTime& time) {
  constexpr double hour_s = 3600.0;
  constexpr double steps_max = 3.0;
  if (!time.wall_zero || time.wall_zero->is_utc) return;
  std::vector<double>& time_s = time.time_s;
  double added_s = 0.0;
  double step_s = 0.0;  // between the two rows before
  double last = time_s.front();
  for (std::size_t row = 1; row < time_s.size(); ++row) {
    const double now = time_s[row];
    const double before_s = std::exchange(step_s, now - last);
    const double wall_s = time.wall_zero->seconds + last;
    const double hours = std::floor((wall_s + step_s) / hour_s) - std::floor(wall_s / hour_s);
    const double change_s = step_s <= 0.0 ? hour_s : -hour_s;
    const bool is_change = step_s <= 0.0 || (hours == 2.0 && steps_max * before_s <= hour_s);
    if (is_change && step_s + change_s > 0.0 && step_s + change_s <= steps_max * before_s &&
        may_be_clock_change(wall_s)) {
      added_s += change_s;
      step_s += change_s;
      const bool is_back = change_s > 0.0;
      table.notes.push_back(std::string("summer time: the clock was set ") +
                            (is_back ? "back" : "forward") + " by an hour before line " +
                            std::to_string(table.lines[row]) + ": an hour is " +
                            (is_back ? "added" : "taken off") + " from there on");
    }
    last = now;
    time_s[row] += added_s;
  }
}

void count_from_first(RunTime& time) {
  const double first = time.time_s.front();
  for (double& at : time.time_s) at -= first;
  if (time.wall_zero) time.wall_zero->seconds += first;
}

void turn_rows(TextTable& table, RunTime& time) {
  std::ranges::reverse(time.time_s);
  count_from_first(time);
  std::ranges::reverse(table.lines);
  for (TextColumn& column : table.columns) std::ranges::reverse(column.fields);
  table.notes.emplace_back("the newest row is first: order reversed");
}

/// Whether a column could name the series of a row's value.
bool has_text(const TextTable& table, std::size_t row) {
  return std::ranges::any_of(table.columns, [row](const TextColumn& column) {
    return !column.is_time && is_text(column) && !column.fields[row].empty();
  });
}

/// Remedy for a time that is not later than that of the previous row.
std::string remedy(const TextTable& table, const std::vector<double>& time_s, std::size_t row) {
  if (has_text(table, row))
    return "for one row per value write pivot = \"the column that names the series\" in the file "
           "of --columns";
  if (time_s[row] == time_s[row - 1])
    return "delete one of the two lines, or write the time with its fraction of a second";
  if (row == 1 && table.lines[0] < table.lines[1])
    return "delete line " + std::to_string(table.lines[0]) +
           " if it belongs to the header, or put the rows in the order of time";
  return "put the rows in the order of time; where the clock was set or the logger began anew, "
         "give the lines from this one on a file of their own";
}

/// Leaves out rows that were sent twice.
void leave_repeated_rows_out(TextTable& table, std::vector<double>& time_s) {
  const auto repeats = [&](std::size_t row) {
    return time_s[row] == time_s[row - 1] &&
           std::ranges::all_of(table.columns, [row](const TextColumn& column) {
             return column.fields[row] == column.fields[row - 1];
           });
  };
  std::size_t kept = 1;
  for (std::size_t row = 1; row < time_s.size(); ++row) {
    if (repeats(row)) continue;
    time_s[kept] = time_s[row];
    table.lines[kept] = table.lines[row];
    for (TextColumn& column : table.columns) column.fields[kept] = column.fields[row];
    ++kept;
  }
  if (kept == time_s.size()) return;
  table.notes.push_back("rows that repeat the one before left out: " +
                        std::to_string(time_s.size() - kept));
  time_s.resize(kept);
  table.lines.resize(kept);
  for (TextColumn& column : table.columns) column.fields.resize(kept);
}

}  // namespace

void order_rows(TextTable& table, RunTime& time, const TimeColumns& columns) {
  std::vector<double>& time_s = time.time_s;
  leave_repeated_rows_out(table, time_s);
  std::size_t column = columns.columns.empty() ? 0 : columns.columns.back();
  if (const auto form = long_form(table, time_s)) {
    Pivot(table, time_s, *form).run();
    if (!table.problems.empty()) return;
    if (time_s.front() < 0) count_from_first(time);
    column = 0;
    read_units(table);
  } else {
    join_units(table);
    read_units(table);
    leave_bad_values_out(table);
  }
  std::ptrdiff_t falling = 0;
  for (std::size_t row = 1; row < time_s.size(); ++row)
    falling += (time_s[row] < time_s[row - 1] ? 1 : 0) - (time_s[row] > time_s[row - 1] ? 1 : 0);
  if (falling > 0) turn_rows(table, time);
  follow_summer_time(table, time);
  const auto at = std::ranges::adjacent_find(time_s, [](double a, double b) { return !(b > a); });
  if (at == time_s.end()) return;
  const auto row = static_cast<std::size_t>(at - time_s.begin()) + 1;
  table.refuse_field(row, column,
                     "must be later than in line " + std::to_string(table.lines[row - 1]) + " (" +
                         shortened(table.columns[column].fields[row - 1]) +
                         "): " + remedy(table, time_s, row));
}

}  // namespace thermocomp
