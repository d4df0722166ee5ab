#include "config/run_forms/time_name.hpp"

#include <algorithm>
#include <array>
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
  const SpelledUnit* unit = spelled_unit(header.substr(bar + 1));
  return unit != nullptr && unit->dimension == "time" ? unit->spelling : std::string_view();
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

}  // namespace thermocomp
