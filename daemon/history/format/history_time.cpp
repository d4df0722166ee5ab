#include "daemon/history/format/history_time.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <ctime>
#include <fmt/chrono.h>
#include <regex>
#include <stdexcept>
#include <string_view>
#include <utility>

#include <system_error>

namespace thermocomp {
namespace {

std::optional<std::int64_t> parse_wall_ns(const std::string& text) {
  static const std::regex form(
      R"((\d{4})-(\d\d)-(\d\d)([T ](\d\d):(\d\d)(:(\d\d))?(Z|[+-](\d\d):(\d\d))?)?)");
  std::smatch found;
  if (!std::regex_match(text, found, form)) return std::nullopt;
  const auto part = [&](std::size_t i) { return found[i].matched ? std::stoi(found[i]) : 0; };
  std::tm parts{};
  parts.tm_year = part(1) - 1900;
  parts.tm_mon = part(2) - 1;
  parts.tm_mday = part(3);
  parts.tm_hour = part(5);
  parts.tm_min = part(6);
  parts.tm_sec = part(8);
  parts.tm_isdst = -1;
  const std::string zone = found[9];
  if (parts.tm_year < 70 || parts.tm_mon < 0 || parts.tm_mon > 11 || parts.tm_hour > 23 ||
      parts.tm_min > 59 || parts.tm_sec > 59 || part(10) > 14 || part(11) > 59)
    return std::nullopt;
  const int seconds_east = (zone[0] == '-' ? -1 : 1) * (part(10) * 3600 + part(11) * 60);
  std::tm normal = parts;
  const std::time_t seconds = zone.empty() ? mktime(&normal) : timegm(&normal) - seconds_east;
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
  const std::chrono::sys_time<std::chrono::nanoseconds> wall{std::chrono::nanoseconds(wall_ns)};
  const auto seconds = std::chrono::floor<std::chrono::seconds>(wall);
  const auto part = std::chrono::floor<std::chrono::milliseconds>(wall - seconds);
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:03}Z", fmt::gmtime(seconds.time_since_epoch().count()),
                     part.count());
}

}  // namespace thermocomp
