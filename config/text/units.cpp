#include "config/text/units.hpp"

#include <algorithm>
#include <array>

#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

constexpr std::array<Unit, 12> registered{{
    {"_degC", "degC", QuantityKind::temperature},
    {"_K", "K", QuantityKind::temperature},
    {"_um", "um", QuantityKind::displacement},
    {"_urad", "urad", QuantityKind::tilt},
    {"_mm", "mm", QuantityKind::position},
    {"_rpm", "rpm", QuantityKind::signal},
    {"_mm_per_min", "mm/min", QuantityKind::signal},
    {"_A", "A", QuantityKind::signal},
    {"_W", "W", QuantityKind::signal},
    {"_V", "V", QuantityKind::signal},
    {"_on", "0/1", QuantityKind::signal},
    {"_percent", "%", QuantityKind::signal},
}};

}  // namespace

Unit unit_of(std::string_view column) {
  if (column == "time_s") return {"_s", "s", QuantityKind::time};
  Unit longest;
  for (const Unit& unit : registered) {
    if (column.size() > unit.suffix.size() && column.ends_with(unit.suffix) &&
        unit.suffix.size() > longest.suffix.size()) {
      longest = unit;
    }
  }
  return longest;
}

QuantityKind kind_of(std::string_view column) {
  return unit_of(column).kind;
}

bool is_temperature(std::string_view column) {
  return kind_of(column) == QuantityKind::temperature;
}

bool is_output(std::string_view column) {
  const QuantityKind kind = kind_of(column);
  return kind == QuantityKind::displacement || kind == QuantityKind::tilt;
}

bool is_operating(std::string_view column) {
  const QuantityKind kind = kind_of(column);
  return kind == QuantityKind::position || kind == QuantityKind::signal;
}

bool is_column_name(std::string_view name) {
  if (name.empty() || name.front() == ' ' || name.back() == ' ' || name.front() == '#')
    return false;
  constexpr std::size_t bytes_max = 200;
  return name.size() <= bytes_max && name.find_first_of(",\"|") == std::string_view::npos &&
         is_printable(name);
}

}  // namespace thermocomp
