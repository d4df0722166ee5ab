#include "drivers/controllers/travel_values.hpp"

#include <cmath>

#include "estimator/checks.hpp"

namespace thermocomp {
namespace {

constexpr double mm_per_m = 1000.0;
constexpr std::size_t line_values_max = 3;  // K0, slope and optionally P0

}  // namespace

void check_shape(const TravelShape& shape) {
  require(shape.nodes_mm.size() >= 2 && shape.nodes_mm.size() <= TravelShape::nodes_max, "nodes_mm",
          static_cast<double>(shape.nodes_mm.size()), "must be 2 to 16 nodes");
  for (std::size_t i = 0; i < shape.nodes_mm.size(); ++i)
    require(
        std::isfinite(shape.nodes_mm[i]) && (i == 0 || shape.nodes_mm[i] > shape.nodes_mm[i - 1]),
        "nodes_mm", shape.nodes_mm[i], "must increase");
  if (shape.p0_mm)
    require(shape.nodes_mm.size() == 2, "nodes_mm", static_cast<double>(shape.nodes_mm.size()),
            "must be both ends of the travel of a line");
}

void check_count(const TravelShape& shape, std::size_t values, const char* key) {
  const bool right = shape.p0_mm ? values == line_values_max - 1 || values == line_values_max
                                 : values == shape.nodes_mm.size();
  require(right, key, static_cast<double>(values), "must be what the set is made of");
}

std::vector<double> travel_values(const TravelShape& shape, std::size_t count,
                                  std::span<const double> offset_um) {
  if (!shape.p0_mm) return {offset_um.begin(), offset_um.end()};
  const double low_mm = shape.nodes_mm.front();
  const double slope_um_per_mm =
      (offset_um.back() - offset_um.front()) / (shape.nodes_mm.back() - low_mm);
  std::vector<double> values{offset_um.front() + slope_um_per_mm * (*shape.p0_mm - low_mm),
                             slope_um_per_mm * mm_per_m, *shape.p0_mm};
  values.resize(count);
  return values;
}

void offsets_shown(const TravelShape& shape, std::span<const double> shown,
                   std::span<double> offset_um) noexcept {
  for (std::size_t i = 0; i < offset_um.size(); ++i) {
    if (!shape.p0_mm) {
      offset_um[i] = shown[i];
      continue;
    }
    const double p0_mm = shown.size() == line_values_max ? shown[2] : *shape.p0_mm;
    offset_um[i] = shown[0] + shown[1] * (shape.nodes_mm[i] - p0_mm) / mm_per_m;
  }
}

double node_resolution_um(const TravelShape& shape, std::span<const double> counts,
                          std::size_t node) noexcept {
  if (counts.empty()) return 0.0;
  if (!shape.p0_mm) return std::abs(counts[node]);
  return std::abs(counts[0]) +
         std::abs(counts[1] * (shape.nodes_mm[node] - *shape.p0_mm)) / mm_per_m;
}

}  // namespace thermocomp
