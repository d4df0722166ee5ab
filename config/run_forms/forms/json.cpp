#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include <nlohmann/json.hpp>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/outer_json.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp::forms {
namespace {

using nlohmann::json;

// Limits for a run of the same size as a text file.
constexpr JsonLimits limits{16, 8'000'000, std::size_t{64} << 20};

json parsed(const Log& log, std::string_view text, int line) {
  try {
    return parse_outer_json(text, limits);
  } catch (const JsonError& error) {
    log.refuse(line, "", "(no JSON)", error.what());
  }
}

// ---- Moonraker's temperature store

struct Series {
  const char* key;
  const char* end;
  double factor;
  const char* note;
};
constexpr Series series[] = {{"temperatures", "_degC", 1.0, ""},
                             {"targets", "_target", 1.0, ", a signal: what the heater was set to"},
                             {"powers", "_power_percent", 100.0, ", times 100"},
                             {"speeds", "_speed_percent", 100.0, ", times 100"}};

bool is_store(const json& store) {
  return store.is_object() && std::ranges::any_of(store, [](const json& object) {
           return object.is_object() && object.contains("temperatures");
         });
}

/// "temperature_sensor chamber" is called chamber, unless ambiguous.
PlainTable plain_store(const Log& log, const json& store) {
  const auto last_word = [](const std::string& full) { return full.substr(full.rfind(' ') + 1); };
  std::map<std::string, int> same;
  for (const auto& [full, object] : store.items()) ++same[last_word(full)];
  PlainTable table;
  table.has_own_names = true;
  const double period_s = log.map.period_s.value_or(1.0);
  table.notes.push_back("temperature store of Moonraker, a row each " + number_text(period_s) +
                        " s" + (log.map.period_s ? "" : " (its own period)") +
                        "; it has no time of day");
  NamedColumns columns;
  const std::size_t time = columns.add("time_s");
  std::optional<std::size_t> size;
  for (const auto& [full, object] : store.items())
    for (const Series& one : series) {
      if (!object.is_object() || !object.contains(one.key)) continue;
      const json& list = object[one.key];
      const std::string key = full + "." + one.key;
      if (!list.is_array()) log.refuse(0, key, list.type_name(), "must be a list of numbers");
      const std::string name = last_word(full);
      const std::string column_name = plain_name(same[name] == 1 ? name : full) + one.end;
      const std::size_t column = columns.add(column_name);
      for (std::size_t row = 0; row < list.size(); ++row) {
        const json& value = list[row];
        if (!value.is_number() && !value.is_null())
          log.refuse(0, key, value.dump(), "must be a number or null");
        columns.cell(row, column) =
            value.is_null() ? "" : number_text(one.factor * value.get<double>());
      }
      if (list.size() != size.value_or(list.size()))
        log.refuse(0, key, std::to_string(list.size()) + " values",
                   "must be as many as the others have, " + std::to_string(*size));
      size = list.size();
      table.notes.push_back("'" + full + "' " + one.key + " is " + column_name + one.note);
    }
  for (std::size_t row = 0; row < columns.rows(); ++row)
    columns.cell(row, time) = number_text(static_cast<double>(row) * period_s);
  table.text = columns.text();
  return table;
}

// ---- records

/// The first member with one of these names; null: none.
json first_of(const json& object, std::initializer_list<const char*> names) {
  for (const char* name : names)
    if (object.is_object() && object.contains(name)) return object[name];
  return nullptr;
}

/// {"value": 68, "unit": "°F"}; empty: something else.
std::string value_with_unit(const json& object) {
  const json value = first_of(object, {"value", "val"});
  const json unit = first_of(object, {"unit", "units", "uom"});
  if (!value.is_number() || !unit.is_string()) return {};
  return number_text(value.get<double>()) + " " + unit.get<std::string>();
}

/// Units by name in an object called "units" or "hourly_units" of the document.
std::map<std::string, std::string> stated_units(const json& document) {
  std::map<std::string, std::string> units;
  if (!document.is_object()) return units;
  for (const auto& [key, object] : document.items()) {
    if (!object.is_object() || !(key == "units" || key.ends_with("_units"))) continue;
    for (const auto& [name, unit] : object.items())
      if (unit.is_string() && name != "time") units[name] = unit.get<std::string>();
  }
  return units;
}

class Records {
 public:
  /// @param units  by name
  explicit Records(const Log& log, std::map<std::string, std::string> units = {})
      : log_(log), columns_(std::move(units)) {}

  /// @param time  given outside of the record; empty: one of its values
  void add(const json& record, const std::string& time = {}) {
    row_ = columns_.rows();
    if (!time.empty()) set("time", time);
    add_members("", record);
  }

  [[nodiscard]] bool empty() const { return columns_.rows() == 0; }
  [[nodiscard]] std::string text() const { return columns_.text(); }

 private:
  void set(const std::string& name, const std::string& text) {
    columns_.cell(row_, columns_.find_or_add(name)) = text;
  }

  void add_members(const std::string& before, const json& record) {
    for (const auto& [key, value] : record.items()) add_value(before + key, value);
  }

  void add_value(const std::string& name, const json& value) {
    if (value.is_array())
      add_list(name, value);
    else if (const std::string with_unit = value_with_unit(value); !with_unit.empty())
      set(name, in_quotes(with_unit));
    else if (value.is_object())
      add_members(name + ".", value);
    else if (value.is_boolean())
      set(name, value.get<bool>() ? "1" : "0");
    else if (value.is_number())
      set(name, value.is_number_float() ? number_text(value.get<double>()) : value.dump());
    else if (value.is_string())
      set(name, in_quotes(value.get<std::string>()));
  }

  /// Names each element by its own name, else by its number.
  void add_list(const std::string& name, const json& list) {
    bool has_names = !list.empty();
    std::set<std::string> seen;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const json own = first_of(list[i], {"name", "id", "sensor", "tag", "channel"});
      has_names = has_names && own.is_string();
      const std::string element = own.is_string() ? own.get<std::string>() : std::to_string(i + 1);
      if (!seen.insert(element).second)
        log_.refuse(0, name, element, "must be the name of one element of a list");
      add_value(name + "." + element, list[i]);
    }
    const std::size_t expected = lengths_.emplace(name, list.size()).first->second;
    if (!has_names && list.size() != expected)
      log_.refuse(0, name, std::to_string(list.size()) + " values",
                  "must have as many as the record before, " + std::to_string(expected) +
                      ": write null for a missing one");
  }

  const Log& log_;
  std::map<std::string, std::size_t> lengths_;  ///< of lists, by their name
  NamedColumns columns_;
  std::size_t row_{0};
};

constexpr int depth_max = 5;

/// The record of a list of values and one of their names.
json record_of(const json& names, const json& values) {
  json record;
  for (std::size_t i = 0; values.is_array() && i < std::min(names.size(), values.size()); ++i)
    if (names[i].is_string()) record[names[i].get<std::string>()] = values[i];
  return record;
}

/// Tables with the names once: by rows (InfluxDB 1, pandas "split"), by columns, or as series of
/// times and values (Prometheus).
/// @return false: the object is not a table
bool add_table(const json& object, Records& records) {
  const auto list = [&](const char* key) {
    const auto found = object.find(key);
    return found != object.end() && found->is_array() ? &*found : nullptr;
  };
  const json* rows = list("values") != nullptr ? list("values") : list("data");
  const json* names = list("columns");
  if (rows != nullptr && names != nullptr) {
    const json* index = list("index");
    for (std::size_t i = 0; i < rows->size(); ++i) {
      json record = record_of(*names, (*rows)[i]);
      if (index != nullptr && i < index->size()) record["time"] = (*index)[i];
      records.add(record);
    }
    return true;
  }
  if (rows != nullptr && object.contains("metric")) {
    for (const json& point : *rows) {
      if (!point.is_array() || point.size() != 2) return false;
      json record = object["metric"];
      record["time"] = point[0];
      record["value"] = point[1];
      records.add(record);
    }
    return true;
  }
  const bool has_columns = object.size() > 1 && std::ranges::all_of(object, [&](const json& each) {
                             return each.is_array() && each.size() > 1 &&
                                    each.size() == object.front().size() &&
                                    each.front().is_primitive();
                           });
  for (std::size_t i = 0; has_columns && i < object.front().size(); ++i) {
    json record;
    for (const auto& [name, values] : object.items()) record[name] = values[i];
    records.add(record);
  }
  return has_columns;
}

/// {"ts": ..., "value": ...} of a list under the name of a series
bool is_point(const json& record) {
  return record.is_object() && record.size() == 2 && record.contains("value") &&
         !first_of(record, {"ts", "t", "time", "timestamp"}).is_null();
}

/// Collects the tables anywhere in a document or, without `tables`, the records in lists or keyed
/// by their time.
void collect(const json& value, bool tables, int depth, Records& records) {
  if (depth > depth_max || !value.is_structured() ||
      (tables && value.is_object() && add_table(value, records)))
    return;
  for (const auto& [key, each] : value.items()) {
    const bool is_timed = value.is_object() && parse_time_stamp(key);
    const bool is_list = value.is_object() && each.is_array();
    if (is_list && std::ranges::all_of(each, is_point)) {
      for (json point : each) {
        point["series"] = key;
        records.add(point);
      }
    } else if (!tables && each.is_object() && (value.is_array() || is_timed))
      records.add(each, is_timed ? in_quotes(key) : "");
    else
      collect(each, tables, depth + 1, records);
  }
}

PlainTable plain_lines(const Log& log) {
  Records records(log);
  std::string_view rest = log.text;
  for (int line = 1; !rest.empty(); ++line) {
    const std::string_view text = trimmed(take_line(rest));
    if (text.empty()) continue;
    const json record = parsed(log, text, line);
    if (!record.is_object()) log.refuse(line, "", "(other JSON)", "must be an object, {...}");
    records.add(record);
  }
  return {records.text(), {"JSON, a record a line; what a record does not have is missing"}, -1};
}

bool is_json(std::string_view text) {
  const std::string_view first = trimmed(text.substr(0, text.find('\n')));
  if (first.starts_with('{')) return true;
  // "[INFO]" begins a line of another kind of log.
  const auto next = text.find_first_not_of(" \t\r\n[");
  return first.starts_with('[') && next != std::string_view::npos && text[next] == '{';
}

}  // namespace

std::optional<PlainTable> json_log(const Log& log) {
  if (!is_json(log.text)) return std::nullopt;
  std::string_view rest = log.text;
  const std::string_view first = trimmed(take_line(rest));
  const bool is_lines = first.starts_with('{') && first.ends_with('}') &&
                        rest.find_first_not_of(" \t\r\n") != std::string_view::npos;
  if (is_lines) return plain_lines(log);
  json document = parsed(log, log.text, 0);
  if (document.is_object() && document.contains("result"))
    document = json(std::move(document["result"]));
  if (is_store(document)) return plain_store(log, document);
  Records records(log, stated_units(document));
  collect(document, true, 0, records);
  const bool has_tables = !records.empty();
  if (!has_tables) collect(document, false, 0, records);
  if (records.empty())
    log.refuse(
        0, "", "(other JSON)",
        "must be records (a line each, a list, or each under its time), lists of values with "
        "their names, or the answer of Moonraker's server/temperature_store, a list "
        "\"temperatures\" for each heater and sensor");
  return PlainTable{records.text(),
                    {has_tables ? "JSON, names once and lists of values"
                                : "JSON, a row a record; what a record does not have is missing"}};
}

}  // namespace thermocomp::forms
