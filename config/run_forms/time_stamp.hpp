/// Detection of a time column: by its name, by numbers since an epoch, by time stamps. Their parser
/// reads 2026-03-01T08:30:00+01:00, 01.03.2026 08:30, 3/1/26 8:30:00 PM, 01-Mar-2026, Mar 1, 2026,
/// 2026/03/01-08:30:15, 20260301T083015Z, 08:30:15,250.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "config/run_forms/column_map.hpp"

namespace thermocomp {

inline constexpr std::array date_orders{DateOrder::year_month_day, DateOrder::day_month_year,
                                        DateOrder::month_day_year};

/// The parts of a time stamp, before the order of day, month and year is known.
struct TimeStamp {
  bool has_date{false};
  bool has_points{false};     ///< 13.04.26, which usually begins with the day
  std::array<int, 3> date{};  ///< in written order; a month's name is its number
  /// The orders that the spelling allows; up to three for two-digit years and slashes.
  std::array<bool, 4> allows{};  ///< by DateOrder
  [[nodiscard]] bool allows_order(DateOrder order) const noexcept {
    return allows[static_cast<std::size_t>(order)];
  }

  bool has_clock{false};
  int clock_parts{0};   ///< 2: hh:mm or mm:ss; 3: hh:mm:ss
  double clock_a{0.0};  ///< the number before the first colon
  double clock_b{0.0};
  double clock_c{0.0};
  int fraction_digits{0};
  /// The fraction may be a number of ms (8:00:00:3, 8:00:00.20) if other rows have other numbers of
  /// digits: it follows a colon, or ends in 0.
  bool may_count_ms{false};
  std::optional<double> zone_s;  ///< east of Greenwich
  [[nodiscard]] bool is_midnight() const noexcept {
    return has_clock && clock_a == 0.0 && clock_b == 0.0 && clock_c == 0.0;
  }
};

/// @return nullopt when `text` is neither a date nor a clock time. Nonexistent days are found by
///         seconds_of(), not here.
[[nodiscard]] std::optional<TimeStamp> parse_time_stamp(std::string_view text);

/// Seconds since 1970 in the stamp's own zone or, if it has one, in UTC; without a date since
/// midnight. A clock time of two parts is hours and minutes unless `minutes_first`.
/// @param order  unknown: the first one allowed
/// @return nullopt when the day does not exist, or the stamp does not allow the order
[[nodiscard]] std::optional<double> seconds_of(const TimeStamp& stamp, DateOrder order,
                                               bool minutes_first);
/// Seconds since 1970; years below 100 are 1970 to 2069. @return nullopt: no such day
[[nodiscard]] std::optional<double> seconds_of_day(int year, int month, int day);

/// "2026-03-01 08:30:00"
[[nodiscard]] std::string date_text(double seconds_since_1970);

/// "Zeit", "elapsed time", "timestamp [ms]"
[[nodiscard]] bool names_time(std::string_view header);

/// Names that are usual for dates, also as numbers with an epoch.
[[nodiscard]] bool names_date(std::string_view header);

/// The unit at the end of a time column's name, "time_ms"; empty: none.
[[nodiscard]] std::string_view unit_of_time_name(std::string_view header);

/// "Date Time, GMT+01:00": time zone of the column.
[[nodiscard]] std::optional<double> zone_of_header(std::string_view header);

/// 95950, 100000, 100010: equal steps only as hours, minutes and seconds.
[[nodiscard]] bool are_clock_digits(const std::vector<double>& numbers);

/// Origin and unit of times that are numbers.
struct Epoch {
  const char* name;
  double low;  ///< the range is the years 2001 to about 2050
  double high;
  double per_second;
  double zero_s;    ///< since 1970
  bool only_named;  ///< small, hence ambiguous: the column must be called date or time
  bool is_utc;
};

/// The epoch indicated by the size of a column's numbers; nullptr: none.
/// @param is_named  the column is called date or time, or has a unit of time
/// @param has_unit  without a unit, numbers of which no two are within an hour may count something
/// else
[[nodiscard]] const Epoch* epoch_of(const std::vector<double>& numbers, bool is_named,
                                    bool has_unit);

}  // namespace thermocomp
