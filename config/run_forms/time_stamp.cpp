#include "config/run_forms/time_stamp.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>

#include "config/run_forms/field_text.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

constexpr std::array<std::string_view, 24> month_names{
    "jan", "feb", "mar", "apr", "may", "jun", "jul", "aug", "sep", "oct", "nov", "dec",
    "jan", "feb", "mrz", "apr", "mai", "jun", "jul", "aug", "sep", "okt", "nov", "dez"};

/// Takes one to `digits_max` leading digits.
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
  const std::string name = small_letters(text.substr(0, 3));
  const auto* const found = std::find(month_names.begin(), month_names.end(), name);
  if (found == month_names.end()) return std::nullopt;
  text.remove_prefix(3);
  return static_cast<int>((found - month_names.begin()) % 12) + 1;
}

bool take_day_name(std::string_view& text) {
  constexpr std::array<std::string_view, 7> days{"Mon", "Tue", "Wed", "Thu", "Fri", "Sat", "Sun"};
  if (std::none_of(days.begin(), days.end(), [&](auto day) { return text.starts_with(day); }))
    return false;
  text = trimmed(text.substr(3));
  take_char(text, ",");
  text = trimmed(text);
  return true;
}

/// A number in a date and its count of digits; 0 for a month's name.
struct DatePart {
  int value{0};
  std::size_t digits{0};
};

std::optional<DatePart> take_date_part(std::string_view& text) {
  const std::size_t before = text.size();
  if (const auto number = take_digits(text, 4)) return DatePart{*number, before - text.size()};
  if (const auto month = take_month_name(text)) return DatePart{*month, 0};
  return std::nullopt;
}

/// Determines the orders of day, month and year that three parts allow.
void find_orders(const std::array<DatePart, 3>& parts, char separator, TimeStamp& stamp) {
  const auto allow = [&](DateOrder order, std::size_t day, std::size_t month, std::size_t year) {
    const bool is_year = parts[year].digits == 4 || parts[year].digits == 2;
    const bool others_short = parts[day].digits <= 2 && parts[month].digits <= 2;
    const bool named = parts[0].digits == 0 || parts[1].digits == 0;
    if (!is_year || !others_short || parts[day].digits == 0) return;
    if (named && parts[month].digits != 0) return;
    const bool in_range = parts[month].value <= 12 && parts[day].value <= 31;
    if (parts[year].digits == 4 || in_range) stamp.allows[static_cast<std::size_t>(order)] = true;
  };
  const bool is_long =
      std::any_of(parts.begin(), parts.end(), [](auto p) { return p.digits == 4; });
  const auto year_is = [&](std::size_t i) { return !is_long || parts[i].digits == 4; };
  if (year_is(2)) {
    const bool by_points = separator == '.';
    if (by_points || parts[0].digits == 0 || parts[1].value <= 12 || parts[0].value > 12)
      allow(DateOrder::day_month_year, 0, 1, 2);
    if (!by_points && (parts[0].digits == 0 || parts[0].value <= 12))
      allow(DateOrder::month_day_year, 1, 0, 2);
  }
  if (year_is(0)) allow(DateOrder::year_month_day, 2, 1, 0);
  stamp.has_points = separator == '.' && !is_long;
}

/// 20260301123000
bool is_all_digits_of_time(std::string_view text) {
  return text.size() == 14 && std::all_of(text.begin(), text.end(), is_digit);
}

/// 2026-03-01, 01.03.2026, 3/1/26, 01-Mar-2026, Mar 1, 2026, 20260301.
bool take_date(std::string_view& text, TimeStamp& stamp) {
  std::string_view rest = text;
  take_day_name(rest);
  std::array<DatePart, 3> parts{};
  char separator = ' ';
  const auto compact = rest.substr(0, 8);
  if (compact.size() == 8 && std::all_of(compact.begin(), compact.end(), is_digit) &&
      (rest.size() == 8 || is_all_digits_of_time(rest) ||
       std::string_view("T_ -").find(rest[8]) != std::string_view::npos)) {
    parts[0] = {*take_digits(rest, 4), 4};
    parts[1] = {*take_digits(rest, 2), 2};
    parts[2] = {*take_digits(rest, 2), 2};
    if (!(parts[0].value >= 1900 && parts[0].value < 2100 && parts[1].value <= 12)) return false;
    separator = '-';
  } else {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto part = take_date_part(rest);
      if (!part) return false;
      parts[i] = *part;
      if (i == 2) break;
      if (rest.empty() || std::string_view("-./ ,").find(rest.front()) == std::string_view::npos)
        return false;
      const char here = rest.front();
      const bool named = parts[0].digits == 0 || (i == 1 && parts[1].digits == 0);
      if (i == 1 && here != separator && !(named && here == ',')) return false;
      separator = i == 0 ? here : separator;
      rest.remove_prefix(1);
      if (here == ',' || here == ' ') rest = trimmed(rest);
    }
  }
  const bool named = parts[0].digits == 0 || parts[1].digits == 0;
  if ((separator == ' ' && !named) || separator == ',' || parts[2].digits == 0 ||
      (!rest.empty() && is_digit(rest.front()) && !is_all_digits_of_time(text)))
    return false;
  find_orders(parts, separator, stamp);
  if (std::none_of(stamp.allows.begin(), stamp.allows.end(), [](bool each) { return each; }))
    return false;
  for (std::size_t i = 0; i < 3; ++i) stamp.date[i] = parts[i].value;
  stamp.has_date = true;
  text = rest;
  return true;
}

std::optional<double> take_zone(std::string_view& text) {
  text = trimmed(text);
  bool is_utc = false;
  for (const std::string_view name : {"UTC", "GMT", "Z", "z"}) {
    if (is_utc || !text.starts_with(name)) continue;
    text.remove_prefix(name.size());
    is_utc = true;
  }
  const bool west = !text.empty() && text.front() == '-';
  if (!take_char(text, "+-")) return is_utc ? std::optional(0.0) : std::nullopt;
  const auto hours = take_digits(text, 2);
  take_char(text, ":");
  const int minutes = take_digits(text, 2).value_or(0);
  if (!hours) return std::nullopt;
  if (trimmed(text) == "UTC") text = {};
  return (west ? -60.0 : 60.0) * (60 * *hours + minutes);
}

/// "PM", "am": adds 12 hours, or makes hour 12 hour 0.
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

/// 8:30, 08:30:15, 08:30:15.250, 08:30:15:250, 26:15:00, 083015; then a zone or AM, PM.
bool take_clock(std::string_view& text, TimeStamp& stamp) {
  std::string_view rest = text;
  const std::string_view compact = rest.substr(0, 6);
  std::string spelled;
  if (stamp.has_date && compact.size() == 6 &&
      std::all_of(compact.begin(), compact.end(), is_digit)) {
    for (const std::size_t at : {0U, 2U, 4U})
      spelled.append(at > 0 ? ":" : "").append(compact.substr(at, 2));
    spelled.append(rest.substr(6));
    rest = spelled;
  }
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
  const bool has_colon = rest.starts_with(':');
  if (take_char(rest, stamp.clock_parts == 3 ? ".,:" : ".,")) {
    double unit = 0.1;
    double fraction = 0.0;
    if (rest.empty() || !is_digit(rest.front())) return false;
    for (; !rest.empty() && is_digit(rest.front()); rest.remove_prefix(1), unit /= 10) {
      fraction += unit * (rest.front() - '0');
      ++stamp.fraction_digits;
      stamp.may_count_ms = has_colon || (stamp.fraction_digits > 1 && rest.front() == '0');
    }
    (stamp.clock_parts == 3 ? stamp.clock_c : stamp.clock_b) += fraction;
  }
  stamp.has_clock = true;
  rest = trimmed(rest);
  if (!rest.empty() && std::string_view("ZzUG+-").find(rest.front()) != std::string_view::npos) {
    stamp.zone_s = take_zone(rest);
    if (!stamp.zone_s) return false;
  } else if (!take_half_of_day(rest, stamp)) {
    return false;
  }
  return rest.empty();
}

/// Moves the year of ctime's "Wed Jun 11 11:50:00 2026" to the front.
std::string year_in_front(std::string_view text) {
  take_day_name(text);
  if (text.size() < 18 || text[text.size() - 5] != ' ') return {};
  const std::string_view year = text.substr(text.size() - 4);
  const auto clock = text.find(':');
  if (clock == std::string_view::npos || clock < 6 ||
      !std::all_of(year.begin(), year.end(), is_digit))
    return {};
  const std::string_view day = trimmed(text.substr(0, clock - 2));
  return std::string(day) + " " + std::string(year) + " " +
         std::string(text.substr(clock - 2, text.size() - 5 - (clock - 2)));
}

}  // namespace

std::optional<TimeStamp> parse_time_stamp(std::string_view text) {
  text = trimmed(text);
  TimeStamp stamp;
  // Quick rejection: most fields of text are not dates.
  if (text.size() < 4 || text.size() > 64) return std::nullopt;
  const std::string_view whole = text;
  std::string turned;
  if (!is_digit(text.front())) {
    turned = year_in_front(text);
    if (!turned.empty()) text = turned;
  }
  if (take_date(text, stamp)) {
    if (trimmed(text).empty()) return stamp;
    if (!is_all_digits_of_time(whole) && !take_char(text, "T _-,")) return std::nullopt;
    text = trimmed(text);
  }
  if (!take_clock(text, stamp)) return std::nullopt;
  // The day 0 of databases: only a clock time.
  constexpr std::array day_0{30, 12, 1899};
  if (stamp.has_date && (stamp.date == day_0 || stamp.date == std::array{1899, 12, 30})) {
    stamp.has_date = false;
    stamp.allows = {};
  }
  return stamp;
}

std::optional<double> parse_zone(std::string_view text) {
  const auto zone = take_zone(text);
  return trimmed(text).empty() ? zone : std::nullopt;
}

std::optional<double> seconds_of_day(int year, int month, int day) {
  if (year < 100) year += year < 70 ? 2000 : 1900;
  const std::chrono::year_month_day date{std::chrono::year{year},
                                         std::chrono::month{static_cast<unsigned>(month)},
                                         std::chrono::day{static_cast<unsigned>(day)}};
  if (!date.ok()) return std::nullopt;
  return 86400.0 * static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
}

std::optional<double> seconds_of(const TimeStamp& stamp, DateOrder order, bool minutes_first) {
  double seconds = 0.0;
  if (stamp.has_date) {
    for (const DateOrder each : date_orders)
      if (order == DateOrder::unknown && stamp.allows_order(each)) order = each;
    if (!stamp.allows_order(order) || (stamp.has_clock && stamp.clock_a > 24)) return std::nullopt;
    const auto& [a, b, c] = stamp.date;
    const auto day = order == DateOrder::day_month_year   ? seconds_of_day(c, b, a)
                     : order == DateOrder::month_day_year ? seconds_of_day(c, a, b)
                                                          : seconds_of_day(a, b, c);
    if (!day) return std::nullopt;
    seconds = *day;
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
