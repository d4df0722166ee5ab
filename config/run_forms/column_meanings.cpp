#include "config/run_forms/column_meanings.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdint>
#include <optional>
#include <set>
#include <utility>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {
namespace {

constexpr std::string_view unit_names = "|unit|units|einheit|unit_of_measurement|uom|u|";
constexpr std::string_view series_names =
    "|sensor|sensors|sensor_id|sensor id|sensor_name|sensor name|channel|kanal|tag|tagname"
    "|tag name|probe|place|point|messstelle|series|signal|variable|parameter|name|_field"
    "|metric|item|topic|entity_id|sphere|device|device_id|device id|device name|node|logger|";
/// Names of quantities whose sensors may be numbered.
constexpr std::string_view numbered_names =
    "|sensor|sensor_id|channel|kanal|ch|chan|probe|messstelle|sphere|";
constexpr std::string_view time_part_names =
    "|day|hour|minute|second|sec|secs|millis|milliseconds|ms|msec|us|usec|micros"
    "|microseconds|ns|nsec|nanoseconds|";

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

/// Reads words or, with `codes`, a number: OPC defines 192 to 255 as good and numbers below 64 as
/// bad, OPC UA numbers from 0x80000000 on as bad.
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
  // A column of another name holds qualities if most are OPC's "good".
  std::size_t good = 0;
  for (const std::string_view field : column.fields) {
    const auto code = code_of(field);
    if (!code || *code > 255) return Codes::none;
    if (*code == 192) ++good;
  }
  return 2 * good >= column.fields.size() ? Codes::opc : Codes::none;
}

/// Suggested name for a column without a unit; the user corrects it.
std::string example_name(std::string_view base) {
  std::string name = plain_name(base);
  if (name.empty()) return "t1_degC";
  return name + (name.front() >= 'x' && name.front() <= 'z' ? "_um" : "_degC");
}

/// "ΔT", "dT bed-head", "Temp diff", "rise above ambient".
bool names_difference(const std::string& base) {
  if (base.starts_with("dT") || base.starts_with("DT")) return true;
  const std::string name = small_letters(base);
  for (const std::string_view word : {"Δ", "∆", "delta", "diff", "rise", "change", "minus"})
    if (name.find(word) != std::string::npos) return true;
  return false;
}

/// "0.1", "x10", "*0.1"
bool is_factor(std::string_view word) {
  const bool is_marked = word.starts_with('x') || word.starts_with('*');
  if (is_marked) word.remove_prefix(1);
  return finite_number(word) && (is_marked || word.find('.') != std::string_view::npos);
}

/// The first unit of a column's cells, if each number has one: otherwise the A in "80.6 A" may be a
/// flag.
std::string_view unit_of_cells(const TextColumn& column) {
  std::string_view first;
  for (const std::string_view field : column.fields) {
    const SpelledUnit* unit = number_text_of(field).unit;
    if (unit == nullptr && looks_like_number(field)) return {};
    if (first.empty() && unit != nullptr) first = unit->spelling;
  }
  return first;
}

/// "Temp", "bed_temp", "T4", "t_bed"
bool names_temperature(std::string_view base) {
  const std::string name = small_letters(base);
  const auto digit = name.find_first_not_of("0123456789", 1);
  return name.find("temp") != std::string::npos || name.starts_with("t_") ||
         name.starts_with("t ") || (name.starts_with('t') && digit == std::string::npos);
}

/// "T4_C", "Temp F", "tempC": a temperature's name and the letter of its unit; nullopt: another
/// name, or one of a row of letters, such as Temp A, Temp B, Temp C.
std::optional<SpelledName> lettered_name(const TextTable& table, std::string_view header) {
  if (header.size() < 2 || (header.back() != 'C' && header.back() != 'F')) return std::nullopt;
  const std::string_view front = header.substr(0, header.size() - 1);
  const auto is_sibling = [&](const TextColumn& other) {
    const std::string_view name = other.header;
    return name.size() == header.size() && name.starts_with(front) && name.back() >= 'A' &&
           name.back() <= 'Z' &&
           std::string_view("CFK").find(name.back()) == std::string_view::npos;
  };
  if (std::ranges::any_of(table.columns, is_sibling)) return std::nullopt;
  std::string_view base = front;
  while (!base.empty() && (base.back() == '_' || base.back() == ' ')) base.remove_suffix(1);
  // Without a blank: "tempC", not "Temp1F", a floor.
  const bool is_joined = base.size() == front.size();
  if (base.empty() ||
      (is_joined && !(names_temperature(base) && base.back() >= 'a' && base.back() <= 'z')))
    return std::nullopt;
  const std::string_view unit = header.substr(header.size() - 1);
  return SpelledName{std::string(base), std::string(unit), spelled_unit(unit)};
}

/// A name that keeps its meaning in a file of our own form.
bool is_plain(const std::string& name) {
  return is_column_name(name) && spelled_name(name).known == nullptr && name != "time_s";
}

/// Whether a header is a name of ours with a unit: "T1_degC".
bool has_own_unit(const std::string& header) {
  return is_column_name(header) && !unit_of(header).suffix.empty();
}

/// "3 K rpm", "4.5 K rpm": numbers with a unit that is not known.
bool begins_with_numbers(const TextColumn& column) {
  const auto is_empty = [](std::string_view field) { return field.empty(); };
  const auto begins = [](std::string_view field) {
    return field.empty() || finite_number(field.substr(0, field.find(' ')));
  };
  return std::ranges::all_of(column.fields, begins) &&
         !std::ranges::all_of(column.fields, is_empty);
}

/// Whether the column numbers the rows, 0 1 2 or 1 2 3.
bool counts_rows(const TextColumn& column) {
  const auto first = finite_number(column.fields[0]);
  if (!first || (*first != 0.0 && *first != 1.0)) return false;
  double next = *first;
  return column.fields.size() > 1 &&
         std::ranges::all_of(
             column.fields, [&](std::string_view field) { return finite_number(field) == next++; });
}

/// Whether the same different fields recur in the same order, as addresses of devices that are
/// polled one after the other: 1 2 3 1 2 3.
bool recurs(const TextColumn& column) {
  constexpr std::size_t period_max = 64;
  const auto& fields = column.fields;
  const auto end = std::find(fields.begin() + 1, fields.end(), fields[0]);
  const auto period = static_cast<std::size_t>(end - fields.begin());
  if (period < 2 || period > period_max || fields.size() < 4 * period) return false;
  for (std::size_t row = period; row < fields.size(); ++row)
    if (fields[row] != fields[row - period]) return false;
  return std::set<std::string_view>(fields.begin(), end).size() == period;
}

/// "{ name = "t1_degC", unit = "0.1 degC" }"
std::string with_name_and_unit(const std::string& name, const std::string& unit) {
  return "{ name = " + toml_text(name) + ", unit = " + toml_text(unit) + " }";
}

class MeaningFinder {
 public:
  explicit MeaningFinder(TextTable& table) : table_(table) {}

  std::vector<ColumnMeaning> find() {
    check_map();
    for (std::size_t i = 0; i < table_.columns.size(); ++i) {
      const TextColumn& column = table_.columns[i];
      if (column.is_time) continue;
      const bool is_mapped = table_.map.find(column.header) != nullptr;
      if (table_.map.ignores(column.header))
        note_on(column, " left out");
      else if (const std::string why = is_mapped ? "" : no_value(column); !why.empty())
        note_on(column, " left out: " + why);
      else if (const std::string role = is_mapped ? "" : unclear_role(column); !role.empty())
        table_.refuse_column(i, role);
      else if (auto meaning = meaning_of(i))
        take(i, std::move(*meaning), is_mapped);
    }
    if (found_.empty() && table_.problems.empty())
      table_.problems.add(0, "", "", "has no column of numbers besides the time");
    return std::move(found_);
  }

 private:
  void note_on(const TextColumn& column, const std::string& text) {
    table_.notes.push_back("'" + column.header + "'" + text);
  }

  void check_map() {
    std::vector<std::string> headers;
    for (const TextColumn& column : table_.columns) headers.push_back(column.header);
    const auto check = [&](const std::string& key, const std::string& header) {
      const auto count = std::ranges::count(headers, header);
      if (count == 1 || (count == 0 && table_.map.is_of_several)) return;
      std::string rule = count > 1 ? "appears twice in " : "is not a column of ";
      rule += table_.problems.file();
      std::string near = nearest_name(header, headers);
      for (const std::string& each : headers)
        if (spelled_name(each).base == header) near = each;  // equal except for the unit
      if (count == 0 && !near.empty()) rule += "; '" + near + "' is";
      table_.refuse_map(key, header, rule);
    };
    for (const auto& [header, column] : table_.map.columns) check("columns", header);
    for (const std::string& header : table_.map.ignored)
      if (!header.empty()) check("ignore", header);
  }

  /// Reason why an unmapped column is not a value; empty: it is one.
  [[nodiscard]] std::string no_value(const TextColumn& column) const {
    const std::string& header = column.header;
    const bool has_no_unit = column.unit.empty() && !has_own_unit(header);
    const bool is_count = is_unnamed(header) || header == "#" || header == "RECORD" ||
                          header == "No." || header == "Nr." || header == "index" ||
                          (has_no_unit && table_.rows() >= 10);
    if (is_count && (counts_rows(column) || header == "RECORD")) return "it counts the rows";
    if (time_unit(column.unit) != nullptr) return "another time";
    if (!bad_rows(column).empty()) return "it is the quality of values";
    const bool may_be_value = spelled_unit(column.unit) != nullptr || has_own_unit(header) ||
                              !is_text(column) || begins_with_numbers(column);
    return may_be_value ? "" : "no field of it is a number";
  }

  void take(std::size_t i, ColumnMeaning meaning, bool is_mapped) {
    if (!is_mapped)
      meaning.name =
          unused_name(meaning.name, [&](const std::string& name) { return names_.contains(name); });
    if (!names_.insert(meaning.name).second) {
      table_.refuse_column(i, "becomes " + meaning.name + ", which appears twice: " +
                                  write_column(meaning.source->header, "\"another name\""));
      return;
    }
    note(meaning, is_mapped);
    found_.push_back(std::move(meaning));
  }

  void note(const ColumnMeaning& meaning, bool is_mapped) {
    const std::string& header = meaning.source->header;
    std::string text = " is " + meaning.name;
    const bool has_unit = !unit_of(meaning.name).suffix.empty();
    if (!has_unit) text += ", a signal without unit";
    if (!has_unit && !is_mapped && !table_.has_own_names && table_.map.takes_signals &&
        table_.map.names.empty())
      text += " (if it has one, " +
              write_column(
                  header, toml_text(example_name(spelled_name(header).base)) + ", or what it is,") +
              ")";
    const auto& [factor, offset] = meaning.conversion;
    if (factor != 1.0) text += ", times " + number_text(factor);
    if (offset != 0.0) text += ", plus " + number_text(offset);
    if (kind_of(meaning.name) == QuantityKind::position && meaning.name != header)
      text += ", a position (a displacement: " +
              write_column(header, toml_text(without_unit(meaning.name) + "_um")) + ")";
    note_on(*meaning.source, text);
  }

  // ---- meaning of one column
  /// @return nullopt: refused
  std::optional<ColumnMeaning> meaning_of(std::size_t i) {
    const TextColumn& column = table_.columns[i];
    const std::string& header = column.header;
    const auto refused = [&](std::string rule) {
      table_.refuse_column(i, std::move(rule));
      return std::nullopt;
    };
    const SpelledName of_header = spelled_name(header);
    SpelledName spelled = of_header;
    if (spelled.unit.empty() && !column.unit.empty()) {
      spelled.unit = column.unit;
      spelled.known = spelled_unit(column.unit);
    }
    const auto lettered = spelled.unit.empty() && !has_own_unit(header)
                              ? lettered_name(table_, header)
                              : std::nullopt;
    const bool is_temperature_name = lettered && names_temperature(lettered->base);
    if (is_temperature_name) spelled = *lettered;
    const MappedColumn* mapped = table_.map.find(header);
    if (lettered && !is_temperature_name && mapped == nullptr && !is_text(column))
      return refused("may be in deg" + lettered->unit + ": " +
                     write_column(header, with_name_and_unit(plain_name(lettered->base) + "_degC",
                                                             "deg" + lettered->unit) +
                                              ", or " + toml_text(plain_name(header)) +
                                              " for a signal,"));
    const bool has_own = of_header.unit.empty() && has_own_unit(header);
    if (mapped == nullptr || mapped->unit.empty()) {
      if (const std::string why = unclear_unit(column, spelled); !why.empty()) return refused(why);
      if (has_own && spelled.known != nullptr && spelled.known->dimension != "none") {
        const auto own = conversion(*spelled.known, header);
        if (!own || !own->is_identity())
          return refused("names one unit, and its column is in " + spelled.unit + ": " +
                         write_column(header, with_name_and_unit(header, spelled.unit)) +
                         ", or the unit that is true");
        if (mapped == nullptr) return ColumnMeaning{&column, header, {}};
      }
    }
    if (mapped != nullptr) return mapped_meaning(column, *mapped, spelled);
    if (spelled.unit.empty() && has_own) return ColumnMeaning{&column, header, {}};
    if (spelled.unit.empty() && takes_signal(header) && is_column_name(plain_name(header)))
      return ColumnMeaning{&column, plain_name(header), {}};
    if (spelled.known == nullptr || spelled.known->dimension == "time")
      return refused(unknown_unit(header, spelled));
    const std::string name = plain_name(spelled.base).append(spelled.known->suffix);
    if (plain_name(spelled.base).empty() || unit_of(name).suffix != spelled.known->suffix ||
        !is_plain(name))
      return refused("is not a descriptive name: " + write_column(header, "\"its name\""));
    return ColumnMeaning{&column, name,
                         conversion(*spelled.known, name).value_or(UnitConversion{})};
  }

  [[nodiscard]] bool takes_signal(const std::string& header) const {
    return table_.has_own_names || table_.map.takes_signals ||
           std::ranges::find(table_.map.names, header) != table_.map.names.end();
  }

  static std::string unknown_unit(const std::string& header, const SpelledName& spelled) {
    const std::string end =
        " under [columns], or " + ignore_column(header) + ", in the file of --columns";
    if (spelled.unit.empty())
      return "has no unit: write " + toml_text(header) + " = " +
             toml_text(example_name(spelled.base)) +
             " (or what it is; without a unit it is a signal)" + end;
    const bool has_factor = unit_with_factor(spelled.unit).has_value();
    return "has an unknown unit, " + spelled.unit + ": write " + toml_text(header) + " = " +
           toml_text(plain_name(spelled.base + "_" + spelled.unit)) + ", a signal, or " +
           with_name_and_unit("its name", has_factor ? spelled.unit : "a known unit") + end;
  }

  /// Reason why the unit of a column is doubtful; empty: it is clear.
  [[nodiscard]] std::string unclear_unit(const TextColumn& column,
                                         const SpelledName& spelled) const {
    if (spelled.known == nullptr) return {};
    const auto ask = [&](const std::string& name, const std::string& unit,
                         const std::string& other = "what is true") {
      return ": " + write_column(column.header, with_name_and_unit(plain_name(name), unit) +
                                                    ", or " + other + ",");
    };
    if (spelled.known->suffix == "_degC" && spelled.known->offset != 0.0 &&
        names_difference(spelled.base))
      return "may be a difference of temperatures" +
             ask(spelled.base + "_K", "delta_degF", "unit = \"degF\" with a name in _degC");
    const std::string of_name = spelled_name(column.header).unit;
    const std::string& in_row = column.unit_in_row;
    const SpelledUnit* row = spelled_unit(in_row);
    if (!of_name.empty() && row != nullptr && row->dimension != "none" &&
        !row->measures_as(*spelled.known))
      return "may be in " + of_name + ", as its name says, or in " + in_row +
             ", as the row of units says" + ask(spelled.base + std::string(row->suffix), in_row);
    const auto factor = spelled.base.find_last_of(" _") + 1;
    if (is_factor(std::string_view(spelled.base).substr(factor)))
      return "may be a multiple of its unit" +
             ask(std::string(trimmed(spelled.base.substr(0, factor))) +
                     std::string(spelled.known->suffix),
                 "0.1 " + spelled.unit);
    const bool is_prefix = spelled.known->spelling == "K" || spelled.known->spelling == "m";
    if (of_name.empty() && in_row.empty() && is_prefix)
      return "has numbers with " + spelled.unit + ", which may be a unit or mean " +
             (spelled.unit == "K" ? "a thousand" : "a thousandth") +
             ask(spelled.base + std::string(spelled.known->suffix), spelled.unit);
    return {};
  }

  std::optional<ColumnMeaning> mapped_meaning(const TextColumn& column, const MappedColumn& mapped,
                                              const SpelledName& spelled) {
    const auto refused = [&](const std::string& rule) {
      table_.refuse_map("columns", mapped.name, rule);
      return std::nullopt;
    };
    if (!is_plain(mapped.name)) return refused(std::string(column_name_rule));
    const SpelledUnit* known = spelled.known;
    const auto unit = !mapped.unit.empty() ? unit_with_factor(mapped.unit)
                      : known != nullptr   ? std::optional(*known)
                                           : std::nullopt;
    if (!unit && !spelled.unit.empty()) {
      if (!unit_of(mapped.name).suffix.empty() && may_be_unit(spelled.unit))
        return refused("may not be the unit of '" + column.header + "': write " +
                       with_name_and_unit(mapped.name, "that of the file") +
                       ", such as degC, 0.1 degC or mil");
      table_.notes.push_back("in '" + column.header + "' '" + spelled.unit +
                             "' is taken for a part of the name, not for a unit");
    }
    if (!unit) return ColumnMeaning{&column, mapped.name, {}};
    const auto converted = conversion(*unit, mapped.name);
    if (!converted)
      return refused("cannot be made from '" + column.header + "', which is in " +
                     std::string(unit->spelling));
    return ColumnMeaning{&column, mapped.name, *converted};
  }

  TextTable& table_;
  std::set<std::string> names_{"time_s"};
  std::vector<ColumnMeaning> found_;
};

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

void read_units(TextTable& table) {
  for (TextColumn& column : table.columns) {
    column.unit = spelled_name(column.header).unit;
    if (column.unit.empty()) column.unit = column.unit_in_row;
    if (column.unit.empty()) column.unit = unit_of_cells(column);
  }
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
  const auto is_number = [](std::string_view field) { return finite_number(field).has_value(); };
  if (!std::ranges::all_of(column.fields, is_number) || column.has_one_value() ||
      increases(column, finite_number))
    return {};
  const bool has_unit = !column.unit.empty() || has_own_unit(column.header);
  if (is_one_of(numbered_names, column.header) || (!has_unit && recurs(column)))
    return "may say which sensor a row is of: " + pivot_or_ignore(column.header);
  if (is_one_of(time_part_names, column.header))
    return "may be a part of the time: write the whole time in one column, or " +
           ignore_column(column.header) +
           " in the file of --columns if the time is complete without it";
  return {};
}

std::vector<ColumnMeaning> column_meanings(TextTable& table) {
  return MeaningFinder(table).find();
}

}  // namespace thermocomp
