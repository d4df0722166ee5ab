#include "config/run_forms/time_stamp.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

/// Names of each month in English, German, French, Spanish, Italian and Portuguese.
constexpr std::array<std::string_view, 12> month_names{
    "|jan|january|januar|janv|janvier|ene|enero|gen|gennaio|janeiro|",
    "|feb|february|februar|fév|févr|fev|février|febrero|febbraio|fevereiro|",
    "|mar|march|mär|mrz|märz|mars|marzo|março|",
    "|apr|april|avr|avril|abr|abril|aprile|",
    "|may|mai|mayo|mag|maggio|maio|",
    "|jun|june|juni|juin|junio|giu|giugno|junho|",
    "|jul|july|juli|juil|juillet|julio|lug|luglio|julho|",
    "|aug|august|aoû|août|aout|ago|agosto|",
    "|sep|sept|september|septembre|septiembre|set|settembre|setembro|",
    "|oct|okt|october|oktober|octobre|octubre|ott|ottobre|out|outubro|",
    "|nov|november|novembre|noviembre|novembro|",
    "|dec|dez|december|dezember|déc|décembre|dic|diciembre|dicembre|dezembro|"};
/// Names of days, at most three letters; longer ones end in "day", "tag", "woch" or "di".
constexpr std::string_view day_names =
    "|mon|tue|wed|thu|fri|sat|sun|mo|di|mi|do|fr|sa|so|lun|mar|mer|jeu|ven|sam|dim|gio|sab|dom|";

/// Takes one to `digits_max` leading digits.
std::optional<int> take_digits(std::string_view& text, std::size_t digits_max) {
  std::size_t count = 0;
  int value = 0;
  for (; count < text.size() && count < digits_max && is_digit(text[count]); ++count)
    value = 10 * value + (text[count] - '0');
  if (count == 0) return std::nullopt;
  text.remove_prefix(count);
  return value;
}

bool take_char(std::string_view& text, std::string_view any_of) {
  if (text.empty() || any_of.find(text.front()) == std::string_view::npos) return false;
  text.remove_prefix(1);
  return true;
}

/// Takes the leading letters.
std::string_view take_word(std::string_view& text) {
  const auto is_letter = [](char c) {
    return static_cast<unsigned char>(c) >= 0x80 || ((c | 0x20) >= 'a' && (c | 0x20) <= 'z');
  };
  const auto* const end = std::ranges::find_if_not(text, is_letter);
  const std::string_view word = text.substr(0, static_cast<std::size_t>(end - text.begin()));
  text.remove_prefix(word.size());
  return word;
}

std::optional<int> take_month_name(std::string_view& text) {
  std::string_view rest = text;
  const std::string_view name = take_word(rest);
  const auto* const found = std::ranges::find_if(
      month_names, [&](std::string_view names) { return !name.empty() && is_one_of(names, name); });
  if (found == month_names.end()) return std::nullopt;
  text = rest;
  return static_cast<int>(found - month_names.begin()) + 1;
}

/// Takes "Thu", "Do., ", "Thursday, ".
void take_day_name(std::string_view& text) {
  std::string_view rest = text;
  const std::string name = small_letters(take_word(rest));
  const auto ends = [&](std::string_view end) { return name.ends_with(end); };
  if (!is_one_of(day_names, name) && !ends("day") && !ends("tag") && !ends("woch") && !ends("di"))
    return;
  take_char(rest, ".");
  take_char(rest, ",");
  text = trimmed(rest);
}

/// A number in a date and its count of digits; 0 for a month's name.
struct DatePart {
  int value{0};
  std::size_t digits{0};
};

std::optional<DatePart> take_date_part(std::string_view& text) {
  const std::size_t before = text.size();
  if (const auto number = take_digits(text, 4)) return DatePart{*number, before - text.size()};
  if (const auto month = take_month_name(text)) return DatePart{*month, 0};
  return std::nullopt;
}

/// Determines the orders of day, month and year that three parts allow.
void find_orders(const std::array<DatePart, 3>& parts, char separator, TimeStamp& stamp) {
  const auto allow = [&](DateOrder order, std::size_t day, std::size_t month, std::size_t year) {
    const bool is_year = parts[year].digits == 4 || parts[year].digits == 2;
    const bool others_short = parts[day].digits <= 2 && parts[month].digits <= 2;
    const bool named = parts[0].digits == 0 || parts[1].digits == 0;
    if (!is_year || !others_short || parts[day].digits == 0) return;
    if (named && parts[month].digits != 0) return;
    const bool in_range = parts[month].value <= 12 && parts[day].value <= 31;
    if (parts[year].digits == 4 || in_range) stamp.allows[static_cast<std::size_t>(order)] = true;
  };
  const bool is_long = std::ranges::any_of(parts, [](auto p) { return p.digits == 4; });
  const auto year_is = [&](std::size_t i) { return !is_long || parts[i].digits == 4; };
  if (year_is(2)) {
    const bool by_points = separator == '.';
    if (by_points || parts[0].digits == 0 || parts[1].value <= 12 || parts[0].value > 12)
      allow(DateOrder::day_month_year, 0, 1, 2);
    if (!by_points && (parts[0].digits == 0 || parts[0].value <= 12))
      allow(DateOrder::month_day_year, 1, 0, 2);
  }
  if (year_is(0)) allow(DateOrder::year_month_day, 2, 1, 0);
  stamp.has_points = separator == '.' && !is_long;
}

/// 2026-03-01, 01.03.2026, 3/1/26, 01-Mar-2026, Mar 1, 2026, 1. März 2026, 20260301.
bool take_date(std::string_view& text, TimeStamp& stamp) {
  std::string_view rest = text;
  std::array<DatePart, 3> parts{};
  char separator = ' ';
  const auto compact = rest.substr(0, 8);
  if (compact.size() == 8 && std::ranges::all_of(compact, is_digit) &&
      (rest.size() == 8 || std::string_view("T_ -").find(rest[8]) != std::string_view::npos)) {
    parts[0] = {*take_digits(rest, 4), 4};
    parts[1] = {*take_digits(rest, 2), 2};
    parts[2] = {*take_digits(rest, 2), 2};
    if (!(parts[0].value >= 1900 && parts[0].value < 2100 && parts[1].value <= 12)) return false;
    separator = '-';
  } else {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto part = take_date_part(rest);
      if (!part) return false;
      parts[i] = *part;
      if (i == 2) break;
      if (rest.empty() || std::string_view("-./ ,").find(rest.front()) == std::string_view::npos)
        return false;
      const char here = rest.front();
      const bool named = parts[0].digits == 0 || (i == 1 && parts[1].digits == 0);
      if (i == 1 && here != separator && !named) return false;
      separator = i == 0 ? here : separator;
      rest = trimmed(rest.substr(1));
    }
  }
  const bool named = parts[0].digits == 0 || parts[1].digits == 0;
  if ((separator == ' ' && !named) || separator == ',' || parts[2].digits == 0 ||
      (!rest.empty() && is_digit(rest.front())))
    return false;
  find_orders(parts, separator, stamp);
  if (std::ranges::none_of(stamp.allows, [](bool each) { return each; })) return false;
  for (std::size_t i = 0; i < 3; ++i) stamp.date[i] = parts[i].value;
  stamp.has_date = true;
  text = rest;
  return true;
}

std::optional<double> take_zone(std::string_view& text) {
  text = trimmed(text);
  bool is_utc = false;
  for (const std::string_view name : {"UTC", "GMT", "Z", "z"}) {
    if (is_utc || !text.starts_with(name)) continue;
    text.remove_prefix(name.size());
    is_utc = true;
  }
  const bool west = !text.empty() && text.front() == '-';
  if (!take_char(text, "+-")) return is_utc ? std::optional(0.0) : std::nullopt;
  const auto hours = take_digits(text, 2);
  take_char(text, ":");
  const int minutes = take_digits(text, 2).value_or(0);
  if (!hours) return std::nullopt;
  if (trimmed(text) == "UTC") text = {};
  return (west ? -60.0 : 60.0) * (60 * *hours + minutes);
}

/// "PM", "am": adds 12 hours, or makes hour 12 hour 0.
bool take_half_of_day(std::string_view& text, TimeStamp& stamp) {
  std::string half = small_letters(text);
  std::erase_if(half, [](char c) { return c == ' ' || c == '.'; });  // Spanish "a. m."
  const bool afternoon = half == "pm";
  if (!afternoon && half != "am") return half.empty();
  if (!(stamp.clock_a >= 1 && stamp.clock_a <= 12)) return false;
  stamp.clock_a = (stamp.clock_a == 12 ? 0 : stamp.clock_a) + (afternoon ? 12 : 0);
  text = {};
  return true;
}

/// Takes a zone named by letters off the end.
void take_zone_name(std::string_view& text, TimeStamp& stamp) {
  // Hours east of Greenwich. These letters mean one zone only; CST, IST and BST are several.
  static const std::map<std::string_view, double> zone_hours{
      {"CET", 1},  {"CEST", 2}, {"MEZ", 1},  {"MESZ", 2}, {"WET", 0},  {"WEST", 1},
      {"EET", 2},  {"EEST", 3}, {"EST", -5}, {"EDT", -4}, {"CDT", -5}, {"MST", -7},
      {"MDT", -6}, {"PST", -8}, {"PDT", -7}, {"JST", 9},  {"KST", 9}};
  const auto begin = text.rfind(' ') + 1;  // without a blank 0
  const auto zone = zone_hours.find(text.substr(begin));
  if (zone == zone_hours.end()) return;
  stamp.zone_s = 3600.0 * zone->second;
  text = trimmed(text.substr(0, begin));
}

/// Takes the days off "1 days 02:15:00", "1 day, 2:15:00", "1d 02:15:00", "1.02:15:00".
int take_days(std::string_view& text) {
  std::string_view rest = text;
  const auto days = take_digits(rest, 4);
  if (!days) return 0;
  if (take_char(rest, ".")) {
    if (rest.size() < 8 || rest[2] != ':' || rest[5] != ':') return 0;
  } else {
    rest = trimmed(rest);
    if (!is_one_of("|d|day|days|", take_word(rest))) return 0;
    take_char(rest, ",");
  }
  text = trimmed(rest);
  return *days;
}

/// "06h55" and, after a date, "06.55.00", with colons; empty: neither.
std::string with_colons(std::string_view clock, bool has_date) {
  std::string text(clock);
  const auto is_clock = [&](char sign, std::size_t size) {
    return text.size() >= size && text[2] == sign && is_digit(text[1]) && is_digit(text[3]);
  };
  if (is_clock('h', 5)) {
    text[2] = ':';
    if (text.ends_with(':') || text.ends_with('m')) text.pop_back();
    return text;
  }
  if (!has_date || !is_clock('.', 8) || text[5] != '.') return {};
  text[2] = text[5] = ':';
  return text;
}

/// 8:30, 08:30:15, 08:30:15.250, 08:30:15:250, 26:15:00, 083015; then a zone or AM, PM.
bool take_clock(std::string_view& text, TimeStamp& stamp) {
  std::string_view rest = text;
  const std::string_view compact = rest.substr(0, 6);
  std::string spelled = with_colons(rest, stamp.has_date);
  if (!spelled.empty()) rest = spelled;
  if (stamp.has_date && compact.size() == 6 && std::ranges::all_of(compact, is_digit)) {
    for (const std::size_t at : {0U, 2U, 4U})
      spelled.append(at > 0 ? ":" : "").append(compact.substr(at, 2));
    spelled.append(rest.substr(6));
    rest = spelled;
  }
  const auto a = take_digits(rest, 5);
  if (!a || !take_char(rest, ":")) return false;
  const auto b = take_digits(rest, 2);
  if (!b || *b > 59) return false;
  stamp.clock_a = *a;
  stamp.clock_b = *b;
  stamp.clock_parts = 2;
  if (take_char(rest, ":")) {
    const auto c = take_digits(rest, 2);
    if (!c || *c > 60) return false;  // a leap second
    stamp.clock_parts = 3;
    stamp.clock_c = *c;
  }
  const bool has_colon = rest.starts_with(':');
  if (take_char(rest, stamp.clock_parts == 3 ? ".,:" : ".,")) {
    double unit = 0.1;
    double fraction = 0.0;
    if (rest.empty() || !is_digit(rest.front())) return false;
    for (; !rest.empty() && is_digit(rest.front()); rest.remove_prefix(1), unit /= 10) {
      fraction += unit * (rest.front() - '0');
      ++stamp.fraction_digits;
      stamp.may_count_ms = has_colon || (stamp.fraction_digits > 1 && rest.front() == '0');
    }
    (stamp.clock_parts == 3 ? stamp.clock_c : stamp.clock_b) += fraction;
  }
  stamp.has_clock = true;
  rest = trimmed(rest);
  if (rest.ends_with(']')) rest = rest.substr(0, rest.find('['));  // [Europe/Berlin]
  take_zone_name(rest, stamp);
  if (!rest.empty() && std::string_view("ZzUG+-").find(rest.front()) != std::string_view::npos) {
    stamp.zone_s = take_zone(rest);
    if (!stamp.zone_s) return false;
  } else if (!take_half_of_day(rest, stamp)) {
    return false;
  }
  return rest.empty();
}

/// Moves the year of ctime's "Wed Jun 11 11:50:00 2026" to the front.
std::string year_in_front(std::string_view text) {
  std::string_view rest = text;
  take_day_name(rest);
  if (!rest.empty() && !is_digit(rest.front())) text = rest;
  if (text.size() < 18 || text[text.size() - 5] != ' ') return {};
  const std::string_view year = text.substr(text.size() - 4);
  const auto clock = text.find(':');
  if (clock == std::string_view::npos || clock < 6 || !std::ranges::all_of(year, is_digit))
    return {};
  const std::string_view day = trimmed(text.substr(0, clock - 2));
  return std::string(day) + " " + std::string(year) + " " +
         std::string(text.substr(clock - 2, text.size() - 5 - (clock - 2)));
}

/// "2026年3月1日 8時30分15秒", "下午 8:30" with plain signs; empty: a text without them.
std::string without_ideographs(std::string_view all) {
  if (std::ranges::none_of(all, [](char c) { return static_cast<unsigned char>(c) >= 0xe0; }))
    return {};
  static const std::map<std::string_view, char> signs{
      {"年", '-'}, {"月", '-'}, {"日", ' '}, {"時", ':'}, {"时", ':'}, {"分", ':'}, {"秒", ' '},
      {"년", '-'}, {"월", '-'}, {"일", ' '}, {"시", ':'}, {"분", ':'}, {"초", ' '}};
  static const std::map<std::string_view, const char*> halves{{"上午", " AM"}, {"下午", " PM"},
                                                              {"午前", " AM"}, {"午後", " PM"},
                                                              {"오전", " AM"}, {"오후", " PM"}};
  std::string text;
  std::string half;
  bool has_sign = false;
  while (!all.empty()) {
    if (const auto found = halves.find(all.substr(0, 6)); found != halves.end()) {
      half = found->second;
      all = trimmed(all.substr(6));
      continue;
    }
    const auto sign = signs.find(all.substr(0, 3));
    const bool is_sign = sign != signs.end();
    has_sign = has_sign || is_sign;
    text += is_sign ? sign->second : all.front();
    all.remove_prefix(is_sign ? 3 : 1);
  }
  while (text.ends_with(':') || text.ends_with(' ')) text.pop_back();
  return has_sign || !half.empty() ? text + half : std::string();
}

constexpr std::string_view time_names =
    "|time|zeit|timestamp|zeitstempel|datetime|date|datum|uhrzeit|elapsed"
    "|elapsed time|date time|date/time|datum/uhrzeit|t_s|laufzeit|ts|_time"
    "|x_value|unixtime|unix_time|epoch|seconds|last_changed|elapsed_time"
    "|time stamp|scan time|date_time|sample time|sec|clock|unix|";
constexpr std::string_view date_names =
    "|date|datum|datetime|date time|date/time|datum/uhrzeit|time|zeit|timestamp"
    "|zeitstempel|";

constexpr double s_per_day = 86400.0;

constexpr std::array<Epoch, 9> epochs{{
    {"s since 1970", 1e9, 2.5e9, 1, 0, false, true},
    {"ms since 1970", 1e12, 2.5e12, 1e3, 0, false, true},
    {"us since 1970", 1e15, 2.5e15, 1e6, 0, false, true},
    {"ns since 1970", 1e18, 2.5e18, 1e9, 0, false, true},
    {"s since 1904", 3.1e9, 4.6e9, 1, -2082844800.0, true, true},
    {"100 ns since 1601", 1.25e17, 1.42e17, 1e7, -11644473600.0, false, true},
    {"millionths of a day", 3.65e10, 5.5e10, 1e6 / s_per_day, -25569 * s_per_day, true, false},
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
  return std::ranges::all_of(numbers, [unit](double number) {
    return std::abs(number / unit - std::round(number / unit)) < 1e-6;
  });
}

/// The least and the greatest difference of consecutive numbers.
std::pair<double, double> steps_of(const std::vector<double>& numbers, double (*seconds)(double)) {
  double low = INFINITY;
  double high = -INFINITY;
  for (std::size_t i = 1; i < numbers.size(); ++i) {
    const double step = seconds(numbers[i]) - seconds(numbers[i - 1]);
    low = std::min(low, step);
    high = std::max(high, step);
  }
  return {low, high};
}

/// "Date Time, GMT+01:00" without what follows the comma.
bool is_named_like(std::string_view names, std::string_view header) {
  const std::string base = spelled_name(header).base;
  return is_one_of(names, std::string_view(base).substr(0, base.find(',')));
}

}  // namespace

std::optional<TimeStamp> parse_time_stamp(std::string_view text) {
  text = trimmed(text);
  if (text.starts_with('\'')) text.remove_prefix(1);  // a spreadsheet's sign of a text
  // Quick rejection: most fields of text are not dates.
  if (text.size() < 4 || text.size() > 64) return std::nullopt;
  TimeStamp stamp;
  std::string turned = without_ideographs(text);
  if (!turned.empty())
    text = trimmed(turned);
  else if (!is_digit(text.front()))
    turned = year_in_front(text);
  else if (text.size() == 14 && std::ranges::all_of(text, is_digit))  // 20260301123000
    turned = std::string(text).insert(8, " ");
  if (!turned.empty()) text = trimmed(turned);
  const int days = take_days(text);
  std::string_view behind_day = text;
  take_day_name(behind_day);
  if (take_date(text, stamp) || take_date(text = behind_day, stamp)) {
    if (trimmed(text).empty()) return stamp;
    if (!take_char(text, "T _-,")) return std::nullopt;
    text = trimmed(text);
  }
  if (!take_clock(text, stamp)) return std::nullopt;
  stamp.clock_a += 24 * days;
  // The day 0 of databases: only a clock time.
  if (stamp.date == std::array{30, 12, 1899} || stamp.date == std::array{1899, 12, 30}) {
    stamp.has_date = false;
    stamp.allows = {};
  }
  return stamp;
}

std::optional<double> seconds_of_day(int year, int month, int day) {
  if (year < 100) year += year < 70 ? 2000 : 1900;
  const std::chrono::year_month_day date{std::chrono::year{year},
                                         std::chrono::month{static_cast<unsigned>(month)},
                                         std::chrono::day{static_cast<unsigned>(day)}};
  if (!date.ok()) return std::nullopt;
  return s_per_day * static_cast<double>(std::chrono::sys_days(date).time_since_epoch().count());
}

std::optional<double> seconds_of(const TimeStamp& stamp, DateOrder order, bool minutes_first) {
  double seconds = 0.0;
  if (stamp.has_date) {
    for (const DateOrder each : date_orders)
      if (order == DateOrder::unknown && stamp.allows_order(each)) order = each;
    if (!stamp.allows_order(order) || (stamp.has_clock && stamp.clock_a > 24)) return std::nullopt;
    const auto& [a, b, c] = stamp.date;
    const auto day = order == DateOrder::day_month_year   ? seconds_of_day(c, b, a)
                     : order == DateOrder::month_day_year ? seconds_of_day(c, a, b)
                                                          : seconds_of_day(a, b, c);
    if (!day) return std::nullopt;
    seconds = *day;
  }
  if (stamp.has_clock && stamp.clock_parts == 2 && minutes_first)
    seconds += 60.0 * stamp.clock_a + stamp.clock_b;
  else
    seconds += 3600.0 * stamp.clock_a + 60.0 * stamp.clock_b + stamp.clock_c;
  return seconds - stamp.zone_s.value_or(0.0);
}

std::string date_text(double seconds_since_1970) {
  const auto days = static_cast<int>(std::floor(seconds_since_1970 / s_per_day));
  const std::chrono::year_month_day date{std::chrono::sys_days{std::chrono::days{days}}};
  const auto second = static_cast<int>(seconds_since_1970 - s_per_day * days);
  char text[64];
  std::snprintf(text, sizeof text, "%04d-%02u-%02u %02d:%02d:%02d", static_cast<int>(date.year()),
                static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()),
                second / 3600, second / 60 % 60, second % 60);
  return text;
}

bool names_time(std::string_view header) {
  return is_named_like(time_names, header);
}

bool names_date(std::string_view header) {
  return is_named_like(date_names, header);
}

std::string_view unit_of_time_name(std::string_view header) {
  const auto bar = header.rfind('_');
  if (bar == std::string_view::npos || bar == 0) return {};
  const std::string_view name = header.substr(0, bar);
  if (!names_time(name) && !is_one_of("|t|", name)) return {};
  const SpelledUnit* unit = time_unit(header.substr(bar + 1));
  return unit != nullptr ? unit->spelling : std::string_view();
}

std::optional<double> zone_of_header(std::string_view header) {
  for (const std::string_view name : {"GMT", "UTC"}) {
    const auto at = header.find(name);
    if (at == std::string_view::npos) continue;
    std::string_view zone = header.substr(at);
    zone = zone.substr(0, zone.find_first_of(" )]"));
    const auto seconds = take_zone(zone);
    return trimmed(zone).empty() ? seconds : std::nullopt;
  }
  return std::nullopt;
}

bool are_clock_digits(const std::vector<double>& numbers) {
  const bool may_be = std::ranges::all_of(numbers, [](double n) {
    return n >= 0 && n < 240000 && std::fmod(n, 100) < 60 && std::fmod(n / 100, 100) < 60;
  });
  if (!may_be || numbers.back() < 1e4) return false;
  const auto [low, high] = steps_of(numbers, [](double n) {
    return 3600 * std::floor(n / 1e4) + 60 * std::fmod(std::floor(n / 100), 100) +
           std::fmod(n, 100);
  });
  const auto [number_low, number_high] = steps_of(numbers, [](double n) { return n; });
  return low > 0 && high <= 2 * low && number_high > 2 * number_low && number_high >= 40 + high;
}

const Epoch* epoch_of(const std::vector<double>& numbers, bool is_named, bool has_unit) {
  constexpr double step_s_max = 3600.0;
  for (const Epoch& epoch : epochs) {
    if (epoch.only_named && !is_named) continue;
    // Whole numbers of that size may be ms of a counter of 32 bits.
    if (epoch.only_named && epoch.per_second == 1 && !has_unit && are_multiples_of(1, numbers))
      continue;
    // WinCC's Time_ms, which has decimals.
    if (epoch.only_named && epoch.per_second > 1 && are_multiples_of(1, numbers)) continue;
    // Steps of 86.4 s are unlikely: these are seconds.
    if (epoch.per_second < 1 && !has_unit && are_multiples_of(0.001, numbers)) continue;
    if (!has_unit && !has_steps_below(step_s_max * epoch.per_second * 1.001, numbers)) continue;
    if (!numbers.empty() && std::ranges::all_of(numbers, [&](double number) {
          return number >= epoch.low && number < epoch.high;
        }))
      return &epoch;
  }
  return nullptr;
}

}  // namespace thermocomp
