#include "config/run_forms/spelled_unit.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "config/run_forms/field_text.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"

namespace thermocomp {
namespace {

constexpr double kelvin_of_0_degC = 273.15;
constexpr double urad_of_arcsecond = 4.84813681109536;  // pi / 648000 rad
constexpr double fahrenheit_step = 5.0 / 9.0;

/// A unit in all of its spellings, separated by blanks.
struct Spellings {
  std::string_view anywhere;
  std::string_view in_brackets;  ///< too short to be recognised elsewhere
  SpelledUnit unit;
};
constexpr auto spellings = std::to_array<Spellings>({
    {"degC", "C", {"", "temperature", 1, 0, "_degC"}},
    {"Kelvin", "K", {"", "temperature", 1, -kelvin_of_0_degC, "_K"}},
    {"degF", "F", {"", "temperature", fahrenheit_step, -32 * fahrenheit_step, "_degC"}},
    // a difference
    {"delta_degF", "", {"", "temperature", fahrenheit_step, -kelvin_of_0_degC, "_K"}},
    {"um µm μm æm micron microns micrometer micrometers", "", {"", "length", 1, 0, "_um"}},
    {"nm", "", {"", "length", 1e-3, 0, "_um"}},
    {"mm millimeter millimeters Millimeters", "", {"", "length", 1e3, 0, "_mm"}},
    {"", "cm", {"", "length", 1e4, 0, "_mm"}},
    {"", "m", {"", "length", 1e6, 0, "_mm"}},
    {"inch inches", "in", {"", "length", 25400, 0, "_mm"}},
    {"", "mil mils thou", {"", "length", 25.4, 0, "_um"}},
    {"uin µin μin microinch", "", {"", "length", 0.0254, 0, "_um"}},
    {"urad µrad μrad um/m µm/m μm/m", "", {"", "angle", 1, 0, "_urad"}},
    {"mrad", "", {"", "angle", 1e3, 0, "_urad"}},
    {"arcsec", "", {"", "angle", urad_of_arcsecond, 0, "_urad"}},
    {"rpm RPM 1/min min-1 min^-1 U/min tr/min r/min rev/min", "", {"", "speed", 1, 0, "_rpm"}},
    {"mm/min mm_per_min", "", {"", "feed", 1, 0, "_mm_per_min"}},
    {"m/min", "", {"", "feed", 1e3, 0, "_mm_per_min"}},
    {"mm/s", "", {"", "feed", 60, 0, "_mm_per_min"}},
    {"", "A", {"", "current", 1, 0, "_A"}},
    {"", "mA", {"", "current", 1e-3, 0, "_A"}},
    {"", "W", {"", "power", 1, 0, "_W"}},
    {"kW", "", {"", "power", 1e3, 0, "_W"}},
    {"VDC", "V", {"", "voltage", 1, 0, "_V"}},
    {"", "mV", {"", "voltage", 1e-3, 0, "_V"}},
    {"% percent", "", {"", "share", 1, 0, "_percent"}},
    {"0/1 on/off", "on", {"", "switch", 1, 0, "_on"}},
    {"", "- 1", {"", "none", 1, 0, ""}},
    {"", "ns", {"", "time", 1e-9, 0, "_s"}},
    {"", "us µs", {"", "time", 1e-6, 0, "_s"}},
    {"", "ms msec milliseconds", {"", "time", 1e-3, 0, "_s"}},
    {"", "s sec sec. seconds Seconds", {"", "time", 1, 0, "_s"}},
    {"", "min minutes Minutes", {"", "time", 60, 0, "_s"}},
    {"", "h hours Hours", {"", "time", 3600, 0, "_s"}},
    {"", "d day days", {"", "time", 86400, 0, "_s"}},
});

/// By spelling.
const std::map<std::string_view, SpelledUnit>& known_units() {
  static const auto known = [] {
    std::map<std::string_view, SpelledUnit> units;
    for (const Spellings& each : spellings)
      for (const bool in_brackets : {false, true}) {
        std::string_view rest = in_brackets ? each.in_brackets : each.anywhere;
        std::string_view spelling;
        while (!rest.empty() && take(rest, ' ', spelling)) {
          SpelledUnit& unit = units[spelling] = each.unit;
          unit.spelling = spelling;
          unit.only_in_brackets = in_brackets;
        }
      }
    return units;
  }();
  return known;
}

/// Encodings of the degree sign, including look-alikes and conversion errors, in UTF-8, Latin-1 and
/// GBK. Longer ones first.
constexpr auto degree_signs = std::to_array<std::string_view>(
    {"℃", "℉", "\xA1\xE6", "Â°", "Âº", "°", "º", "˚", "∘", "ø" /* DOS */, "\xB0", "\xBA"});

/// Normalises other spellings of a temperature unit: "ºC", "Deg. C", "oC", "Celcius". Empty: not a
/// temperature unit.
std::string_view plain_temperature(std::string_view unit) {
  constexpr std::size_t bytes_max = 24;
  if (unit.size() > bytes_max) return {};
  std::string letters;
  bool has_degree = unit.size() == 2 && unit[0] == 'o' && unit[1] < 'a';  // "oC"; not "of"
  if (has_degree) unit.remove_prefix(1);
  const std::string small = small_letters(unit);
  for (std::string_view rest = small; !rest.empty();) {
    const auto* const sign = std::ranges::find_if(
        degree_signs, [&](std::string_view each) { return rest.starts_with(each); });
    const bool is_sign = sign != degree_signs.end();
    has_degree = has_degree || is_sign;
    if (is_sign)
      letters += *sign == "℉" ? "f" : *sign == "℃" || *sign == "\xA1\xE6" ? "c" : "";
    else if (std::string_view(" _.").find(rest.front()) == std::string_view::npos)
      letters += rest.front();
    rest.remove_prefix(is_sign ? sign->size() : 1);
  }
  std::string_view left = letters;
  for (const std::string_view word : {"degrees", "degree", "deg", "grad", "grd"}) {
    const bool is_first = left.starts_with(word);
    if (has_degree || !(is_first || left.ends_with(word))) continue;
    has_degree = true;
    left = left.substr(is_first ? word.size() : 0, left.size() - word.size());
  }
  if (left == "celsius" || left == "celcius") return "degC";
  if (left == "c" || left == "cel") return has_degree ? "degC" : "C";
  if (left == "kelvin") return "Kelvin";
  if (left == "fahrenheit" || (left == "f" && has_degree)) return "degF";
  return left == "k" && has_degree ? "K" : "";
}

/// "TC(1)", "TC(1,2)": an element of a logger's array, not a unit.
bool is_index(std::string_view text) {
  return !text.empty() && text.find_first_not_of("0123456789, ") == std::string_view::npos;
}

/// "Temp °C", "Temp, deg C", "I / A", "t in s": unit of one or two words at the end.
bool split_blank(std::string_view header, SpelledName& name) {
  const auto split_at = [&](std::size_t blank) {
    if (blank == std::string_view::npos) return false;
    const SpelledUnit* unit = spelled_unit(header.substr(blank + 1));
    std::string_view base = trimmed(header.substr(0, blank));
    bool is_marked = false;
    for (const std::string_view before : {" /", " in", ","}) {
      if (!base.ends_with(before)) continue;
      base = trimmed(base.substr(0, base.size() - before.size()));
      is_marked = true;
      break;
    }
    if (unit == nullptr || (unit->only_in_brackets && !is_marked)) return false;
    name = {std::string(base), std::string(header.substr(blank + 1)), unit};
    return true;
  };
  const auto last = header.rfind(' ');
  const bool has_two = last != std::string_view::npos && last > 0;
  return (has_two && split_at(header.rfind(' ', last - 1))) || split_at(last);
}

/// "T1 [°C]": unit in brackets at the end; "1:[°C] Bed", "T (degC) spindle": a known one before.
bool split_brackets(std::string_view header, SpelledName& name) {
  for (const auto& [open, close] : {std::pair('[', ']'), {'(', ')'}, {'{', '}'}}) {
    const auto end = header.rfind(close);
    const auto begin = end == std::string_view::npos ? end : header.rfind(open, end);
    if (begin == std::string_view::npos) continue;
    const std::string_view inside = header.substr(begin + 1, end - begin - 1);
    if (inside.find('=') != std::string_view::npos) continue;  // labels: {place="bed"}
    if (open == '(' && is_index(inside)) continue;
    const std::string_view behind = trimmed(header.substr(end + 1));
    const std::string unit(trimmed(inside));
    const SpelledUnit* const known = spelled_unit(unit);
    const bool is_unit =
        known != nullptr && known->dimension != "none" && (open == '[' || !known->only_in_brackets);
    if (!behind.empty() && !is_unit) continue;
    std::string base(trimmed(header.substr(0, begin)));
    if (!behind.empty()) base.append(base.empty() ? "" : " ").append(behind);
    name = {base, unit, known};
    // "Temp, °C (LGR S/N: 1)": the unit precedes other text.
    SpelledName before;
    if (name.known == nullptr && split_blank(base, before)) name = before;
    return true;
  }
  return false;
}

/// "T1/K", "I/A", "t/ms": a unit behind a stroke; one of time only behind a time.
bool split_stroke(std::string_view header, SpelledName& name) {
  constexpr std::string_view times = "|t|time|zeit|elapsed|elapsed time|laufzeit|";
  const auto stroke = header.rfind('/');
  if (stroke == std::string_view::npos || stroke == 0 || spelled_unit(header) != nullptr)
    return false;
  const std::string_view base = trimmed(header.substr(0, stroke));
  const SpelledUnit* unit = spelled_unit(trimmed(header.substr(stroke + 1)));
  if (unit == nullptr || unit->dimension == "none" ||
      (unit->dimension == "time" && !is_one_of(times, base)))
    return false;
  name = {std::string(base), std::string(unit->spelling), unit};
  return true;
}

/// "T1°C", "z/µm", "t1_degF": characters that occur in units only, and our suffix of another unit.
bool split_letters(std::string_view header, SpelledName& name) {
  for (const std::string_view unit : {"°C", "ºC", "℃", "°F", "ºF", "_degF", "µm", "μm"}) {
    if (!header.ends_with(unit)) continue;
    std::string_view base = header.substr(0, header.size() - unit.size());
    while (!base.empty() && (base.back() == '/' || base.back() == '_')) base.remove_suffix(1);
    name = {std::string(trimmed(base)), std::string(unit), spelled_unit(unit)};
    return true;
  }
  return false;
}

}  // namespace

const SpelledUnit* spelled_unit(std::string_view unit) {
  const auto find = [](std::string_view text) {
    const auto found = known_units().find(text);
    return found == known_units().end() ? nullptr : &found->second;
  };
  if (const auto* const known = find(unit)) return known;
  if (const auto* const known = find(plain_temperature(unit))) return known;
  // "Âµm": UTF-8 that was read as Latin-1.
  if (unit.starts_with("Âµ")) return find(unit.substr(std::string_view("Â").size()));
  // "UM", "Rpm"; of electricity the size of a letter matters.
  const auto* const small = unit.size() > 1 ? find(small_letters(unit)) : nullptr;
  const bool is_any_size = small != nullptr && !small->only_in_brackets &&
                           (small->dimension == "length" || small->dimension == "speed");
  return is_any_size ? small : nullptr;
}

const SpelledUnit* time_unit(std::string_view unit) {
  const SpelledUnit* known = spelled_unit(unit);
  return known != nullptr && known->dimension == "time" ? known : nullptr;
}

SpelledName spelled_name(std::string_view header) {
  header = trimmed(header);
  SpelledName name;
  if (split_brackets(header, name) || split_blank(header, name) || split_letters(header, name) ||
      split_stroke(header, name))
    return name;
  return {std::string(header), "", nullptr};
}

std::optional<UnitConversion> conversion(const SpelledUnit& from, std::string_view column) {
  const std::string_view suffix = unit_of(column).suffix;
  if (suffix.empty()) return UnitConversion{};
  if (suffix == from.suffix && from.factor == 1.0) return UnitConversion{};
  const SpelledUnit* to = spelled_unit(suffix.substr(1));
  if (to == nullptr || to->dimension != from.dimension) return std::nullopt;
  if (to->factor == from.factor && to->offset == from.offset) return UnitConversion{};
  return UnitConversion{from.factor / to->factor, (from.offset - to->offset) / to->factor};
}

std::string plain_name(std::string_view base) {
  std::string name;
  for (const char c : trimmed(base)) {
    const bool joins =
        static_cast<unsigned char>(c) <= 0x20 || c == 0x7f || c == ',' || c == '"' || c == '|';
    name += joins ? '_' : c;
  }
  return name;
}

std::string without_unit(std::string_view column) {
  return std::string(column.substr(0, column.size() - unit_of(column).suffix.size()));
}

std::string unused_name(const std::string& column,
                        const std::function<bool(const std::string&)>& is_taken) {
  std::string name = column;
  for (int i = 2; is_taken(name); ++i)
    name = without_unit(column) + "_" + std::to_string(i) + std::string(unit_of(column).suffix);
  return name;
}

bool is_grouped(std::string_view text, char sign) {
  std::string_view part;
  bool first = true;
  while (take(text, sign, part)) {
    const bool digits = std::ranges::all_of(part, is_digit);
    if (!digits || part.empty() || part.size() > 3 || (!first && part.size() != 3)) return false;
    first = false;
  }
  return true;
}

/// "12 000", "-1 200,5"
bool is_grouped_by_blanks(std::string_view field) {
  if (field.find(' ') == std::string_view::npos) return false;
  if (field.front() == '-' || field.front() == '+') field.remove_prefix(1);
  return is_grouped(field.substr(0, field.find_first_of(".,")), ' ');
}

std::optional<double> number_of(std::string_view field, const NumberForm& form) {
  if (form.thousands != '\0' && field.find(form.thousands) != std::string_view::npos) {
    std::string_view whole = field.substr(0, field.find(form.decimal));
    if (!whole.empty() && (whole.front() == '-' || whole.front() == '+')) whole.remove_prefix(1);
    if (!is_grouped(whole, form.thousands)) return std::nullopt;
  }
  const bool has_blanks = is_grouped_by_blanks(field);
  std::string digits;
  bool in_fraction = false;
  for (const char c : field) {
    if (c == ' ' && has_blanks) continue;
    if (c == form.thousands && c != '\0' && !in_fraction) continue;
    if (c == form.decimal) in_fraction = true;
    if (c == '.' && form.decimal != '.') return std::nullopt;
    digits += c == form.decimal ? '.' : c;
  }
  return finite_number(digits);
}

NumberText number_text_of(std::string_view field) {
  const bool may_end_so = field.find(' ') != std::string_view::npos;  // "1500 min-1"
  if (field.empty() || (is_digit(field.back()) && !may_end_so)) return {field};
  const auto end = field.find_last_of("0123456789");
  const auto begin = field.find_first_not_of("+-.,");
  if (end == std::string_view::npos || begin == std::string_view::npos || !is_digit(field[begin]))
    return {field};
  // The unit may contain digits, as in "1500 min-1".
  const auto blank = field.find(' ');
  const auto cut = std::min(blank, end + 1);
  const SpelledUnit* unit = spelled_unit(trimmed(field.substr(cut)));
  if (unit == nullptr) return {field};
  return {trimmed(field.substr(0, cut)), unit};
}

bool may_be_unit(std::string_view text) {
  const std::string small = small_letters(text);
  if (small.find('%') != std::string::npos || small.find("deg") != std::string::npos) return true;
  for (const std::string_view sign : degree_signs)
    if (sign != "ø" && small.find(sign) != std::string::npos) return true;
  std::string word;
  for (const char c : small + ' ') {
    const bool is_letter = (c >= 'a' && c <= 'z') || static_cast<unsigned char>(c) >= 0x80;
    if (is_letter) word += c;
    if (is_letter || word.empty()) continue;
    const auto is_word = [&](const auto& known) { return small_letters(known.first) == word; };
    if (std::ranges::any_of(known_units(), is_word)) return true;
    word.clear();
  }
  return false;
}

std::optional<SpelledUnit> unit_with_factor(std::string_view unit) {
  if (const SpelledUnit* known = spelled_unit(unit)) return *known;
  const NumberText parts = number_text_of(unit);
  const auto factor = finite_number(parts.digits);
  if (parts.unit == nullptr || !factor) return std::nullopt;
  SpelledUnit scaled = *parts.unit;
  scaled.factor *= *factor;
  return scaled;
}

bool looks_like_number(std::string_view field) {
  field = number_text_of(field).digits;
  if (field.empty() || field.size() > 40) return false;
  if (field.front() == '-' || field.front() == '+') field.remove_prefix(1);
  const std::string_view signs =
      is_grouped_by_blanks(field) ? "0123456789., " : "0123456789.,'eE+-";
  if (field.empty() || field.find_first_not_of(signs) != std::string_view::npos) return false;
  const auto exponent = field.find_first_of("eE");
  const std::string_view digits = field.substr(0, exponent);
  return !digits.empty() && digits.find_first_of("+-") == std::string_view::npos &&
         digits.find_first_of("0123456789") != std::string_view::npos &&
         (std::ranges::count(digits, '.') <= 1 || std::ranges::count(digits, ',') <= 1) &&
         !(std::ranges::count(digits, '.') > 1 && !is_grouped(digits, '.'));
}

}  // namespace thermocomp
