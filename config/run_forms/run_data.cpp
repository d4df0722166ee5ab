#include "config/run_forms/run_data.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "config/run_forms/time_stamp.hpp"
#include "config/text/units.hpp"

namespace thermocomp {

std::optional<std::size_t> RunFile::find(std::string_view column_name) const {
  const auto found = std::ranges::find(columns, column_name);
  if (found == columns.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns.begin());
}

const std::vector<double>& RunFile::column(std::string_view column_name) const {
  if (const auto index = find(column_name)) return values[*index];
  const auto is_displacement = [](const std::string& each) {
    return is_output(each) && !each.ends_with("_offset_um") && !each.ends_with("_applied_um");
  };
  std::string rule = "must be one of the columns";
  const std::string position = std::string(column_name.substr(0, column_name.rfind('_'))) + "_mm";
  if (is_output(column_name) && find(position))
    rule += "; there is " + position + ", a position, which --columns can make a displacement";
  else if (is_output(column_name) && std::ranges::none_of(columns, is_displacement))
    rule =
        "this file has no measured displacement: report indicator readings with `thermocomp "
        "measured AXIS UM`, or add a column *_um";
  throw ConfigurationError({{this->name, 0, std::string(column_name), "(missing)", rule}});
}

std::optional<WallZero> stated_wall_zero(std::string_view text) {
  const std::size_t at = text.find(wall_zero_mark);
  if (at == std::string_view::npos || (at > 0 && text[at - 1] != '\n')) return std::nullopt;
  const std::string_view stated = text.substr(at + wall_zero_mark.size());
  return wall_time(stated.substr(0, stated.find_first_of("\r\n")));
}

std::optional<WallZero> wall_time(std::string_view text) {
  const auto stamp = parse_time_stamp(text);
  const auto seconds = stamp ? seconds_of(*stamp, DateOrder::unknown, false) : std::nullopt;
  if (!seconds) return std::nullopt;
  return WallZero{*seconds, stamp->zone_s.has_value()};
}

std::string wall_zero_comment(const WallZero& zero) {
  const double whole = std::floor(zero.seconds);
  char thousandths[8];
  std::snprintf(thousandths, sizeof thousandths, "%.3f", std::min(zero.seconds - whole, 0.999));
  std::string stamp = date_text(whole);
  stamp[10] = 'T';
  return std::string(wall_zero_mark) + stamp + std::string(thousandths + 1) +
         (zero.is_utc ? "Z\n" : "\n");
}

}  // namespace thermocomp
