#include <cmath>
#include <string>

#include "config/text/number_text.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {

bool Range::contains(double value) const {
  return std::isfinite(value) && (min_excluded ? value > min : value >= min) && value <= max;
}

std::string Range::rule() const {
  const bool bounded_below = min > any().min;
  const bool bounded_above = max < any().max;
  if (bounded_below && bounded_above) {
    return std::string("must be in ") + (min_excluded ? "(" : "[") + number_text(min) + ", " +
           number_text(max) + "]";
  }
  if (bounded_below) {
    return std::string(min_excluded ? "must be above " : "must be at least ") + number_text(min);
  }
  if (bounded_above) return "must be at most " + number_text(max);
  return "must be a finite number";
}

}  // namespace thermocomp
