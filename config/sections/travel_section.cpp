#include "config/sections/travel_section.hpp"

#include <algorithm>
#include <cmath>

#include "config/text/number_text.hpp"

namespace thermocomp::sections {
namespace {

constexpr double mm_per_m = 1000.0;
/// As much as a read-back may differ from what was sent because values are rounded to counts.
constexpr double rounding_um_max = 0.1;

/// Controllers count offsets in um at the coarsest. Beyond that one count may be what the slew
/// allows in a second, and a quarter of the bound.
double count_um_max(const LimiterConfig& limiter) {
  constexpr double coarsest_um = 1.0;
  constexpr double share_of_bound = 0.25;
  return std::min(std::max(coarsest_um, limiter.rate_um_per_s_max),
                  share_of_bound * limiter.offset_um_max);
}

}  // namespace

void check_offset_place(const TomlTable& table, std::string_view key, const Carried& place,
                        const LimiterConfig& limiter) {
  const Range& reach = place.reach;
  if (!reach.contains(limiter.offset_um_max) || !reach.contains(-limiter.offset_um_max))
    table.problem(key, "must be able to hold -offset_um_max ... offset_um_max, but reaches from " +
                           number_text(reach.min) + " to " + number_text(reach.max));
  if (place.count <= count_um_max(limiter)) return;
  table.problem(key, "one count of " + number_text(place.count) + " um",
                "must be at most " + number_text(count_um_max(limiter)) +
                    " um beside offset_um_max = " + number_text(limiter.offset_um_max) +
                    " and rate_um_per_s_max = " + number_text(limiter.rate_um_per_s_max) +
                    ": check `scale`");
}

TomlTable travel_table(const TomlTable& axis) {
  return axis.has("line") ? axis.table("line") : axis.table_or_empty("table");
}

TravelSection::TravelSection(const TomlTable& axis, const LimiterConfig& limiter)
    : table_(travel_table(axis)), limiter_(limiter) {
  axis.has("line") ? read_line() : read_table();
}

void TravelSection::read_line() {
  std::vector<double>& nodes_mm = shape_.nodes_mm;
  nodes_mm = table_.numbers("travel_mm");
  shape_.p0_mm = table_.number("p0_mm", Range::any());
  is_travel_ = nodes_mm.size() == 2 && nodes_mm[1] > nodes_mm[0];
  // A problem of read_axes() already.
  if (!is_travel_) nodes_mm = {0.0, 1.0};
  if (is_travel_ && table_.has("p0_mm") &&
      !(*shape_.p0_mm >= nodes_mm[0] && *shape_.p0_mm <= nodes_mm[1]))
    table_.problem("p0_mm", "must be within travel_mm");
}

void TravelSection::read_table() {
  shape_.nodes_mm = table_.numbers("nodes_mm");
  shape_.nodes_mm.resize(std::clamp<std::size_t>(shape_.nodes_mm.size(), 2, TravelShape::nodes_max),
                         0.0);
}

void TravelSection::check_offset(const TomlTable& own, std::string_view key,
                                 const Carried& place) const {
  check_offset_place(own, key, place, limiter_);
}

void TravelSection::check_slope(const TomlTable& own, std::string_view key,
                                const Carried& place) const {
  if (!is_travel_) return;
  const double length_m = (shape_.nodes_mm.back() - shape_.nodes_mm.front()) / mm_per_m;
  const double steepest = 2.0 * limiter_.offset_um_max / length_m;
  const Range& can = place.reach;
  if (!can.contains(steepest) || !can.contains(-steepest))
    own.problem(key, "must be able to hold +-" + number_text(steepest) +
                         " um/m, from -offset_um_max to offset_um_max over the travel, but "
                         "reaches from " +
                         number_text(can.min) + " to " + number_text(can.max));
  if (place.count * length_m > rounding_um_max)
    own.problem(key, "one count moves the end of the travel by " +
                         number_text(std::round(1e6 * place.count * length_m) / 1e6) +
                         " um: must be at most " + number_text(rounding_um_max) + " um");
}

void TravelSection::check_p0(const TomlTable& own, std::string_view key,
                             const Carried& place) const {
  const double p0_mm = *shape_.p0_mm;
  const double counts = place.count > 0.0 ? p0_mm / place.count : 0.0;
  if (!place.reach.contains(p0_mm) || std::abs(counts - std::round(counts)) > 1e-6)
    own.problem(key, "must be able to hold p0_mm = " + number_text(p0_mm));
}

}  // namespace thermocomp::sections
