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

Codes codes_of(const TextColumn& column) {
  const std::string name = small_letters(column.header);
  const auto has = [&](std::string_view part) { return name.find(part) != std::string::npos; };
  if (has("valid")) return Codes::validity;
  if (has("qualit") || has("status")) return Codes::opc;
  // Under another name if most are OPC's "good".
  std::size_t good = 0;
  for (const std::string_view field : column.fields) {
    const auto code = code_of(field);
    if (!code || *code > 255) return Codes::none;
    if (*code == 192) ++good;
  }
  return 2 * good >= column.fields.size() ? Codes::opc : Codes::none;
}

}  // namespace

bool names_units(std::string_view header) {
  return is_one_of(unit_names, header.substr(header.rfind('.') + 1));
}

bool names_series(std::string_view header) {
  return is_one_of(series_names, header);
}

bool is_text(const TextColumn& column) {
  return std::ranges::none_of(column.fields, [](std::string_view field) {
    return looks_like_number(field) || switch_word(field);
  });
}

std::vector<bool> bad_rows(const TextColumn& column) {
  const Codes codes = codes_of(column);
  std::vector<bool> bad;
  bool has_good = false;
  for (const std::string_view field : column.fields) {
    const Quality quality = quality_of(field, codes);
    has_good = has_good || quality == Quality::good;
    bad.push_back(quality == Quality::bad);
  }
  return has_good ? bad : std::vector<bool>();
}

void join_units(TextTable& table) {
  for (std::size_t i = 1; i < table.columns.size(); ++i) {
    const TextColumn& units = table.columns[i];
    if (!names_units(units.header) || table.map.uses(units.header)) continue;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      const std::string_view unit = units.fields[row];
      std::string_view& value = table.columns[i - 1].fields[row];
      if (spelled_unit(unit) != nullptr && looks_like_number(value) &&
          number_text_of(value).unit == nullptr)
        value = table.joined.emplace_back(std::string(value) + ' ' + std::string(unit));
    }
  }
}

void leave_bad_values_out(TextTable& table) {
  const std::size_t columns = table.columns.size();
  std::vector<std::vector<bool>> bad(columns);  // empty: the column holds no qualities
  std::optional<bool> is_before;                // whether a quality precedes its values
  std::string names;
  for (std::size_t i = 0; i < columns; ++i) {
    const TextColumn& column = table.columns[i];
    if (column.is_time || table.map.uses(column.header)) continue;
    bad[i] = bad_rows(column);
    if (!is_before) is_before = !bad[i].empty();
    if (!bad[i].empty()) names += (names.empty() ? "'" : ", '") + column.header + "'";
  }
  if (names.empty()) return;
  std::size_t count = 0;
  const std::vector<bool>* judge = nullptr;
  for (std::size_t k = 0; k < columns; ++k) {
    const std::size_t i = *is_before ? k : columns - 1 - k;
    if (!bad[i].empty()) judge = &bad[i];
    if (judge == nullptr || !bad[i].empty() || table.columns[i].is_time) continue;
    for (std::size_t row = 0; row < table.rows(); ++row) {
      if (!(*judge)[row]) continue;
      table.columns[i].fields[row] = {};
      ++count;
    }
  }
  table.notes.push_back(names + (*is_before ? " before" : " behind") +
                        " values say whether they are good; bad, hence missing: " +
                        std::to_string(count) + " values");
}

std::string unclear_role(const TextColumn& column) {
  const std::string name = toml_text(column.header);
  const auto is_number = [](std::string_view field) { return finite_number(field).has_value(); };
  if (!std::ranges::all_of(column.fields, is_number) || column.has_one_value() ||
      increases(column, finite_number))
    return {};
  if (is_one_of(numbered_names, column.header))
    return "may say which sensor a row is of: write pivot = [" + name +
           ", \"the column of the values\"] in the file of --columns, or ignore = [" + name +
           "] if all rows are of the same";
  if (is_one_of(time_part_names, column.header))
    return "may be a part of the time: write the whole time in one column, or ignore = [" + name +
           "] in the file of --columns if the time is complete without it";
  return {};
}

}  // namespace thermocomp
