#include "config/run_forms/find_time.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <span>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_name.hpp"
#include "config/run_forms/time_stamp.hpp"

namespace thermocomp {
namespace {

enum class Holds { other, date, clock, both };

std::span<const std::string_view> first_fields(const TextColumn& column) {
  constexpr std::size_t rows_read = 100;
  return std::span(column.fields).first(std::min(column.fields.size(), rows_read));
}

/// The kind of content of a column's first rows, if the same in all of them. A date may be written
/// only where it changes, and with midnight.
Holds content(const TextColumn& column) {
  std::optional<Holds> holds;
  bool all_midnight = true;
  for (const std::string_view field : first_fields(column)) {
    if (field.empty() && holds == Holds::date) continue;
    const auto stamp = parse_time_stamp(field);
    if (!stamp) return Holds::other;
    const Holds here = !stamp->has_date    ? Holds::clock
                       : !stamp->has_clock ? Holds::date
                                           : Holds::both;
    if (holds && here != *holds) return Holds::other;
    holds = here;
    all_midnight = all_midnight && stamp->is_midnight();
  }
  return holds == Holds::both && all_midnight ? Holds::date : holds.value_or(Holds::other);
}

/// The numbers of a column's first rows; empty if one is not a number.
std::vector<double> first_numbers(const TextTable& table, const TextColumn& column) {
  std::vector<double> numbers;
  for (const std::string_view field : first_fields(column)) {
    const auto number = table.number(field);
    if (!number) return {};
    numbers.push_back(*number);
  }
  return numbers;
}

bool within(const std::vector<double>& numbers, double low, double high) {
  return !numbers.empty() && std::ranges::all_of(numbers, [&](double number) {
    return number >= low && number <= high && number == std::floor(number);
  });
}

/// Columns of year, day of the year and hhmm, as in arrays of Campbell loggers.
std::optional<TimeColumns> day_of_year(const TextTable& table) {
  for (std::size_t i = 0; i + 2 < std::min<std::size_t>(table.columns.size(), 6); ++i) {
    const auto numbers = [&](std::size_t k) { return first_numbers(table, table.columns[i + k]); };
    if (within(numbers(0), 1980, 2099) && within(numbers(1), 1, 366) &&
        within(numbers(2), 0, 2400) &&
        std::ranges::all_of(numbers(2), [](double hhmm) { return std::fmod(hhmm, 100.0) < 60.0; }))
      return TimeColumns{{i, i + 1, i + 2}};
  }
  return std::nullopt;
}

/// Possible time columns, by kind.
struct Candidates {
  std::vector<std::size_t> dates;   ///< with or without clock time
  std::vector<std::size_t> clocks;  ///< clock time only
  std::vector<std::size_t> epochs;
  std::vector<std::size_t> counting;  ///< numbers with a unit of time, or called time
};

/// Removes the other columns if exactly one is called time.
void keep_named(const TextTable& table, std::vector<std::size_t>& columns) {
  const auto is_named = [&](std::size_t i) { return names_time(table.columns[i].header); };
  if (std::ranges::count_if(columns, is_named) == 1) std::erase_if(columns, std::not_fn(is_named));
}

/// Drops constant dates, such as the start of a query, unless all are; of the rest keeps the one
/// called time, if there is exactly one.
void keep_moving_dates(const TextTable& table, std::vector<std::size_t>& dates) {
  if (dates.size() < 2) return;
  const auto is_constant = [&](std::size_t i) { return table.columns[i].has_one_value(); };
  if (!std::ranges::all_of(dates, is_constant)) std::erase_if(dates, is_constant);
  keep_named(table, dates);
}

/// Whether counting numbers increase, and dates do not or do not show seconds.
bool is_finer(const TextTable& table, const TextColumn& counting, const TextColumn& dates) {
  const auto number = [&](std::string_view field) { return table.number(field); };
  const auto seconds = [](std::string_view field) {
    const auto at = wall_time(field);
    return at ? std::optional(at->seconds) : std::nullopt;
  };
  if (!increases(counting, number)) return false;
  const auto first = parse_time_stamp(dates.fields[0]);
  return !increases(dates, seconds) || !first || first->clock_parts == 2;
}

Candidates candidates(const TextTable& table) {
  Candidates found;
  for (std::size_t i = 0; i < table.columns.size(); ++i) {
    const TextColumn& column = table.columns[i];
    if (table.map.uses(column.header)) continue;
    const Holds here = content(column);
    const bool is_time = time_unit(column.unit) != nullptr;
    if (here == Holds::date || here == Holds::both)
      found.dates.push_back(i);
    else if (here == Holds::clock)
      found.clocks.push_back(i);
    else if (!names_time(column.header) && unit_of_time_name(column.header).empty() && !is_time)
      continue;
    else if (epoch_of(first_numbers(table, column), names_date(column.header), is_time) != nullptr)
      found.epochs.push_back(i);
    else
      found.counting.push_back(i);
  }
  return found;
}

void refuse_two(const TextTable& table, std::size_t first, std::size_t second) {
  const std::string name = toml_text(table.columns[first].header);
  const std::string other = toml_text(table.columns[second].header);
  if (name == other)
    table.refuse_column(second,
                        "is the name of column " + std::to_string(first + 1) +
                            ", too, and both may be the time: give each a name of its own "
                            "in this line, or a file of its own to the columns of each time");
  else
    table.refuse_column(first, "may be the time, and so may " + other + ": write time = " + name +
                                   " and ignore = [" + other +
                                   "], or the other way round, in the file of --columns");
}

/// @return nullopt after a problem, too
std::optional<TimeColumns> mapped_time(const TextTable& table) {
  TimeColumns time;
  for (const std::string& name : table.map.time) {
    time.columns.push_back(table.find(name));
    if (time.columns.back() < table.columns.size()) continue;
    table.refuse_map("time", name, "must be a column of the run file");
    return std::nullopt;
  }
  return time;
}

std::optional<TimeColumns> find_clock(const TextTable& table) {
  if (!table.map.time.empty()) return mapped_time(table);
  if (const std::size_t own = table.find("time_s"); own < table.columns.size())
    return TimeColumns{{own}};
  Candidates found = candidates(table);
  keep_moving_dates(table, found.dates);
  const auto date = found.dates.size() == 1 ? std::optional(found.dates[0]) : std::nullopt;
  const bool has_clock_beside = date && content(table.columns[*date]) == Holds::date;
  if (has_clock_beside) keep_named(table, found.clocks);
  if (has_clock_beside && found.clocks.size() == 1) return TimeColumns{{*date, found.clocks[0]}};
  if (has_clock_beside && found.clocks.size() > 1) found.dates.clear();  // asked for below
  if (date && found.counting.size() == 1 &&
      is_finer(table, table.columns[found.counting[0]], table.columns[*date]))
    return TimeColumns{{found.counting[0]}, date};
  for (const auto* kind : {&found.dates, &found.epochs, &found.clocks, &found.counting}) {
    if (kind->size() == 1) return TimeColumns{{kind->front()}};
    if (kind->empty()) continue;
    refuse_two(table, (*kind)[0], (*kind)[1]);
    return std::nullopt;
  }
  if (const auto time = day_of_year(table)) return time;
  if (table.map.period_s) return TimeColumns{};
  if (!table.has_header)
    table.problems.add(table.lines.empty() ? 1 : table.lines[0], "names", "(missing)",
                       "has no header that names the time: write names = [\"time_s\", "
                       "\"t1_degC\", ...], one for each of the " +
                           std::to_string(table.columns.size()) +
                           " fields per row, in the file of --columns (of import: --names "
                           "time_s,t1_degC,...), and period_s where no field is the time");
  else
    table.problems.add(
        table.header_line, "time_s", "(missing)",
        "must be one of the columns; if another is the time, write time = \"its name\" in "
        "the file of --columns; if none is, period_s = the seconds between two rows");
  return std::nullopt;
}

/// The column behind a clock of whole seconds that is called after a unit of time, if all its
/// numbers are below a second.
void find_fraction(const TextTable& table, TimeColumns& time) {
  const std::size_t next = time.columns.back() + 1;
  if (next >= table.columns.size() || table.columns[next].is_time) return;
  const TextColumn& clocks = table.columns[next - 1];
  const TextColumn& fractions = table.columns[next];
  if (table.map.uses(fractions.header)) return;
  const std::string name = small_letters(fractions.header);
  const SpelledUnit* unit = time_unit(name == "millitm" || name == "millis" ? "ms" : name);
  if (unit == nullptr || unit->factor > 1) return;
  bool is_moving = false;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto stamp = parse_time_stamp(clocks.fields[row]);
    const auto number = table.number(fractions.fields[row]);
    if (!stamp || !stamp->has_clock || stamp->clock_c != std::floor(stamp->clock_c)) return;
    if (!number || !(*number >= 0 && unit->factor * *number < 1)) return;
    is_moving = is_moving || *number != 0;
  }
  if (!is_moving) return;
  time.fraction = next;
  time.fraction_factor = unit->factor;
}

/// A column of nothing but AM and PM, of a clock without.
void find_half(const TextTable& table, TimeColumns& time) {
  constexpr std::array<std::string_view, 2> halves{"am", "pm"};
  if (table.rows() == 0) return;
  const auto stamp = parse_time_stamp(table.columns[time.columns.back()].fields[0]);
  if (!stamp || !stamp->has_clock) return;
  for (std::size_t i = 0; i < table.columns.size() && !time.half; ++i)
    if (std::ranges::all_of(table.columns[i].fields,
                            [&](std::string_view field) { return is_one_of(halves, field); }))
      time.half = i;
}

}  // namespace

std::optional<TimeColumns> find_time(TextTable& table) {
  auto time = find_clock(table);
  if (!time) return std::nullopt;
  const auto mark = [&](std::size_t column) { table.columns[column].is_time = true; };
  std::ranges::for_each(time->columns, mark);
  if (time->columns.empty() || time->columns.size() > 2) return time;
  find_fraction(table, *time);
  find_half(table, *time);
  if (time->fraction) mark(*time->fraction);
  if (time->half) mark(*time->half);
  return time;
}

}  // namespace thermocomp
