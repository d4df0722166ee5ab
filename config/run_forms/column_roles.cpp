#include "config/run_forms/column_roles.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"

namespace thermocomp {
namespace {

constexpr auto unit_names = std::to_array<std::string_view>(
    {"unit", "units", "einheit", "unit_of_measurement", "uom", "u"});
constexpr auto series_names = std::to_array<std::string_view>(
    {"sensor", "sensors",    "sensor_id", "sensor_name", "sensor name", "channel",
     "kanal",  "tag",        "tagname",   "tag name",    "probe",       "place",
     "point",  "messstelle", "series",    "signal",      "variable",    "parameter",
     "metric", "item",       "topic",     "entity_id",   "sphere"});
/// Those whose sensors may have numbers.
constexpr auto numbered_names = std::to_array<std::string_view>(
    {"sensor", "sensor_id", "channel", "kanal", "ch", "chan", "probe", "messstelle", "sphere"});
constexpr auto time_part_names = std::to_array<std::string_view>(
    {"day", "hour", "minute", "second", "sec", "secs", "millis", "milliseconds", "ms", "msec", "us",
     "usec", "micros", "microseconds", "ns", "nsec", "nanoseconds"});

enum class Quality { good, bad, other };
enum class Codes { none, opc, validity };  ///< validity: 1 good, 0 bad

/// The number of "192" or, with base 16, "0x000000C0".
std::optional<std::uint64_t> code_of(std::string_view field) {
  const bool is_hex = field.starts_with("0x") || field.starts_with("0X");
  if (is_hex) field.remove_prefix(2);
  std::uint64_t code = 0;
  const char* const end = field.data() + field.size();
  const auto [at, error] = std::from_chars(field.data(), end, code, is_hex ? 16 : 10);
  return error == std::errc() && at == end ? std::optional(code) : std::nullopt;
}

/// Reads words or, with `codes`, a number: OPC calls 192 to 255 good and numbers below 64 bad, OPC
/// UA calls numbers from 0x80000000 on bad.
Quality quality_of(std::string_view field, Codes codes) {
  const std::string word = small_letters(field);
  if (word.starts_with("good") || word == "valid") return Quality::good;
  if (word.starts_with("bad") || word == "invalid") return Quality::bad;
  const auto code = codes == Codes::none ? std::nullopt : code_of(field);
  if (code && codes == Codes::validity)
    return *code == 1 ? Quality::good : *code == 0 ? Quality::bad : Quality::other;
  if (code && *code >= 192 && *code <= 255) return Quality::good;
  return code && (*code < 64 || *code >= 0x80000000) ? Quality::bad : Quality::other;
}

Codes codes_of(const TextTable& table, std::size_t column) {
  const std::string name = small_letters(table.header[column]);
  const auto has = [&](std::string_view part) { return name.find(part) != std::string::npos; };
  if (has("valid")) return Codes::validity;
  if (has("qualit") || has("status")) return Codes::opc;
  // Under another name if most are OPC's "good".
  std::size_t good = 0;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const auto code = code_of(table.field(row, column));
    if (!code || *code > 255) return Codes::none;
    if (*code == 192) ++good;
  }
  return 2 * good >= table.rows() ? Codes::opc : Codes::none;
}

bool has_one_value(const TextTable& table, std::size_t column) {
  for (std::size_t row = 1; row < table.rows(); ++row)
    if (table.field(row, column) != table.field(0, column)) return false;
  return true;
}

bool numbers_rise(const TextTable& table, std::size_t column) {
  for (std::size_t row = 1; row < table.rows(); ++row)
    if (!(finite_number(table.field(row, column)) > finite_number(table.field(row - 1, column))))
      return false;
  return true;
}

bool are_numbers(const TextTable& table, std::size_t column) {
  for (std::size_t row = 0; row < table.rows(); ++row)
    if (!finite_number(table.field(row, column))) return false;
  return true;
}

}  // namespace

bool names_units(std::string_view header) {
  return is_one_of(unit_names, header.substr(header.rfind('.') + 1));
}

bool names_series(std::string_view header) {
  return is_one_of(series_names, header);
}

std::vector<bool> bad_rows(const TextTable& table, std::size_t column) {
  const Codes codes = codes_of(table, column);
  std::vector<bool> bad(table.rows());
  bool has_good = false;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const Quality quality = quality_of(table.field(row, column), codes);
    has_good = has_good || quality == Quality::good;
    bad[row] = quality == Quality::bad;
  }
  if (!has_good) bad.clear();
  return bad;
}

void join_units(TextTable& table, const ColumnMap* map) {
  for (std::size_t i = 1; i < table.columns(); ++i) {
    if (!names_units(table.header[i]) || (map != nullptr && map->uses(table.header[i]))) continue;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const std::string_view unit = table.field(row, i);
      std::string_view& value = table.fields[row * table.columns() + i - 1];
      if (spelled_unit(unit) == nullptr || !looks_like_number(value) ||
          number_text_of(value).unit != nullptr)
        continue;
      value = table.joined.emplace_back(std::string(value) + ' ' + std::string(unit));
    }
  }
}

std::string leave_bad_values_out(TextTable& table, const TimeColumns& time, const ColumnMap* map) {
  std::vector<std::vector<bool>> bad(table.columns());  // empty: the column holds no qualities
  std::optional<bool> is_before;                        // whether a quality precedes its values
  std::string names;
  for (std::size_t i = 0; i < table.columns(); ++i) {
    if (time.has(i) || (map != nullptr && map->uses(table.header[i]))) continue;
    bad[i] = bad_rows(table, i);
    if (!is_before) is_before = !bad[i].empty();
    if (!bad[i].empty()) names += (names.empty() ? "'" : ", '") + table.header[i] + "'";
  }
  if (names.empty()) return {};
  std::size_t count = 0;
  for (std::size_t i = 0; i < table.columns(); ++i) {
    if (time.has(i) || !bad[i].empty()) continue;
    std::size_t quality = i;
    while (quality < table.columns() && bad[quality].empty()) quality += *is_before ? -1UL : 1UL;
    if (quality >= table.columns()) continue;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      if (!bad[quality][row]) continue;
      table.fields[row * table.columns() + i] = {};
      ++count;
    }
  }
  return names + (*is_before ? " before" : " behind") +
         " values say whether they are good; bad, hence missing: " + std::to_string(count) +
         " values";
}

std::string unclear_role(const TextTable& table, std::size_t column) {
  const std::string& header = table.header[column];
  const std::string name = toml_text(header);
  if (!are_numbers(table, column) || has_one_value(table, column)) return {};
  if (is_one_of(numbered_names, header) && !numbers_rise(table, column))
    return "may say which sensor a row is of: write pivot = [" + name +
           ", \"the column of the values\"] in the file of --columns, or ignore = [" + name +
           "] if all rows are of the same";
  if (is_one_of(time_part_names, header) && !numbers_rise(table, column))
    return "may be a part of the time: write the whole time in one column, or ignore = [" + name +
           "] in the file of --columns if the time is complete without it";
  return {};
}

}  // namespace thermocomp
