#include "daemon/history/format/history_time.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <system_error>

namespace thermocomp {
namespace {

int digits(std::string_view text, std::size_t from, std::size_t count) {
  int value = -1;
  if (from + count > text.size()) return -1;
  const char* begin = text.data() + from;
  const auto [end, code] = std::from_chars(begin, begin + count, value);
  return code == std::errc() && end == begin + count && text[from] != '-' ? value : -1;
}

/// "", "Z", "+hh:mm", "-hh:mm". @return false if it is none of these
bool parse_zone(std::string_view text, bool& is_local, int& seconds_east) {
  is_local = text.empty();
  seconds_east = 0;
  if (text.empty() || text == "Z") return true;
  const int hours = digits(text, 1, 2);
  const int minutes = digits(text, 4, 2);
  if (text.size() != 6 || (text[0] != '+' && text[0] != '-') || text[3] != ':' || hours < 0 ||
      hours > 14 || minutes < 0 || minutes > 59) {
    return false;
  }
  seconds_east = (text[0] == '-' ? -1 : 1) * (hours * 3600 + minutes * 60);
  return true;
}

std::optional<std::int64_t> parse_wall_ns(std::string_view text) {
  std::tm parts{};
  const int year = digits(text, 0, 4);
  const int month = digits(text, 5, 2);
  const int day = digits(text, 8, 2);
  if (text.size() < 10 || text[4] != '-' || text[7] != '-' || year < 1970 || month < 1 ||
      month > 12 || day < 1 || day > 31) {
    return std::nullopt;
  }
  parts.tm_year = year - 1900;
  parts.tm_mon = month - 1;
  parts.tm_mday = day;
  parts.tm_isdst = -1;
  std::string_view zone;
  if (text.size() > 10) {
    const int hour = digits(text, 11, 2);
    const int minute = digits(text, 14, 2);
    const bool has_seconds = text.size() > 16 && text[16] == ':';
    const int second = has_seconds ? digits(text, 17, 2) : 0;
    if ((text[10] != 'T' && text[10] != ' ') || text.size() < 16 || text[13] != ':' || hour < 0 ||
        hour > 23 || minute < 0 || minute > 59 || second < 0 || second > 59) {
      return std::nullopt;
    }
    parts.tm_hour = hour;
    parts.tm_min = minute;
    parts.tm_sec = second;
    zone = text.substr(has_seconds ? 19 : 16);
  }
  bool is_local = false;
  int seconds_east = 0;
  if (!parse_zone(zone, is_local, seconds_east)) return std::nullopt;
  std::tm normal = parts;
  const std::time_t seconds = is_local ? mktime(&normal) : timegm(&normal) - seconds_east;
  if (normal.tm_mday != parts.tm_mday) return std::nullopt;  // such as 31 February
  return static_cast<std::int64_t>(seconds) * 1'000'000'000;
}

/// Seconds of a unit of time; 0 if unknown.
double seconds_of_unit(std::string_view unit) {
  constexpr std::array<std::pair<std::string_view, double>, 20> units{{
      {"s", 1.0},        {"sec", 1.0},       {"second", 1.0},     {"seconds", 1.0},
      {"m", 60.0},       {"min", 60.0},      {"mins", 60.0},      {"minute", 60.0},
      {"minutes", 60.0}, {"h", 3600.0},      {"hr", 3600.0},      {"hour", 3600.0},
      {"hours", 3600.0}, {"d", 86400.0},     {"day", 86400.0},    {"days", 86400.0},
      {"w", 604800.0},   {"week", 604800.0}, {"weeks", 604800.0}, {"hrs", 3600.0},
  }};
  for (const auto& [name, seconds] : units)
    if (name == unit) return seconds;
  return 0.0;
}

/// Wall time of "now", "8 hours ago", "-8h".
std::optional<std::int64_t> parse_ago_ns(std::string_view text, std::chrono::nanoseconds now) {
  constexpr std::string_view ago = " ago";
  constexpr double seconds_max = 100.0 * 366.0 * 86400.0;
  if (text == "now") return now.count();
  if (text.starts_with('-'))
    text.remove_prefix(1);
  else if (text.ends_with(ago))
    text.remove_suffix(ago.size());
  else
    return std::nullopt;
  double amount = 0.0;
  const auto [rest, code] = std::from_chars(text.data(), text.data() + text.size(), amount);
  if (code != std::errc()) return std::nullopt;
  text.remove_prefix(static_cast<std::size_t>(rest - text.data()));
  while (text.starts_with(' ')) text.remove_prefix(1);
  const double seconds = amount * seconds_of_unit(text);
  if (!(seconds > 0.0 && seconds < seconds_max)) return std::nullopt;
  return now.count() - static_cast<std::int64_t>(seconds * 1e9);
}

}  // namespace

HistoryTime parse_history_time(const std::string& text, std::chrono::nanoseconds now) {
  HistoryTime time;
  double seconds = 0.0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data(), end, seconds);
  if (code == std::errc() && rest == end && std::isfinite(seconds)) {
    time.seconds = seconds;
    return time;
  }
  time.wall_ns = parse_ago_ns(text, now);
  if (!time.wall_ns) time.wall_ns = parse_wall_ns(text);
  if (!time.wall_ns) {
    throw std::invalid_argument("time = " + text +
                                ": must be seconds since the start of the history, a wall time"
                                " like 2026-03-01T08:30:00 or 2026-03-01, or a time before now"
                                " like \"8 hours ago\" or -8h");
  }
  return time;
}

std::string utc_text(std::int64_t wall_ns) {
  constexpr std::int64_t second_ns = 1'000'000'000;
  std::int64_t part_ns = wall_ns % second_ns;
  if (part_ns < 0) part_ns += second_ns;
  const auto seconds = static_cast<std::time_t>((wall_ns - part_ns) / second_ns);
  std::tm parts{};
  if (gmtime_r(&seconds, &parts) == nullptr) return "unknown";
  std::array<char, 40> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%S", &parts);
  std::array<char, 56> whole{};
  std::snprintf(whole.data(), whole.size(), "%s.%03dZ", text.data(),
                static_cast<int>(part_ns / 1'000'000));
  return whole.data();
}

}  // namespace thermocomp
