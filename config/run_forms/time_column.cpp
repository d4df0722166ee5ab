#include "config/run_forms/time_column.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "config/run_forms/number_epoch.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_name.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

constexpr double day_s = 86400.0;
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

/// 95950, 100000, 100010: equal steps only as hours, minutes and seconds.
bool are_clock_digits(const std::vector<double>& numbers) {
  const auto steps_of = [&](auto seconds) {
    double low = INFINITY;
    double high = -INFINITY;
    for (std::size_t i = 1; i < numbers.size(); ++i) {
      const double step = seconds(numbers[i]) - seconds(numbers[i - 1]);
      low = std::min(low, step);
      high = std::max(high, step);
    }
    return std::pair(low, high);
  };
  const auto of_clock = [](double n) {
    return 3600 * std::floor(n / 1e4) + 60 * std::fmod(std::floor(n / 100), 100) +
           std::fmod(n, 100);
  };
  const bool may_be = std::all_of(numbers.begin(), numbers.end(), [](double n) {
    return n >= 0 && n < 240000 && std::fmod(n, 100) < 60 && std::fmod(n / 100, 100) < 60;
  });
  if (!may_be || numbers.back() < 1e4) return false;
  const auto [low, high] = steps_of(of_clock);
  const auto [number_low, number_high] = steps_of([](double n) { return n; });
  return low > 0 && high <= 2 * low && number_high > 2 * number_low && number_high >= 40 + high;
}

class TimeReader {
 public:
  TimeReader(const TextTable& table, const TimeColumns& time, const ColumnMap* map,
             const std::vector<std::string>& units, const NumberForm& form, ProblemList& problems)
      : table_(table), time_(time), map_(map), units_(units), form_(form), problems_(problems) {}

  RunTime read() {
    if (time_.columns.empty())
      read_period();
    else if (time_.columns.size() == 3)
      read_day_of_year();
    else if (time_.columns.size() == 2 || stamp_of(table_.field(0, time_.columns[0])))
      read_stamps();
    else
      read_numbers(time_.columns[0]);
    for (const double value : run_.time_s)
      if (!std::isfinite(value) && problems_.empty())
        problems_.add(0, "time_s", "(too large)", "must be finite numbers of seconds");
    if (time_.dates && problems_.empty()) {
      const auto stamp = parse_time_stamp(table_.field(0, *time_.dates));
      const auto seconds = stamp ? seconds_of(*stamp, DateOrder::unknown, false) : std::nullopt;
      if (seconds) run_.wall_zero = {*seconds - run_.time_s.front(), stamp->zone_s.has_value()};
    }
    return std::move(run_);
  }

 private:
  [[nodiscard]] std::string_view asked_unit() const {
    return map_ == nullptr ? std::string_view() : std::string_view(map_->time_unit);
  }

  // ---- numbers
  void read_period() {
    for (std::size_t row = 0; row < table_.rows(); ++row)
      run_.time_s.push_back(static_cast<double>(row) * *map_->period_s);
    run_.note = "time_s: a row each " + number_text(*map_->period_s) + " s, from the first";
  }

  bool take_numbers(std::size_t column) {
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const auto number = number_of(table_.field(row, column), form_);
      if (!number && row == 0) return refuse_form();
      if (!number)
        refuse(row,
               "must be a number, as in the rows before; delete the line if it is no measurement");
      run_.time_s.push_back(number.value_or(NAN));
    }
    return problems_.empty() && !run_.time_s.empty();
  }

  void read_day_of_year() {
    const auto number = [&](std::size_t row, std::size_t column) {
      const auto value = number_of(table_.field(row, time_.columns[column]), form_);
      if (!value) refuse(row, "must be year, day of the year and hhmm, as in the rows before");
      return value.value_or(0.0);
    };
    double first = 0.0;
    for (std::size_t row = 0; row < table_.rows() && !problems_.full(); ++row) {
      TimeStamp new_year;
      new_year.has_date = true;
      new_year.date = {static_cast<int>(number(row, 0)), 1, 1};
      new_year.allows[static_cast<std::size_t>(DateOrder::year_month_day)] = true;
      const double hhmm = number(row, 2);
      const double at = seconds_of(new_year, DateOrder::unknown, false).value_or(0.0) +
                        day_s * (number(row, 1) - 1) + 3600 * std::floor(hhmm / 100) +
                        60 * std::fmod(hhmm, 100.0);
      if (row == 0) first = at;
      run_.time_s.push_back(at - first);
    }
    run_.wall_zero = WallZero{first, false};
    run_.note = "time_s: year, day of the year and hhmm from '" + table_.header[time_.columns[0]] +
                "' on, seconds after the first row (" + date_text(first) + ")";
  }

  void read_numbers(std::size_t column) {
    const std::string& header = table_.header[column];
    if (!take_numbers(column)) return;
    std::string unit(asked_unit());
    if (unit.empty()) unit = header == "time_s" ? "s" : units_[column];
    if (unit.empty()) unit = unit_of_time_name(header);
    if (number_text_of(units_[column]).unit != nullptr) {
      problems_.add(table_.header_line, header, units_[column],
                    "is a multiple of a unit: write the times in s, and s as their unit");
      return;
    }
    if (!unit.empty() && are_clock_digits(run_.time_s)) {
      problems_.add(table_.lines[0], header, table_.field(0, column),
                    "is a clock without colons, as the last digits of all rows show, and not a "
                    "number of " +
                        unit + ": write time_unit = \"hhmmss\" in the file of --columns");
      return;
    }
    const SpelledUnit* known = spelled_unit(unit);
    const bool is_time = known != nullptr && known->dimension == "time";
    const Epoch* epoch = epoch_of(run_.time_s, is_time || names_date(header), is_time);
    if (epoch != nullptr && is_time && std::abs(known->factor * epoch->per_second - 1) > 1e-9)
      epoch = nullptr;  // the unit implies another scale
    if (epoch != nullptr) {
      count_from_first(header, *epoch);
    } else if (is_time) {
      run_.note = "time_s: '" + header + "', numbers [" + unit + "]";
      if (known->factor == 1.0) return;
      for (double& value : run_.time_s) value *= known->factor;
      run_.note += ", times " + number_text(known->factor);
    } else {
      problems_.add(table_.header_line, header, unit.empty() ? "(no unit)" : unit,
                    "has no unit of time: write time_unit = \"s\" (or \"ms\", \"min\", \"h\", "
                    "\"day\", \"hhmmss\" for 95950, 100000) in the file of --columns");
    }
  }

  /// Rounds to a microsecond, since fractions were rounded when written.
  void count_from_first(const std::string& header, const Epoch& epoch) {
    const double first = run_.time_s.front();
    for (double& value : run_.time_s)
      value = std::round((value - first) / epoch.per_second * 1e6) / 1e6;
    const double zero_s = first / epoch.per_second + epoch.zero_s;
    run_.wall_zero = WallZero{zero_s, epoch.is_utc};
    run_.note = "time_s: '" + header + "', numbers [" + epoch.name +
                "], seconds after the first row (" +
                (epoch.is_utc ? date_text(zero_s) + " UTC)" : number_text(first) + ")");
  }

  // ---- dates and clock times
  /// The stamp of a field; with time_unit = "hhmmss" of the number 95950.
  [[nodiscard]] std::optional<TimeStamp> stamp_of(std::string_view field) const {
    const auto number = asked_unit() == "hhmmss" ? finite_number(field) : std::nullopt;
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
    const auto zone = zone_of_header(table_.header[time_.columns[0]]);
    for (std::size_t row = 0; row < table_.rows() && !problems_.full(); ++row) {
      const bool has_clocks = time_.columns.size() == 2;
      if (const std::string_view field = table_.field(row, time_.columns[0]);
          !has_clocks || row == 0 || !field.empty())
        date = stamp_of(field);
      std::optional<TimeStamp> stamp = date;
      if (stamp && has_clocks) stamp = joined(row, *stamp);
      if (stamp && stamp->has_date && !stamp->zone_s) stamp->zone_s = zone;
      if (stamp && !stamps.empty() && !alike(*stamp, stamps.front())) stamp.reset();
      if (!stamp && row == 0) {
        refuse_form();
        return;
      }
      if (!stamp)
        refuse(row,
               "must be a time in the form of the rows before; delete the line if it is no "
               "measurement");
      stamps.push_back(stamp.value_or(TimeStamp{}));
    }
    if (!problems_.empty() || stamps.empty() || !clock_is_clear(stamps)) return;
    const std::optional<DateOrder> order = date_order(stamps);
    if (!problems_.empty()) return;
    const DateOrder taken = order.value_or(DateOrder::unknown);
    run_.time_s = seconds_by(stamps, taken);
    add_fractions();
    const double first = run_.time_s.front();
    for (std::size_t row = 0; row < stamps.size(); ++row) {
      if (std::isnan(run_.time_s[row]))
        refuse(row, "must be a day of the calendar and a time of it");
      run_.time_s[row] = std::round((run_.time_s[row] - first) * 1e6) / 1e6;
    }
    if (!problems_.empty()) return;
    note_stamps(stamps.front(), order, first);
    if (stamps.front().has_date && order)
      run_.wall_zero = WallZero{first, stamps.front().zone_s.has_value()};
  }

  /// NaN for a day that does not exist.
  [[nodiscard]] std::vector<double> seconds_by(const std::vector<TimeStamp>& stamps,
                                               DateOrder order) const {
    const bool minutes_first = asked_unit() == "mm:ss";
    const bool wraps =
        !stamps.front().has_date && !minutes_first &&
        std::all_of(stamps.begin(), stamps.end(), [](const auto& s) { return s.clock_a < 24; });
    std::vector<double> seconds;
    double days = 0.0;
    double last = 0.0;
    for (const TimeStamp& stamp : stamps) {
      const double at = seconds_of(stamp, order, minutes_first).value_or(NAN);
      if (wraps && !seconds.empty() && at < last - day_s / 2) days += day_s;
      last = at;
      seconds.push_back(at + days);
    }
    return seconds;
  }

  void add_fractions() {
    for (std::size_t row = 0; row < table_.rows() && time_.fraction; ++row)
      run_.time_s[row] += time_.fraction_factor *
                          number_of(table_.field(row, *time_.fraction), form_).value_or(NAN);
  }

  std::optional<TimeStamp> joined(std::size_t row, TimeStamp date) const {
    const auto clock = stamp_of(table_.field(row, time_.columns[1]));
    if (!clock || clock->has_date || (date.has_clock && !date.is_midnight())) return std::nullopt;
    TimeStamp both = *clock;
    both.has_date = true;
    both.date = date.date;
    both.allows = date.allows;
    return both;
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
    const DateOrder asked = map_ == nullptr ? DateOrder::unknown : map_->date_order;
    for (const DateOrder order :
         {DateOrder::year_month_day, DateOrder::day_month_year, DateOrder::month_day_year}) {
      const bool by_all = std::all_of(stamps.begin(), stamps.end(), [&](const TimeStamp& stamp) {
        return stamp.allows_order(order);
      });
      if (by_all && order == asked) return order;
      if (by_all) possible.push_back(order);
    }
    if (possible.empty()) {
      const auto other = std::find_if(stamps.begin(), stamps.end(), [&](const TimeStamp& stamp) {
        return stamp.allows != stamps.front().allows;
      });
      refuse(static_cast<std::size_t>(other - stamps.begin()) % stamps.size(),
             "has day and month in another order than an earlier row");
      return std::nullopt;
    }
    if (possible.size() == 1) return possible[0];
    std::vector<std::pair<double, DateOrder>> spans;
    for (const DateOrder order : possible) {
      const std::vector<double> seconds = seconds_by(stamps, order);
      const auto [low, high] = std::minmax_element(seconds.begin(), seconds.end());
      const bool is_good =
          std::none_of(seconds.begin(), seconds.end(), [](double s) { return std::isnan(s); });
      if (is_good) spans.emplace_back(*high - *low, order);
    }
    std::sort(spans.begin(), spans.end(),
              [](const auto& a, const auto& b) { return a.first < b.first; });
    if (spans.size() == 1) return spans[0].second;
    if (spans.size() > 1 && spans[1].first > 5 * spans[0].first) return spans[0].second;
    const bool one_day = std::all_of(stamps.begin(), stamps.end(), [&](const TimeStamp& stamp) {
      return stamp.date == stamps.front().date;
    });
    if (!one_day)
      refuse(0,
             "may begin with the day or the month: write date_order = \"day.month.year\" or "
             "\"month.day.year\" in the file of --columns");
    return std::nullopt;
  }

  bool clock_is_clear(const std::vector<TimeStamp>& stamps) {
    const TimeStamp& first = stamps.front();
    if (first.has_date || first.clock_parts != 2 || !asked_unit().empty()) return true;
    refuse(0,
           "may be hours and minutes or minutes and seconds: write time_unit = \"hh:mm\" or "
           "\"mm:ss\" in the file of --columns");
    return false;
  }

  void note_stamps(const TimeStamp& first, std::optional<DateOrder> order, double first_s) {
    run_.note = "time_s: '" + table_.header[time_.columns[0]] + "'";
    if (time_.columns.size() == 2) run_.note += " and '" + table_.header[time_.columns[1]] + "'";
    if (time_.fraction) run_.note += " and '" + table_.header[*time_.fraction] + "'";
    if (first.has_date && !order) {
      run_.note +=
          ", seconds after the first row; the date may begin with the day or the month, which "
          "matters only for --join (date_order = \"day.month.year\" or \"month.day.year\" in the "
          "file of --columns)";
    } else if (first.has_date) {
      run_.note += *order == DateOrder::year_month_day   ? ", year-month-day"
                   : *order == DateOrder::month_day_year ? ", month/day/year"
                                                         : ", day.month.year";
      run_.note += ", seconds after the first row (" + date_text(first_s);
      run_.note += first.zone_s ? " UTC)" : ")";
    } else {
      run_.note += first.clock_parts == 2 && asked_unit() == "mm:ss" ? ", minutes:seconds"
                                                                     : ", time of the clock";
      run_.note +=
          ", seconds after the first row (" + std::string(table_.field(0, time_.columns[0])) + ")";
    }
  }

  /// Reports the first row only.
  bool refuse_form() {
    refuse(0, "must be a number or a time of a form that is read; docs/run_files.md lists them");
    return false;
  }

  void refuse(std::size_t row, std::string rule) {
    const std::size_t column = time_.columns[0];
    const std::string_view field = table_.field(row, column);
    problems_.add(table_.lines[row], table_.header[column], field.empty() ? "(missing)" : field,
                  std::move(rule));
  }

  const TextTable& table_;
  const TimeColumns& time_;
  const ColumnMap* map_;
  const std::vector<std::string>& units_;
  const NumberForm& form_;
  ProblemList& problems_;
  RunTime run_;
};

/// Possible time columns, by kind.
struct Candidates {
  std::vector<std::size_t> dates;   ///< with or without clock time
  std::vector<std::size_t> clocks;  ///< clock time only
  std::vector<std::size_t> epochs;
  std::vector<std::size_t> counting;  ///< numbers with a unit of time, or called time
};

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
  const auto named = std::find_if(dates.begin(), dates.end(), [&](std::size_t column) {
    return names_time(table.header[column]);
  });
  const auto named_count = std::count_if(dates.begin(), dates.end(), [&](std::size_t column) {
    return names_time(table.header[column]);
  });
  if (named_count == 1) dates = {*named};
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

/// Whether the map makes another use of the column.
bool is_used(const ColumnMap* map, const std::string& header) {
  return map != nullptr &&
         (map->columns.contains(header) ||
          std::find(map->ignored.begin(), map->ignored.end(), header) != map->ignored.end());
}

Candidates candidates(const TextTable& table, const ColumnMap* map,
                      const std::vector<std::string>& units, const NumberForm& form) {
  Candidates found;
  for (std::size_t i = 0; i < table.columns(); ++i) {
    const std::string& header = table.header[i];
    if (is_used(map, header)) continue;
    const Holds here = content(table, i);
    const SpelledUnit* unit = spelled_unit(units[i]);
    const bool is_time = unit != nullptr && unit->dimension == "time";
    if (here == Holds::date || here == Holds::both)
      found.dates.push_back(i);
    else if (here == Holds::clock)
      found.clocks.push_back(i);
    else if (epoch_of(first_numbers(table, i, form), names_date(header), is_time) != nullptr)
      found.epochs.push_back(i);
    else if (names_time(header) || !unit_of_time_name(header).empty() || is_time)
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
  if (dates == 1 && found.clocks.size() == 1 && content(table, found.dates[0]) == Holds::date)
    return TimeColumns{{found.dates[0], found.clocks[0]}, {}};
  const bool is_finer =
      found.counting.size() == 1 && numbers_increase(table, found.counting[0], form);
  if (dates == 1 && is_finer && !increases(table, found.dates[0]))
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
  if (next >= table.columns() || time.has(next) || is_used(map, table.header[next])) return;
  const std::string name = small_letters(table.header[next]);
  const SpelledUnit* unit = spelled_unit(name == "millitm" || name == "millis" ? "ms" : name);
  if (unit == nullptr || unit->dimension != "time") return;
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

}  // namespace

bool TimeColumns::has(std::size_t column) const {
  return column == fraction || std::find(columns.begin(), columns.end(), column) != columns.end();
}

std::optional<TimeColumns> find_time(const TextTable& table, const ColumnMap* map,
                                     const std::vector<std::string>& units, const NumberForm& form,
                                     ProblemList& problems) {
  auto time = find_clock(table, map, units, form, problems);
  if (time) find_fraction(table, map, form, *time);
  return time;
}
RunTime read_time(const TextTable& table, const TimeColumns& time, const ColumnMap* map,
                  const std::vector<std::string>& units, const NumberForm& form,
                  ProblemList& problems) {
  return TimeReader(table, time, map, units, form, problems).read();
}

}  // namespace thermocomp
