#include "config/run_forms/time_name.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <string>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"

namespace thermocomp {
namespace {

constexpr auto time_names = std::to_array<std::string_view>(
    {"time",          "zeit",      "timestamp", "zeitstempel",  "datetime",     "date",
     "datum",         "uhrzeit",   "elapsed",   "elapsed time", "date time",    "date/time",
     "datum/uhrzeit", "t_s",       "laufzeit",  "ts",           "_time",        "x_value",
     "unixtime",      "unix_time", "epoch",     "seconds",      "last_changed", "elapsed_time",
     "time stamp",    "scan time", "date_time", "sample time",  "sec",          "clock",
     "unix"});
constexpr auto date_names =
    std::to_array<std::string_view>({"date", "datum", "datetime", "date time", "date/time",
                                     "datum/uhrzeit", "time", "zeit", "timestamp", "zeitstempel"});

constexpr double s_per_day = 86400.0;

constexpr std::array<Epoch, 8> epochs{{
    {"s since 1970", 1e9, 2.5e9, 1, 0, false, true},
    {"ms since 1970", 1e12, 2.5e12, 1e3, 0, false, true},
    {"us since 1970", 1e15, 2.5e15, 1e6, 0, false, true},
    {"ns since 1970", 1e18, 2.5e18, 1e9, 0, false, true},
    {"s since 1904", 3.1e9, 4.6e9, 1, -2082844800.0, true, true},
    {"100 ns since 1601", 1.25e17, 1.42e17, 1e7, -11644473600.0, false, true},
    {"day", 20000, 80000, 1 / s_per_day, -25569 * s_per_day, true, false},
    {"days since the year 0", 7.2e5, 7.6e5, 1 / s_per_day, -719529 * s_per_day, true, false},
}};

/// True if two neighbours differ by at most `step_max`, or no two differ.
bool has_steps_below(double step_max, const std::vector<double>& numbers) {
  double least = INFINITY;
  for (std::size_t i = 1; i < numbers.size(); ++i)
    if (const double step = std::abs(numbers[i] - numbers[i - 1]); step > 0)
      least = std::min(least, step);
  return std::isinf(least) || least <= step_max;
}

bool are_multiples_of(double unit, const std::vector<double>& numbers) {
  return std::all_of(numbers.begin(), numbers.end(), [unit](double number) {
    return std::abs(number / unit - std::round(number / unit)) < 1e-6;
  });
}

/// "Date Time, GMT+01:00" without what follows the comma.
bool is_named_like(std::span<const std::string_view> names, std::string_view header) {
  const std::string base = spelled_name(header).base;
  return is_one_of(names, std::string_view(base).substr(0, base.find(',')));
}

}  // namespace

bool names_time(std::string_view header) {
  return is_named_like(time_names, header);
}

bool names_date(std::string_view header) {
  return is_named_like(date_names, header);
}

std::string_view unit_of_time_name(std::string_view header) {
  const auto bar = header.rfind('_');
  if (bar == std::string_view::npos || bar == 0 || !names_time(header.substr(0, bar))) return {};
  const SpelledUnit* unit = time_unit(header.substr(bar + 1));
  return unit != nullptr ? unit->spelling : std::string_view();
}

std::optional<double> zone_of_header(std::string_view header) {
  for (const std::string_view name : {"GMT", "UTC"}) {
    const auto at = header.find(name);
    if (at == std::string_view::npos) continue;
    std::string_view zone = header.substr(at);
    zone = zone.substr(0, zone.find_first_of(" )]"));
    return parse_zone(zone);
  }
  return std::nullopt;
}

const Epoch* epoch_of(const std::vector<double>& numbers, bool is_named, bool has_unit) {
  constexpr double step_s_max = 3600.0;
  for (const Epoch& epoch : epochs) {
    if (epoch.only_named && !is_named) continue;
    // Whole numbers of that size may be ms of a counter of 32 bits.
    if (epoch.only_named && epoch.per_second == 1 && !has_unit && are_multiples_of(1, numbers))
      continue;
    // No clock goes in steps of 86.4 s: these are seconds.
    if (epoch.per_second < 1 && !has_unit && are_multiples_of(0.001, numbers)) continue;
    if (!has_unit && !has_steps_below(step_s_max * epoch.per_second * 1.001, numbers)) continue;
    if (!numbers.empty() && std::all_of(numbers.begin(), numbers.end(), [&](double number) {
          return number >= epoch.low && number < epoch.high;
        }))
      return &epoch;
  }
  return nullptr;
}

}  // namespace thermocomp
