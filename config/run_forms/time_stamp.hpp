/// Times as people write them: 2026-03-01T08:30:00+01:00, 01.03.2026 08:30, 3/1/2026 8:30:00 PM,
/// 01-Mar-2026, 08:30:15,250.
#pragma once

#include <optional>
#include <string_view>

#include "config/run_forms/column_map.hpp"

namespace thermocomp {

/// The parts of one time, before it is known which of day and month stands first.
struct TimeStamp {
  bool has_date{false};
  int year{0};
  int first{0};   ///< day or month; with `order` known see there
  int second{0};  ///< the other
  /// What the spelling itself says: a year or a month's name in front, points, a number above 12.
  DateOrder order{DateOrder::unknown};

  bool has_clock{false};
  int clock_parts{0};   ///< 2: hh:mm or mm:ss; 3: hh:mm:ss
  double clock_a{0.0};  ///< the number in front of the first colon
  double clock_b{0.0};
  double clock_c{0.0};
  std::optional<double> zone_s;  ///< east of Greenwich
};

/// @return nullopt when `text` is neither a date nor a clock time. A day that no calendar has is
///         found by seconds_of(), not here.
[[nodiscard]] std::optional<TimeStamp> parse_time_stamp(std::string_view text);

/// Seconds since 1970 in the stamp's own zone or, where it has one, in UTC; without a date since
/// midnight. `order` decides where the stamp does not. A clock of two parts is hours and minutes
/// unless `minutes_first`.
/// @return nullopt when the calendar has no such day
[[nodiscard]] std::optional<double> seconds_of(const TimeStamp& stamp, DateOrder order,
                                               bool minutes_first);

/// "2026-03-01 08:30:00"
[[nodiscard]] std::string date_text(double seconds_since_1970);

}  // namespace thermocomp
