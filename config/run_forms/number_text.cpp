#include "config/run_forms/number_text.hpp"

#include <algorithm>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"

namespace thermocomp {
namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

}  // namespace

bool is_grouped(std::string_view text, char sign) {
  std::string_view part;
  bool first = true;
  while (take(text, sign, part)) {
    const bool digits = std::all_of(part.begin(), part.end(), is_digit);
    if (!digits || part.empty() || part.size() > 3 || (!first && part.size() != 3)) return false;
    first = false;
  }
  return true;
}

NumberText number_text_of(std::string_view field) {
  const bool may_end_so = field.find(' ') != std::string_view::npos;  // "1500 min-1"
  if (field.empty() || (is_digit(field.back()) && !may_end_so)) return {field};
  const auto end = field.find_last_of("0123456789");
  const auto begin = field.find_first_not_of("+-.,");
  if (end == std::string_view::npos || begin == std::string_view::npos || !is_digit(field[begin]))
    return {field};
  // Digits may belong to the unit, as in "1500 min-1".
  const auto blank = field.find(' ');
  const auto cut = std::min(blank, end + 1);
  const SpelledUnit* unit = spelled_unit(trimmed(field.substr(cut)));
  if (unit == nullptr) return {field};
  return {trimmed(field.substr(0, cut)), unit};
}

bool looks_like_number(std::string_view field) {
  field = number_text_of(field).digits;
  if (field.empty() || field.size() > 40) return false;
  if (field.front() == '-' || field.front() == '+') field.remove_prefix(1);
  if (field.empty() || field.find_first_not_of("0123456789.,'eE+-") != std::string_view::npos)
    return false;
  const auto exponent = field.find_first_of("eE");
  const std::string_view digits = field.substr(0, exponent);
  return !digits.empty() && digits.find_first_of("+-") == std::string_view::npos &&
         digits.find_first_of("0123456789") != std::string_view::npos &&
         (std::count(digits.begin(), digits.end(), '.') <= 1 ||
          std::count(digits.begin(), digits.end(), ',') <= 1) &&
         !(std::count(digits.begin(), digits.end(), '.') > 1 && !is_grouped(digits, '.'));
}

}  // namespace thermocomp
