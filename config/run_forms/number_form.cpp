#include "config/run_forms/number_form.hpp"

#include <array>
#include <string>
#include <string_view>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"

namespace thermocomp {
namespace {

enum class Shows {
  nothing,
  comma,           ///< decimal comma: 20,5
  point,           ///< decimal point
  comma_or_group,  ///< 1,234
  point_or_group,  ///< 1.234
  groups           ///< 1,234.5 or 1.234.567
};

Shows shown_by(std::string_view field) {
  if (!field.empty() && (field.front() == '-' || field.front() == '+')) field.remove_prefix(1);
  const auto exponent = field.find_first_of("eE");
  const std::string_view digits = field.substr(0, exponent);
  const auto sign = digits.find_first_of(".,");
  if (sign == std::string_view::npos ||
      digits.find_first_not_of("0123456789.,") != std::string_view::npos)
    return Shows::nothing;
  const char first = digits[sign];
  const auto last = digits.find_last_of(".,");
  if (last == sign) {
    const bool unclear = exponent == std::string_view::npos && digits.front() != '0' &&
                         is_grouped(digits, first) && sign > 0;
    if (first == ',') return unclear ? Shows::comma_or_group : Shows::comma;
    return unclear ? Shows::point_or_group : Shows::point;
  }
  const bool mixed = digits[last] != first;
  const std::string_view whole = mixed ? digits.substr(0, last) : digits;
  return is_grouped(whole, first) ? Shows::groups : Shows::nothing;
}

struct Seen {
  int line{0};
  std::string_view field;
  explicit operator bool() const noexcept { return line > 0; }
};

/// The first field of each kind, by rows.
std::array<Seen, 6> seen_in(const TextTable& table, bool& has_apostrophes) {
  std::array<Seen, 6> seen;
  for (std::size_t row = 0; row < table.rows(); ++row)
    for (const TextColumn& column : table.columns) {
      const std::string_view field = column.fields[row];
      std::string_view digits = number_text_of(field).digits;
      if (const auto group = digits.rfind('\''); group != std::string_view::npos) {  // 12'000.5
        if (looks_like_number(digits)) has_apostrophes = true;
        digits.remove_prefix(group + 1);
      }
      if (is_grouped_by_blanks(digits)) digits.remove_prefix(digits.rfind(' ') + 1);
      Seen& first = seen[static_cast<std::size_t>(shown_by(digits))];
      if (!first) first = {table.lines[row], field};
    }
  return seen;
}

}  // namespace

NumberForm number_form(const TextTable& table) {
  NumberForm form;
  const ColumnMap& map = table.map;
  if (map.thousands) form = {*map.thousands == '.' ? ',' : '.', *map.thousands};
  if (map.decimal) form.decimal = *map.decimal;
  if (map.decimal || map.thousands) return form;
  bool has_apostrophes = false;
  const auto seen = seen_in(table, has_apostrophes);
  if (has_apostrophes) form.thousands = '\'';
  const auto of = [&](Shows what) { return seen[static_cast<std::size_t>(what)]; };
  const auto ask = [&](Seen where, const std::string& rule) {
    table.problems.add(where.line, "", where.field, rule);
  };
  const auto ask_beside = [&](Seen where, const char* has, Seen other) {
    ask(where, has + (", and line " + std::to_string(other.line)) + " has " +
                   shortened(other.field) + ": there must be one decimal sign in a file");
  };
  const Seen comma = of(Shows::comma);
  // A comma that separates fields cannot be a decimal sign, so a single point is one.
  const bool by_commas = table.separator == ',';
  const Seen point = of(Shows::point) || !by_commas ? of(Shows::point) : of(Shows::point_or_group);
  const Seen unclear_comma = of(Shows::comma_or_group);
  const Seen unclear_point = by_commas ? Seen{} : of(Shows::point_or_group);
  const Seen clear = comma ? comma : point;
  const Seen unclear = comma || !unclear_comma ? unclear_point : unclear_comma;
  const std::string unclear_sign = unclear_comma && !comma ? "," : ".";
  if (const Seen groups = of(Shows::groups)) {
    // The last of two different signs is the decimal one: 1.234,5.
    const char first = groups.field[groups.field.find_first_of(".,")];
    form = {first == '.' ? ',' : '.', first};
    if (const Seen other = form.decimal == ',' ? of(Shows::point) : comma)
      ask_beside(groups, "has groups of thousands", other);
  } else if (comma && point) {
    ask_beside(comma, "has a decimal comma", point);
  } else if ((comma && unclear_point) || (point && unclear_comma)) {
    ask(unclear, "may have a group of thousands, as line " + std::to_string(clear.line) + " has " +
                     shortened(clear.field) + ": write thousands = \"" + unclear_sign +
                     "\" in the file of --columns if it is one");
  } else if (!clear && unclear_comma && unclear_point) {
    ask(unclear_comma, "and " + std::string(unclear_point.field) +
                           ": write decimal = \",\" or decimal = \".\" in the file of --columns");
  } else if (!clear && unclear) {
    ask(unclear, "may be a decimal or thousands: write decimal = \"" + unclear_sign +
                     "\" or thousands = \"" + unclear_sign + "\" in the file of --columns");
  } else if (comma) {
    form.decimal = ',';
  }
  return form;
}

}  // namespace thermocomp
