#include "config/run_forms/time_column.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/number_text.hpp"

namespace thermocomp {
namespace {

constexpr double day_s = 86400.0;
constexpr std::size_t rows_judged = 100;
// A number that is a date counts days since 1899-12-30, as spreadsheets do: 1954 to 2119.
constexpr double serial_days_min = 20000.0;
constexpr double serial_days_max = 80000.0;

constexpr auto time_names = std::to_array<std::string_view>(
    {"time", "zeit", "timestamp", "zeitstempel", "datetime", "date", "datum", "uhrzeit", "elapsed",
     "elapsed time", "date time", "date/time", "datum/uhrzeit", "t_s", "laufzeit"});
constexpr auto date_names = std::to_array<std::string_view>(
    {"date", "datum", "datetime", "date time", "date/time", "datum/uhrzeit"});

std::string small_letters(std::string_view text) {
  std::string small(text);
  for (char& c : small) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  return small;
}

template <std::size_t N>
bool is_one_of(const std::array<std::string_view, N>& names, std::string_view header) {
  const std::string base = small_letters(spelled_name(header).base);
  return std::find(names.begin(), names.end(), base) != names.end();
}

enum class Holds { other, date, clock, both };

/// What the first rows of a column hold, where all of them hold the same.
Holds content(const TextTable& table, std::size_t column) {
  Holds holds = Holds::other;
  for (std::size_t row = 0; row < std::min(table.rows(), rows_judged); ++row) {
    const auto stamp = parse_time_stamp(table.field(row, column));
    if (!stamp) return Holds::other;
    const Holds here = !stamp->has_date    ? Holds::clock
                       : !stamp->has_clock ? Holds::date
                                           : Holds::both;
    if (row > 0 && here != holds) return Holds::other;
    holds = here;
  }
  return holds;
}

class TimeReader {
 public:
  TimeReader(const TextTable& table, const TimeColumns& time, const ColumnMap* map,
             const std::vector<std::string>& units, const NumberForm& form, ProblemList& problems)
      : table_(table), time_(time), map_(map), units_(units), form_(form), problems_(problems) {}

  RunTime read() {
    const std::size_t column = time_.columns[0];
    if (time_.columns.size() == 2 || content(table_, column) != Holds::other)
      read_stamps();
    else
      read_numbers(column);
    check_increasing();
    return std::move(run_);
  }

 private:
  [[nodiscard]] std::string_view asked_unit() const {
    return map_ == nullptr ? std::string_view() : std::string_view(map_->time_unit);
  }

  // ---- numbers
  void read_numbers(std::size_t column) {
    const std::string& header = table_.header[column];
    std::vector<double>& time = run_.time_s;
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const auto number = number_of(table_.field(row, column), form_);
      if (!number)
        problems_.add(table_.lines[row], header,
                      table_.field(row, column).empty() ? "(missing)" : table_.field(row, column),
                      "must be a time, as in the rows before");
      time.push_back(number.value_or(NAN));
    }
    if (!problems_.empty() || time.empty()) return;
    std::string unit(asked_unit());
    if (unit.empty()) unit = header == "time_s" ? "s" : units_[column];
    const SpelledUnit* known = spelled_unit(unit);
    if (known != nullptr && known->dimension == "time") {
      scale(header, unit, known->factor);
    } else if (is_one_of(date_names, header) && time.front() >= serial_days_min &&
               time.back() < serial_days_max) {
      scale(header, "day", day_s);
    } else {
      problems_.add(table_.header_line, header, unit.empty() ? "(no unit)" : unit,
                    "has no unit of time: write time_unit = \"s\" (or \"ms\", \"min\", \"h\", "
                    "\"day\") in the file of --columns");
    }
  }

  void scale(const std::string& header, const std::string& unit, double factor) {
    std::vector<double>& time = run_.time_s;
    run_.said = "time_s: '" + header + "', numbers [" + unit + "]";
    const bool serial = factor == day_s && time.front() >= serial_days_min;
    const double first = time.front();
    if (serial) {
      // Fractions of days are rounded where they were written: to a microsecond here.
      for (double& value : time) value = std::round((value - first) * day_s * 1e6) / 1e6;
      run_.said += ", seconds after the first row (" + number_text(first) + ")";
    } else if (factor != 1.0) {
      for (double& value : time) value *= factor;
      run_.said += ", times " + number_text(factor);
    }
  }

  // ---- dates and times of the clock
  void read_stamps() {
    std::vector<TimeStamp> stamps;
    for (std::size_t row = 0; row < table_.rows() && !problems_.full(); ++row) {
      std::optional<TimeStamp> stamp = parse_time_stamp(table_.field(row, time_.columns[0]));
      if (stamp && time_.columns.size() == 2) stamp = joined(row, *stamp);
      if (stamp && !stamps.empty() && !alike(*stamp, stamps.front())) stamp.reset();
      if (!stamp) refuse(row, "must be a time in the form of the rows before");
      stamps.push_back(stamp.value_or(TimeStamp{}));
    }
    if (!problems_.empty() || stamps.empty()) return;
    const DateOrder order = date_order(stamps);
    const bool minutes_first = asked_unit() == "mm:ss";
    if (!problems_.empty() || !clock_is_clear(stamps)) return;
    const bool clock_only = !stamps.front().has_date;
    const bool wraps =
        clock_only &&
        std::all_of(stamps.begin(), stamps.end(), [](const auto& s) { return s.clock_a < 24; }) &&
        !minutes_first;
    double first = 0.0;
    double days = 0.0;
    double last = 0.0;
    for (std::size_t row = 0; row < stamps.size(); ++row) {
      const auto seconds = seconds_of(stamps[row], order, minutes_first);
      if (!seconds) refuse(row, "must be a day of the calendar and a time of it");
      const double at = seconds.value_or(0.0);
      if (row == 0) first = at;
      if (wraps && row > 0 && at < last - day_s / 2) days += day_s;
      last = at;
      run_.time_s.push_back(std::round((at - first + days) * 1e6) / 1e6);
    }
    if (problems_.empty()) say_stamps(stamps.front(), order, first);
    if (stamps.front().has_date)
      run_.wall_zero = WallZero{first, stamps.front().zone_s.has_value()};
  }

  std::optional<TimeStamp> joined(std::size_t row, TimeStamp date) const {
    const auto clock = parse_time_stamp(table_.field(row, time_.columns[1]));
    if (!clock || clock->has_date || date.has_clock) return std::nullopt;
    TimeStamp both = *clock;
    both.has_date = true;
    both.year = date.year;
    both.first = date.first;
    both.second = date.second;
    both.order = date.order;
    return both;
  }

  static bool alike(const TimeStamp& a, const TimeStamp& b) {
    return a.has_date == b.has_date && a.has_clock == b.has_clock &&
           a.zone_s.has_value() == b.zone_s.has_value() && a.clock_parts == b.clock_parts;
  }

  DateOrder date_order(const std::vector<TimeStamp>& stamps) {
    DateOrder order = DateOrder::unknown;
    std::optional<std::size_t> unclear;
    for (std::size_t row = 0; row < stamps.size(); ++row) {
      const DateOrder here = stamps[row].order;
      if (!stamps[row].has_date) continue;
      if (here == DateOrder::unknown) {
        if (!unclear) unclear = row;
      } else if (order != DateOrder::unknown && here != order) {
        refuse(row, "has day and month the other way round than a row before");
        return order;
      } else {
        order = here;
      }
    }
    const DateOrder asked = map_ == nullptr ? DateOrder::unknown : map_->date_order;
    if (order == DateOrder::unknown) order = asked;
    if (order == DateOrder::unknown && unclear)
      refuse(*unclear,
             "may begin with the day or the month: write date_order = \"day.month.year\" or "
             "\"month.day.year\" in the file of --columns");
    return order;
  }

  bool clock_is_clear(const std::vector<TimeStamp>& stamps) {
    const TimeStamp& first = stamps.front();
    if (first.has_date || first.clock_parts != 2 || !asked_unit().empty()) return true;
    refuse(0,
           "may be hours and minutes or minutes and seconds: write time_unit = \"hh:mm\" or "
           "\"mm:ss\" in the file of --columns");
    return false;
  }

  void say_stamps(const TimeStamp& first, DateOrder order, double first_s) {
    run_.said = "time_s: '" + table_.header[time_.columns[0]] + "'";
    if (time_.columns.size() == 2) run_.said += " and '" + table_.header[time_.columns[1]] + "'";
    if (first.has_date) {
      const bool stands_year_first =
          table_.field(0, time_.columns[0]).find_first_not_of("0123456789") == 4;
      run_.said += stands_year_first                    ? ", year-month-day"
                   : order == DateOrder::month_day_year ? ", month/day/year"
                                                        : ", day.month.year";
      run_.said += ", seconds after the first row (" + date_text(first_s);
      run_.said += first.zone_s ? " UTC)" : ")";
    } else {
      run_.said += first.clock_parts == 2 && asked_unit() == "mm:ss" ? ", minutes:seconds"
                                                                     : ", time of the clock";
      run_.said +=
          ", seconds after the first row (" + std::string(table_.field(0, time_.columns[0])) + ")";
    }
  }

  // ---- both
  void refuse(std::size_t row, std::string rule) {
    const std::size_t column = time_.columns[0];
    const std::string_view field = table_.field(row, column);
    problems_.add(table_.lines[row], table_.header[column], field.empty() ? "(missing)" : field,
                  std::move(rule));
  }

  void check_increasing() {
    for (std::size_t row = 1; row < run_.time_s.size() && problems_.empty(); ++row) {
      if (run_.time_s[row] > run_.time_s[row - 1]) continue;
      refuse(row, "must be later than in the row before (" +
                      shortened(table_.field(row - 1, time_.columns.back())) + ")");
    }
    for (const double value : run_.time_s)
      if (!std::isfinite(value) && problems_.empty())
        problems_.add(0, "time_s", "(too large)", "must be finite numbers of seconds");
  }

  const TextTable& table_;
  const TimeColumns& time_;
  const ColumnMap* map_;
  const std::vector<std::string>& units_;
  const NumberForm& form_;
  ProblemList& problems_;
  RunTime run_;
};

}  // namespace

bool TimeColumns::has(std::size_t column) const {
  return std::find(columns.begin(), columns.end(), column) != columns.end();
}

std::optional<TimeColumns> find_time(const TextTable& table, const ColumnMap* map,
                                     const std::vector<std::string>& units, ProblemList& problems) {
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
  if (column_of("time_s") < table.columns()) return TimeColumns{{column_of("time_s")}};
  TimeColumns found;
  std::vector<Holds> holds;
  for (std::size_t i = 0; i < table.columns(); ++i) {
    if (map != nullptr && (map->columns.contains(table.header[i]) ||
                           std::find(map->ignored.begin(), map->ignored.end(), table.header[i]) !=
                               map->ignored.end()))
      continue;
    const Holds here = content(table, i);
    const SpelledUnit* unit = spelled_unit(units[i]);
    if (here == Holds::other && !is_one_of(time_names, table.header[i]) &&
        !(unit != nullptr && unit->dimension == "time"))
      continue;
    found.columns.push_back(i);
    holds.push_back(here);
  }
  if (found.columns.size() == 1) return found;
  if (holds.size() == 2 && holds[0] == Holds::date && holds[1] == Holds::clock) return found;
  if (holds.size() == 2 && holds[0] == Holds::clock && holds[1] == Holds::date)
    return TimeColumns{{found.columns[1], found.columns[0]}};
  if (found.columns.empty()) {
    problems.add(table.header_line, "time_s", "(missing)",
                 "must be one of the columns; if another is the time, write time = \"its name\" in "
                 "the file of --columns");
    return std::nullopt;
  }
  std::string rule = "may be the time, and so may " + toml_text(table.header[found.columns[1]]) +
                     ": write time = " + toml_text(table.header[found.columns[0]]) +
                     " and ignore = [" + toml_text(table.header[found.columns[1]]) +
                     "], or the other way round, in the file of --columns";
  problems.add(table.header_line, "column " + std::to_string(found.columns[0] + 1),
               table.header[found.columns[0]], std::move(rule));
  return std::nullopt;
}

RunTime read_time(const TextTable& table, const TimeColumns& time, const ColumnMap* map,
                  const std::vector<std::string>& units, const NumberForm& form,
                  ProblemList& problems) {
  return TimeReader(table, time, map, units, form, problems).read();
}

}  // namespace thermocomp
