#include "config/run_forms/time_stamp.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>

#include "config/run_forms/field_text.hpp"

namespace thermocomp {
namespace {

constexpr std::array<std::string_view, 12> month_names{"jan", "feb", "mar", "apr", "may", "jun",
                                                       "jul", "aug", "sep", "oct", "nov", "dec"};

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// Takes one to `digits_max` digits off the front.
std::optional<int> take_digits(std::string_view& text, std::size_t digits_max) {
  std::size_t count = 0;
  int value = 0;
  for (; count < text.size() && count < digits_max && is_digit(text[count]); ++count)
    value = 10 * value + (text[count] - '0');
  if (count == 0) return std::nullopt;
  text.remove_prefix(count);
  return value;
}

bool take_char(std::string_view& text, std::string_view any_of) {
  if (text.empty() || any_of.find(text.front()) == std::string_view::npos) return false;
  text.remove_prefix(1);
  return true;
}

std::optional<int> take_month_name(std::string_view& text) {
  if (text.size() < 3) return std::nullopt;
  std::string name(text.substr(0, 3));
  for (char& c : name) c = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  const auto* const found = std::find(month_names.begin(), month_names.end(), name);
  if (found == month_names.end()) return std::nullopt;
  text.remove_prefix(3);
  return static_cast<int>(found - month_names.begin()) + 1;
}

/// 2026-03-01, 01.03.2026, 3/1/2026, 01-Mar-2026.
bool take_date(std::string_view& text, TimeStamp& stamp) {
  std::string_view rest = text;
  const auto a = take_digits(rest, 4);
  const std::size_t a_digits = text.size() - rest.size();
  if (!a || rest.empty()) return false;
  const char separator = rest.front();
  if (!take_char(rest, "-./ ")) return false;
  std::optional<int> b = take_digits(rest, 2);
  const bool named = !b;
  if (named) b = take_month_name(rest);
  if (!b || rest.empty() || rest.front() != separator) return false;
  rest.remove_prefix(1);
  const std::size_t before = rest.size();
  const auto c = take_digits(rest, 4);
  const std::size_t c_digits = before - rest.size();
  if (!c || (!rest.empty() && is_digit(rest.front()))) return false;
  if (separator == ' ' && !named) return false;
  stamp.has_date = true;
  if (a_digits == 4 && c_digits <= 2) {
    stamp.year = *a;
    stamp.first = *c;
    stamp.second = *b;
    stamp.order = DateOrder::day_month_year;
  } else if (a_digits <= 2 && c_digits == 4) {
    stamp.year = *c;
    stamp.first = *a;
    stamp.second = *b;
    if (separator == '.' || named || *a > 12)
      stamp.order = DateOrder::day_month_year;
    else if (*b > 12)
      stamp.order = DateOrder::month_day_year;
  } else {
    return false;
  }
  text = rest;
  return true;
}

std::optional<double> take_zone(std::string_view& text) {
  if (take_char(text, "Zz")) return 0.0;
  const bool west = !text.empty() && text.front() == '-';
  if (!take_char(text, "+-")) return std::nullopt;
  const auto hours = take_digits(text, 2);
  take_char(text, ":");
  const int minutes = take_digits(text, 2).value_or(0);
  if (!hours) return std::nullopt;
  return (west ? -60.0 : 60.0) * (60 * *hours + minutes);
}

/// "PM", "am": 12 hours are added or the hour 12 is 0.
bool take_half_of_day(std::string_view& text, TimeStamp& stamp) {
  text = trimmed(text);
  if (text.size() != 2 || (text[1] != 'M' && text[1] != 'm')) return text.empty();
  const bool afternoon = text[0] == 'P' || text[0] == 'p';
  if (!afternoon && text[0] != 'A' && text[0] != 'a') return false;
  if (!(stamp.clock_a >= 1 && stamp.clock_a <= 12)) return false;
  stamp.clock_a = (stamp.clock_a == 12 ? 0 : stamp.clock_a) + (afternoon ? 12 : 0);
  text = {};
  return true;
}

/// 8:30, 08:30:15, 08:30:15.250, 26:15:00; then a zone or AM, PM.
bool take_clock(std::string_view& text, TimeStamp& stamp) {
  std::string_view rest = text;
  const auto a = take_digits(rest, 5);
  if (!a || !take_char(rest, ":")) return false;
  const auto b = take_digits(rest, 2);
  if (!b || *b > 59) return false;
  stamp.clock_a = *a;
  stamp.clock_b = *b;
  stamp.clock_parts = 2;
  if (take_char(rest, ":")) {
    const auto c = take_digits(rest, 2);
    if (!c || *c > 60) return false;  // a leap second
    stamp.clock_parts = 3;
    stamp.clock_c = *c;
  }
  if (take_char(rest, ".,")) {
    double unit = 0.1;
    double fraction = 0.0;
    if (rest.empty() || !is_digit(rest.front())) return false;
    for (; !rest.empty() && is_digit(rest.front()); rest.remove_prefix(1), unit /= 10)
      fraction += unit * (rest.front() - '0');
    (stamp.clock_parts == 3 ? stamp.clock_c : stamp.clock_b) += fraction;
  }
  stamp.has_clock = true;
  if (!rest.empty() && std::string_view("Zz+-").find(rest.front()) != std::string_view::npos) {
    stamp.zone_s = take_zone(rest);
    if (!stamp.zone_s) return false;
  } else if (!take_half_of_day(rest, stamp)) {
    return false;
  }
  text = rest;
  return text.empty();
}

}  // namespace

std::optional<TimeStamp> parse_time_stamp(std::string_view text) {
  text = trimmed(text);
  TimeStamp stamp;
  if (take_date(text, stamp)) {
    if (text.empty()) return stamp;
    if (!take_char(text, "T _")) return std::nullopt;
    text = trimmed(text);
  }
  if (!take_clock(text, stamp)) return std::nullopt;
  return stamp;
}

std::optional<double> seconds_of(const TimeStamp& stamp, DateOrder order, bool minutes_first) {
  double seconds = 0.0;
  if (stamp.has_date) {
    const DateOrder known = stamp.order == DateOrder::unknown ? order : stamp.order;
    const bool day_first = known != DateOrder::month_day_year;
    const auto day = static_cast<unsigned>(day_first ? stamp.first : stamp.second);
    const auto month = static_cast<unsigned>(day_first ? stamp.second : stamp.first);
    const std::chrono::year_month_day date{std::chrono::year{stamp.year}, std::chrono::month{month},
                                           std::chrono::day{day}};
    if (!date.ok() || (stamp.has_clock && stamp.clock_a > 24)) return std::nullopt;
    const auto days = std::chrono::sys_days(date).time_since_epoch().count();
    seconds = 86400.0 * static_cast<double>(days);
  }
  if (stamp.has_clock && stamp.clock_parts == 2 && minutes_first)
    seconds += 60.0 * stamp.clock_a + stamp.clock_b;
  else
    seconds += 3600.0 * stamp.clock_a + 60.0 * stamp.clock_b + stamp.clock_c;
  return seconds - stamp.zone_s.value_or(0.0);
}

std::string date_text(double seconds_since_1970) {
  constexpr double day_s = 86400.0;
  const auto days = static_cast<int>(std::floor(seconds_since_1970 / day_s));
  const std::chrono::year_month_day date{std::chrono::sys_days{std::chrono::days{days}}};
  const auto second = static_cast<int>(seconds_since_1970 - day_s * days);
  char text[64];
  std::snprintf(text, sizeof text, "%04d-%02u-%02u %02d:%02d:%02d", static_cast<int>(date.year()),
                static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                second / 3600, second / 60 % 60, second % 60);
  return text;
}

}  // namespace thermocomp
