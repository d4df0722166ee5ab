#include "config/run_forms/find_time.hpp"

#include <algorithm>
#include <cmath>

#include "config/run_forms/number_epoch.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_name.hpp"
#include "config/run_forms/time_stamp.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t rows_read = 100;

enum class Holds { other, date, clock, both };

/// The kind of content of a column's first rows, if the same in all of them. A date may be written
/// only where it changes, and with midnight.
Holds content(const TextTable& table, std::size_t column) {
  Holds holds = Holds::other;
  bool all_midnight = true;
  for (std::size_t row = 0; row < std::min(table.rows(), rows_read); ++row) {
    if (table.field(row, column).empty() && holds == Holds::date) continue;
    const auto stamp = parse_time_stamp(table.field(row, column));
    if (!stamp) return Holds::other;
    const Holds here = !stamp->has_date    ? Holds::clock
                       : !stamp->has_clock ? Holds::date
                                           : Holds::both;
    if (row > 0 && here != holds) return Holds::other;
    holds = here;
    all_midnight = all_midnight && stamp->is_midnight();
  }
  return holds == Holds::both && all_midnight ? Holds::date : holds;
}

/// The numbers of a column's first rows; empty if one is not a number.
std::vector<double> first_numbers(const TextTable& table, std::size_t column,
                                  const NumberForm& form) {
  std::vector<double> numbers;
  for (std::size_t row = 0; row < std::min(table.rows(), rows_read); ++row) {
    const auto number = number_of(table.field(row, column), form);
    if (!number) return {};
    numbers.push_back(*number);
  }
  return numbers;
}

bool within(const std::vector<double>& numbers, double low, double high) {
  return !numbers.empty() && std::all_of(numbers.begin(), numbers.end(), [&](double number) {
    return number >= low && number <= high && number == std::floor(number);
  });
}

/// Columns of year, day of the year and hhmm, as in arrays of Campbell loggers.
std::optional<TimeColumns> day_of_year(const TextTable& table, const NumberForm& form) {
  for (std::size_t i = 0; i + 2 < std::min<std::size_t>(table.columns(), 6); ++i) {
    const std::vector<double> clock = first_numbers(table, i + 2, form);
    if (within(first_numbers(table, i, form), 1980, 2099) &&
        within(first_numbers(table, i + 1, form), 1, 366) && within(clock, 0, 2400) &&
        std::all_of(clock.begin(), clock.end(),
                    [](double hhmm) { return std::fmod(hhmm, 100.0) < 60.0; }))
      return TimeColumns{{i, i + 1, i + 2}, {}};
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
  std::vector<std::size_t> named;
  for (const std::size_t column : columns)
    if (names_time(table.header[column])) named.push_back(column);
  if (named.size() == 1) columns = named;
}

/// Drops constant dates, such as the start of a query, unless all are; of the rest keeps the one
/// called time, if there is exactly one.
void keep_moving_dates(const TextTable& table, std::vector<std::size_t>& dates) {
  if (dates.size() < 2) return;
  const auto is_constant = [&](std::size_t column) {
    for (std::size_t row = 1; row < table.rows(); ++row)
      if (table.field(row, column) != table.field(0, column)) return false;
    return true;
  };
  if (!std::all_of(dates.begin(), dates.end(), is_constant)) std::erase_if(dates, is_constant);
  keep_named(table, dates);
}

bool numbers_increase(const TextTable& table, std::size_t column, const NumberForm& form) {
  double last = -INFINITY;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto at = number_of(table.field(row, column), form);
    if (!at || !(*at > last)) return false;
    last = *at;
  }
  return true;
}

bool increases(const TextTable& table, std::size_t column) {
  double last = -INFINITY;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto stamp = parse_time_stamp(table.field(row, column));
    const auto at = stamp ? seconds_of(*stamp, DateOrder::unknown, false) : std::nullopt;
    if (!at || !(*at > last)) return false;
    last = *at;
  }
  return true;
}

/// Whether the clock of a column shows seconds.
bool has_seconds(const TextTable& table, std::size_t column) {
  const auto stamp = parse_time_stamp(table.field(0, column));
  return stamp && stamp->clock_parts != 2;
}

Candidates candidates(const TextTable& table, const ColumnMap* map,
                      const std::vector<std::string>& units, const NumberForm& form) {
  Candidates found;
  for (std::size_t i = 0; i < table.columns(); ++i) {
    const std::string& header = table.header[i];
    if (map != nullptr && map->uses(header)) continue;
    const Holds here = content(table, i);
    const SpelledUnit* unit = spelled_unit(units[i]);
    const bool is_time = unit != nullptr && unit->dimension == "time";
    const bool is_named = names_time(header) || !unit_of_time_name(header).empty() || is_time;
    if (here == Holds::date || here == Holds::both)
      found.dates.push_back(i);
    else if (here == Holds::clock)
      found.clocks.push_back(i);
    else if (!is_named)
      continue;
    else if (epoch_of(first_numbers(table, i, form), names_date(header), is_time) != nullptr)
      found.epochs.push_back(i);
    else
      found.counting.push_back(i);
  }
  return found;
}

std::optional<TimeColumns> find_clock(const TextTable& table, const ColumnMap* map,
                                      const std::vector<std::string>& units, const NumberForm& form,
                                      ProblemList& problems) {
  const auto column_of = [&](std::string_view name) {
    return static_cast<std::size_t>(std::find(table.header.begin(), table.header.end(), name) -
                                    table.header.begin());
  };
  if (map != nullptr && !map->time.empty()) {
    TimeColumns time;
    for (const std::string& name : map->time) {
      if (column_of(name) == table.columns()) {
        problems.add({map->file, 0, "time", name, "must be a column of the run file"});
        return std::nullopt;
      }
      time.columns.push_back(column_of(name));
    }
    return time;
  }
  if (column_of("time_s") < table.columns()) return TimeColumns{{column_of("time_s")}, {}};
  Candidates found = candidates(table, map, units, form);
  keep_moving_dates(table, found.dates);
  const std::size_t dates = found.dates.size();
  const bool has_clock_beside = dates == 1 && content(table, found.dates[0]) == Holds::date;
  if (has_clock_beside) keep_named(table, found.clocks);
  if (has_clock_beside && found.clocks.size() == 1)
    return TimeColumns{{found.dates[0], found.clocks[0]}, {}};
  if (has_clock_beside && found.clocks.size() > 1) found.dates.clear();  // asked for below
  const bool is_finer =
      found.counting.size() == 1 && numbers_increase(table, found.counting[0], form);
  if (dates == 1 && is_finer &&
      (!increases(table, found.dates[0]) || !has_seconds(table, found.dates[0])))
    return TimeColumns{{found.counting[0]}, found.dates[0]};
  for (const auto* kind : {&found.dates, &found.epochs, &found.clocks, &found.counting}) {
    if (kind->size() == 1) return TimeColumns{{kind->front()}, {}};
    if (kind->empty()) continue;
    const std::string first = toml_text(table.header[(*kind)[0]]);
    const std::string second = toml_text(table.header[(*kind)[1]]);
    if (first == second)
      problems.add(table.header_line, "column " + std::to_string((*kind)[1] + 1),
                   table.header[(*kind)[1]],
                   "is the name of column " + std::to_string((*kind)[0] + 1) +
                       ", too, and both may be the time: give each a name of its own in this line, "
                       "or a file of its own to the columns of each time");
    else
      problems.add(
          table.header_line, "column " + std::to_string((*kind)[0] + 1), table.header[(*kind)[0]],
          "may be the time, and so may " + second + ": write time = " + first + " and ignore = [" +
              second + "], or the other way round, in the file of --columns");
    return std::nullopt;
  }
  if (const auto time = day_of_year(table, form)) return time;
  if (map != nullptr && map->period_s) return TimeColumns{};
  if (!table.has_header)
    problems.add(table.lines.empty() ? 1 : table.lines[0], "names", "(missing)",
                 "has no header that names the time: write names = [\"time_s\", "
                 "\"t1_degC\", ...], one for each of the " +
                     std::to_string(table.columns()) +
                     " fields per row, in the file of --columns (of import: --names "
                     "time_s,t1_degC,...), and period_s where no field is the time");
  else
    problems.add(table.header_line, "time_s", "(missing)",
                 "must be one of the columns; if another is the time, write time = \"its name\" in "
                 "the file of --columns; if none is, period_s = the seconds between two rows");
  return std::nullopt;
}

/// The column behind a clock of whole seconds that is called after a unit of time, if all its
/// numbers are below a second.
void find_fraction(const TextTable& table, const ColumnMap* map, const NumberForm& form,
                   TimeColumns& time) {
  if (time.columns.empty() || time.columns.size() > 2) return;
  const std::size_t clock = time.columns.back();
  const std::size_t next = clock + 1;
  if (next >= table.columns() || time.has(next)) return;
  if (map != nullptr && map->uses(table.header[next])) return;
  const std::string name = small_letters(table.header[next]);
  const SpelledUnit* unit = spelled_unit(name == "millitm" || name == "millis" ? "ms" : name);
  if (unit == nullptr || unit->dimension != "time" || unit->factor > 1) return;
  bool is_moving = false;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto stamp = parse_time_stamp(table.field(row, clock));
    const auto number = number_of(table.field(row, next), form);
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
  if (time.columns.empty() || time.columns.size() > 2 || table.rows() == 0) return;
  const auto stamp = parse_time_stamp(table.field(0, time.columns.back()));
  if (!stamp || !stamp->has_clock) return;
  for (std::size_t i = 0; i < table.columns() && !time.half; ++i) {
    bool is_half = true;
    for (std::size_t row = 0; row < table.rows() && is_half; ++row)
      is_half = is_one_of(halves, table.field(row, i));
    if (is_half) time.half = i;
  }
}

}  // namespace

bool TimeColumns::has(std::size_t column) const {
  return column == fraction || column == half ||
         std::find(columns.begin(), columns.end(), column) != columns.end();
}

std::optional<TimeColumns> find_time(const TextTable& table, const ColumnMap* map,
                                     const std::vector<std::string>& units, const NumberForm& form,
                                     ProblemList& problems) {
  auto time = find_clock(table, map, units, form, problems);
  if (time) find_fraction(table, map, form, *time);
  if (time) find_half(table, *time);
  return time;
}

}  // namespace thermocomp
