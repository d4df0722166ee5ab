#include "config/run_forms/time_column.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <span>
#include <string>
#include <utility>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/printable_text.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

enum class Holds { other, date, clock, both };

std::span<const std::string_view> first_fields(const TextColumn& column) {
  constexpr std::size_t rows_read = 100;
  return std::span(column.fields).first(std::min(column.fields.size(), rows_read));
}

/// The kind of content of a column's first rows, if it is the same in all of them. A date may be
/// written only when it changes, and with midnight.
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

/// Keeps only the column called time, if there is exactly one.
void keep_named(const TextTable& table, std::vector<std::size_t>& columns) {
  const auto is_named = [&](std::size_t i) { return names_time(table.columns[i].header); };
  if (std::ranges::count_if(columns, is_named) == 1) std::erase_if(columns, std::not_fn(is_named));
}

/// Drops constant dates, such as the start of a query, unless all are constant; of the rest keeps
/// the one called time, if there is exactly one.
void keep_moving_dates(const TextTable& table, std::vector<std::size_t>& dates) {
  if (dates.size() < 2) return;
  const auto is_constant = [&](std::size_t i) { return table.columns[i].has_one_value(); };
  if (!std::ranges::all_of(dates, is_constant)) std::erase_if(dates, is_constant);
  keep_named(table, dates);
}

/// True if counting numbers increase, and dates do not, or lack seconds.
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
                        "is the name of " + unnamed(first) +
                            ", too, and both may be the time: give each a name of its own "
                            "in this line, or a file of its own to the columns of each time");
  else
    table.refuse_column(first, "may be the time, and so may " + other + ": write time = " + name +
                                   " and " + ignore_column(table.columns[second].header) +
                                   ", or the other way round, in the file of --columns");
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
  const bool is_absent = table.map.is_of_several && !table.map.time.empty() &&
                         table.find(table.map.time[0]) == table.columns.size();
  if (!table.map.time.empty() && !is_absent) return mapped_time(table);
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

/// Finds the fraction after a clock of whole seconds: the column named after a unit of time, if all
/// its numbers are below a second.
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

/// Finds a column of only AM and PM that belongs to a clock.
void find_am_pm(const TextTable& table, TimeColumns& time) {
  constexpr std::string_view halves = "|am|pm|";
  if (table.rows() == 0) return;
  const auto stamp = parse_time_stamp(table.columns[time.columns.back()].fields[0]);
  if (!stamp || !stamp->has_clock) return;
  for (std::size_t i = 0; i < table.columns.size() && !time.half; ++i)
    if (std::ranges::all_of(table.columns[i].fields,
                            [&](std::string_view field) { return is_one_of(halves, field); }))
      time.half = i;
}

constexpr double day_s = 86400.0;

class TimeReader {
 public:
  TimeReader(TextTable& table, const TimeColumns& time) : table_(table), time_(time) {}

  RunTime read() {
    if (time_.columns.empty())
      read_period();
    else if (time_.columns.size() == 3)
      read_day_of_year();
    else if (time_.columns.size() == 2 || stamp_of(0, time_.columns[0]))
      read_stamps();
    else
      read_numbers(column(0));
    if (!std::ranges::all_of(run_.time_s, [](double value) { return std::isfinite(value); }) &&
        problems_.empty())
      problems_.add(0, "time_s", "(too large)", "must be finite numbers of seconds");
    if (time_.dates && problems_.empty())
      if (const auto at = wall_time(table_.columns[*time_.dates].fields[0]))
        run_.wall_zero = {at->seconds - run_.time_s.front(), at->is_utc};
    return std::move(run_);
  }

 private:
  /// A part of the time.
  [[nodiscard]] const TextColumn& column(std::size_t i) const {
    return table_.columns[time_.columns[i]];
  }
  [[nodiscard]] std::string quoted(std::size_t i) const {
    return "'" + table_.columns[i].header + "'";
  }
  void note(const std::string& text) { table_.notes.push_back("time_s: " + text); }

  // ---- numbers
  void read_period() {
    const double period_s = *table_.map.period_s;
    for (std::size_t row = 0; row < table_.rows(); ++row)
      run_.time_s.push_back(static_cast<double>(row) * period_s);
    note("a row each " + number_text(period_s) + " s, from the first");
  }

  void read_day_of_year() {
    for (std::size_t row = 0; row < table_.rows() && !problems_.full(); ++row) {
      const auto number = [&](std::size_t i) {
        const auto value = table_.number(column(i).fields[row]);
        if (!value) refuse(row, "must be year, day of the year and hhmm, as in the rows before");
        return value.value_or(0.0);
      };
      const double new_year = seconds_of_day(static_cast<int>(number(0)), 1, 1).value_or(0.0);
      const double hhmm = number(2);
      run_.time_s.push_back(new_year + day_s * (number(1) - 1) + 3600 * std::floor(hhmm / 100) +
                            60 * std::fmod(hhmm, 100.0));
    }
    const double first = count_from_first();
    run_.wall_zero = WallZero{first, false};
    note("year, day of the year and hhmm from " + quoted(time_.columns[0]) +
         " on, seconds after the first row (" + date_text(first) + ")");
  }

  void read_numbers(const TextColumn& numbers) {
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const auto number = table_.number(numbers.fields[row]);
      if (!number && row == 0) return refuse_form();
      if (!number)
        refuse(row,
               "must be a number, as in the rows before; delete the line if it is no measurement");
      run_.time_s.push_back(number.value_or(not_a_number));
    }
    if (problems_.empty() && !run_.time_s.empty()) scale_numbers(numbers);
  }

  void scale_numbers(const TextColumn& numbers) {
    const std::string& header = numbers.header;
    std::string unit = table_.map.time_unit;
    if (unit.empty()) unit = header == "time_s" ? "s" : numbers.unit;
    if (unit.empty()) unit = unit_of_time_name(header);
    if (number_text_of(numbers.unit).unit != nullptr) {
      problems_.add(table_.header_line, header, numbers.unit,
                    "is a multiple of a unit: write the times in s, and s as their unit");
      return;
    }
    if (!unit.empty() && are_clock_digits(run_.time_s)) {
      refuse(0,
             "is a clock without colons, as the last digits of all rows show, and not a number "
             "of " +
                 unit + ": write time_unit = \"hhmmss\" in the file of --columns");
      return;
    }
    const SpelledUnit* known = time_unit(unit);
    const bool is_time = known != nullptr;
    const Epoch* epoch = epoch_of(run_.time_s, is_time || names_date(header), is_time);
    if (epoch != nullptr && is_time && header != "Time_ms" &&
        std::abs(known->factor * epoch->per_second - 1) > 1e-9)
      epoch = nullptr;  // the unit implies another scale
    if (epoch != nullptr) {
      const double first = count_from_first(epoch->per_second);
      const double zero_s = first / epoch->per_second + epoch->zero_s;
      run_.wall_zero = WallZero{zero_s, epoch->is_utc};
      note("'" + header + "', numbers [" + epoch->name + "], seconds after the first row (" +
           (epoch->is_utc ? date_text(zero_s) + " UTC)" : number_text(first) + ")"));
    } else if (is_time) {
      for (double& value : run_.time_s) value *= known->factor;
      note("'" + header + "', numbers [" + unit + "]" +
           (known->factor == 1.0 ? "" : ", times " + number_text(known->factor)));
    } else {
      problems_.add(table_.header_line, header, unit.empty() ? "(no unit)" : unit,
                    "has no unit of time: write time_unit = \"s\" (or \"ms\", \"min\", \"h\", "
                    "\"day\", \"hhmmss\" for 95950, 100000) in the file of --columns");
    }
  }

  /// Converts the times to seconds after the first one, which it returns. Rounds to a microsecond,
  /// since fractions were rounded when written.
  double count_from_first(double per_second = 1.0) {
    const double first = run_.time_s.front();
    for (double& at : run_.time_s) at = std::round((at - first) / per_second * 1e6) / 1e6;
    return first;
  }

  // ---- dates and clock times
  /// The stamp of a field; with time_unit = "hhmmss" of the number 95950.
  [[nodiscard]] std::optional<TimeStamp> stamp_of(std::size_t row, std::size_t i) const {
    const std::string_view field = table_.columns[i].fields[row];
    if (time_.half && i == time_.columns.back())
      return parse_time_stamp(std::string(field) + ' ' +
                              std::string(table_.columns[*time_.half].fields[row]));
    const auto number =
        table_.map.time_unit == "hhmmss" ? finite_number(field) : std::optional<double>();
    if (!number || *number >= 1e6) return parse_time_stamp(field);
    TimeStamp stamp;
    stamp.has_clock = true;
    stamp.clock_parts = 3;
    stamp.clock_a = std::floor(*number / 1e4);
    stamp.clock_b = std::fmod(std::floor(*number / 1e2), 1e2);
    stamp.clock_c = std::fmod(*number, 1e2);
    if (!(*number >= 0 && stamp.clock_b < 60 && stamp.clock_c < 60)) return std::nullopt;
    return stamp;
  }

  void read_stamps() {
    std::vector<TimeStamp> stamps;
    std::optional<TimeStamp> date;  // the last one written
    const auto zone = zone_of_header(column(0).header);
    const bool has_clocks = time_.columns.size() == 2;
    for (std::size_t row = 0; row < table_.rows() && !problems_.full(); ++row) {
      if (!has_clocks || row == 0 || !column(0).fields[row].empty())
        date = stamp_of(row, time_.columns[0]);
      std::optional<TimeStamp> stamp = date;
      if (stamp && has_clocks) stamp = joined(row, *stamp);
      if (stamp && stamp->has_date && !stamp->zone_s) stamp->zone_s = zone;
      if (stamp && !stamps.empty() && !alike(*stamp, stamps.front())) stamp.reset();
      if (!stamp && row == 0) return refuse_form();
      if (!stamp)
        refuse(row,
               "must be a time in the form of the rows before; delete the line if it is no "
               "measurement");
      stamps.push_back(stamp.value_or(TimeStamp{}));
    }
    if (!problems_.empty() || stamps.empty() || !clock_is_clear(stamps.front()) ||
        counts_ms(stamps))
      return;
    const std::optional<DateOrder> order = date_order(stamps);
    if (!problems_.empty()) return;
    run_.time_s = seconds_by(stamps, order.value_or(DateOrder::unknown));
    add_fractions();
    for (std::size_t row = 0; row < stamps.size(); ++row)
      if (std::isnan(run_.time_s[row]))
        refuse(row, "must be a day of the calendar and a time of it");
    if (!problems_.empty()) return;
    const double first = count_from_first();
    note_stamps(stamps.front(), order, first);
    if (stamps.front().has_date && order)
      run_.wall_zero = WallZero{first, stamps.front().zone_s.has_value()};
  }

  /// NaN for a day that does not exist.
  [[nodiscard]] std::vector<double> seconds_by(const std::vector<TimeStamp>& stamps,
                                               DateOrder order) const {
    const bool minutes_first = table_.map.time_unit == "mm:ss";
    const double wrap_s = minutes_first ? day_s / 24 : day_s;
    const bool wraps = !stamps.front().has_date && std::ranges::all_of(stamps, [&](const auto& s) {
      return s.clock_a < (minutes_first ? 60 : 24);
    });
    std::vector<double> seconds;
    for (const TimeStamp& stamp : stamps) {
      seconds.push_back(seconds_of(stamp, order, minutes_first).value_or(not_a_number));
      const std::size_t row = seconds.size() - 1;
      if (!wraps || row == 0) continue;
      const double last = seconds[row - 1];
      seconds[row] += wrap_s * std::floor(last / wrap_s);
      // Minutes may also begin anew; the usual step shows the end of an hour.
      const double step = minutes_first && row > 1 ? 3 * (last - seconds[row - 2]) : wrap_s / 2;
      if (seconds[row] + wrap_s - last < step) seconds[row] += wrap_s;
    }
    return seconds;
  }

  void add_fractions() {
    for (std::size_t row = 0; row < table_.rows() && time_.fraction; ++row)
      run_.time_s[row] +=
          time_.fraction_factor *
          table_.number(table_.columns[*time_.fraction].fields[row]).value_or(not_a_number);
  }

  [[nodiscard]] std::optional<TimeStamp> joined(std::size_t row, const TimeStamp& date) const {
    auto clock = stamp_of(row, time_.columns[1]);
    if (!clock || clock->has_date || (date.has_clock && !date.is_midnight())) return std::nullopt;
    clock->has_date = true;
    clock->date = date.date;
    clock->allows = date.allows;
    return clock;
  }

  static bool alike(const TimeStamp& a, const TimeStamp& b) {
    return a.has_date == b.has_date && a.has_clock == b.has_clock &&
           a.zone_s.has_value() == b.zone_s.has_value() && a.clock_parts == b.clock_parts;
  }

  /// The order of day, month and year that all rows allow. Of several, the one with a far shorter
  /// duration of the run; if all rows are of one day, any for the seconds, but none for the date.
  /// @return nullopt: the date is unknown
  std::optional<DateOrder> date_order(const std::vector<TimeStamp>& stamps) {
    if (!stamps.front().has_date) return DateOrder::unknown;
    std::vector<DateOrder> possible;
    for (const DateOrder order : date_orders) {
      const auto allows = [&](const TimeStamp& stamp) { return stamp.allows_order(order); };
      if (!std::ranges::all_of(stamps, allows)) continue;
      if (order == table_.map.date_order) return order;
      possible.push_back(order);
    }
    if (possible.empty()) {
      const auto other = std::ranges::find_if(
          stamps, [&](const TimeStamp& stamp) { return stamp.allows != stamps.front().allows; });
      refuse(static_cast<std::size_t>(other - stamps.begin()) % stamps.size(),
             "has day and month in another order than an earlier row");
      return std::nullopt;
    }
    if (possible.size() == 1) return possible[0];
    std::vector<std::pair<double, DateOrder>> spans;
    for (const DateOrder order : possible) {
      const std::vector<double> seconds = seconds_by(stamps, order);
      const auto [low, high] = std::minmax_element(seconds.begin(), seconds.end());
      if (std::ranges::none_of(seconds, [](double s) { return std::isnan(s); }))
        spans.emplace_back(*high - *low, order);
    }
    std::ranges::sort(spans, {}, &std::pair<double, DateOrder>::first);
    if (spans.size() == 1) return spans[0].second;
    if (spans.size() > 1 && spans[1].first > 5 * spans[0].first) return spans[0].second;
    if (stamps.front().has_points) return DateOrder::day_month_year;
    if (!std::ranges::all_of(stamps, [&](const auto& s) { return s.date == stamps[0].date; }))
      refuse(0,
             "may begin with the day or the month: write date_order = \"day.month.year\" or "
             "\"month.day.year\" in the file of --columns");
    return std::nullopt;
  }

  bool clock_is_clear(const TimeStamp& first) {
    if (first.clock_parts != 2 || !table_.map.time_unit.empty()) return true;
    // After a date they are hours and minutes, unless a spreadsheet shows 00:10.0.
    if (first.has_date && first.fraction_digits == 0) return true;
    refuse(0,
           "may be hours and minutes or minutes and seconds: write time_unit = \"hh:mm\" or "
           "\"mm:ss\" in the file of --columns");
    return false;
  }

  /// Refuses 8:00:00.3, 8:00:00.20: the fractions may be of a second, or counts of ms.
  bool counts_ms(const std::vector<TimeStamp>& stamps) {
    int digits = 0;  // digits in the first fraction
    const auto other = std::ranges::find_if(stamps, [&](const TimeStamp& stamp) {
      if (digits == 0) digits = stamp.fraction_digits;
      return stamp.fraction_digits != 0 && stamp.fraction_digits != digits;
    });
    if (other == stamps.end() || std::ranges::none_of(stamps, &TimeStamp::may_count_ms))
      return false;
    refuse(static_cast<std::size_t>(other - stamps.begin()),
           "may end with a fraction of a second or with a number of ms, since the rows have "
           "different numbers of digits: write three in each row");
    return true;
  }

  void note_stamps(const TimeStamp& first, std::optional<DateOrder> order, double first_s) {
    std::string text = quoted(time_.columns[0]);
    if (time_.columns.size() == 2) text += " and " + quoted(time_.columns[1]);
    for (const auto& part : {time_.fraction, time_.half})
      if (part) text += " and " + quoted(*part);
    if (first.has_date && !order) {
      note(text +
           ", seconds after the first row; the date may begin with the day or the month, which "
           "matters only for --join (date_order = \"day.month.year\" or \"month.day.year\" in the "
           "file of --columns)");
      return;
    }
    std::string zero(column(0).fields[0]);
    if (first.has_date) {
      text += *order == DateOrder::year_month_day   ? ", year-month-day"
              : *order == DateOrder::month_day_year ? ", month/day/year"
                                                    : ", day.month.year";
      zero = date_text(first_s) + (first.zone_s ? " UTC" : "");
    } else {
      text += first.clock_parts == 2 && table_.map.time_unit == "mm:ss" ? ", minutes:seconds"
                                                                        : ", time of the clock";
    }
    note(text + ", seconds after the first row (" + zero + ")");
  }

  /// Reports the first row only.
  void refuse_form() {
    refuse(0, "must be a number or a time of a form that is read; docs/run_files.md lists them");
  }

  void refuse(std::size_t row, std::string rule) {
    const std::string_view field = column(0).fields[row];
    problems_.add(table_.lines[row], column(0).header, field.empty() ? "(missing)" : field,
                  std::move(rule));
  }

  TextTable& table_;
  const TimeColumns& time_;
  ProblemList& problems_{table_.problems};
  RunTime run_;
};

}  // namespace

std::optional<TimeColumns> find_time(TextTable& table) {
  auto time = find_clock(table);
  if (!time) return std::nullopt;
  const auto mark = [&](std::size_t column) { table.columns[column].is_time = true; };
  std::ranges::for_each(time->columns, mark);
  if (time->columns.empty() || time->columns.size() > 2) return time;
  find_fraction(table, *time);
  find_am_pm(table, *time);
  for (const auto& part : {time->fraction, time->half})
    if (part) mark(*part);
  return time;
}

RunTime read_time(TextTable& table, const TimeColumns& time) {
  return TimeReader(table, time).read();
}

}  // namespace thermocomp
