#include "config/run_forms/long_table.hpp"

#include <algorithm>
#include <array>
#include <map>
#include <set>

#include "config/run_forms/column_roles.hpp"
#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/text/units.hpp"

namespace thermocomp {
namespace {

constexpr auto value_names = std::to_array<std::string_view>(
    {"value", "_value", "varvalue", "state", "val", "wert", "reading", "mean", "messwert"});
constexpr std::size_t series_max = 1024;

struct ColumnContent {
  bool numbers{false};  ///< most fields are numbers
  bool complete{true};  ///< no empty field
  std::size_t distinct{0};
};

ColumnContent content_of(const TextTable& table, std::size_t column) {
  ColumnContent content;
  std::set<std::string_view> distinct;
  std::size_t numbers = 0;
  std::size_t filled = 0;
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string_view field = table.field(row, column);
    content.complete = content.complete && !field.empty();
    if (!field.empty()) ++filled;
    if (looks_like_number(field)) ++numbers;
    if (distinct.size() <= series_max) distinct.insert(field);
  }
  content.numbers = 2 * numbers > filled;
  content.distinct = distinct.size();
  return content;
}

bool holds_axes(const TextTable& table, std::size_t column) {
  for (std::size_t row = 0; row < table.rows(); ++row)
    if (!is_axis_letter(table.field(row, column))) return false;
  return true;
}

std::string series_of(const TextTable& table, std::size_t row, const LongForm& form) {
  std::string name;
  for (const std::size_t column : form.names) {
    if (!name.empty()) name += ' ';
    name += table.field(row, column);
  }
  return name;
}

bool increases(const std::vector<double>& time_s) {
  return std::adjacent_find(time_s.begin(), time_s.end(), std::greater_equal<>()) == time_s.end();
}

bool decreases(const std::vector<double>& time_s) {
  return std::adjacent_find(time_s.begin(), time_s.end(), std::less_equal<>()) == time_s.end();
}

std::optional<LongForm> form_of(const TextTable& table, const ColumnMap& map,
                                const std::vector<std::size_t>& numbers, ProblemList& problems) {
  LongForm form;
  std::vector<std::size_t> columns;
  for (const std::string& name : map.pivot) {
    const auto found = std::find(table.header.begin(), table.header.end(), name);
    if (found == table.header.end()) {
      problems.add({map.file, 0, "pivot", name, "must be a column of the run file"});
      return std::nullopt;
    }
    columns.push_back(static_cast<std::size_t>(found - table.header.begin()));
  }
  form.names.assign(1, columns[0]);
  if (columns.size() == 1 && numbers.size() != 1) {
    problems.add({map.file, 0, "pivot", map.pivot[0],
                  "must name the column of the values too: pivot = [" + toml_text(map.pivot[0]) +
                      ", \"its name\"]"});
    return std::nullopt;
  }
  form.value = columns.size() == 2 ? columns[1] : numbers[0];
  return form;
}

/// Keeps the fewest columns of words by which each series has a time only once.
void keep_needed_names(const TextTable& table, const std::vector<double>& time_s, LongForm& form) {
  const auto is_clear = [&](const LongForm& tried) {
    std::set<std::pair<std::string, double>> seen;
    for (std::size_t row = 0; row < table.rows(); ++row)
      if (!seen.emplace(series_of(table, row, tried), time_s[row]).second) return false;
    return true;
  };
  for (const std::size_t column : form.names) {
    LongForm tried = form;
    tried.names.assign(1, column);
    if (!is_clear(tried)) continue;
    form = tried;
    return;
  }
}

/// The columns that a pivot leaves out.
std::vector<std::size_t> other_columns(const TextTable& table, const TimeColumns& time,
                                       const LongForm& form) {
  std::vector<std::size_t> others;
  for (std::size_t i = 0; i < table.columns(); ++i)
    if (!time.has(i) && i != form.value && form.unit != i &&
        std::find(form.names.begin(), form.names.end(), i) == form.names.end())
      others.push_back(i);
  return others;
}

}  // namespace

std::optional<LongForm> long_form(const TextTable& table, const TimeColumns& time,
                                  const std::vector<double>& time_s, const ColumnMap* map,
                                  ProblemList& problems) {
  LongForm form;
  std::vector<std::size_t> numbers;
  std::vector<std::size_t> values;
  for (std::size_t i = 0; i < table.columns(); ++i) {
    if (time.has(i)) continue;
    const ColumnContent here = content_of(table, i);
    const bool named_value = is_one_of(value_names, table.header[i]);
    if (named_value) values.push_back(i);
    if (names_units(table.header[i])) {
      form.unit = i;
    } else if (here.numbers || named_value) {
      // A number for each series, such as InfluxDB's "table", is not a value.
      if (here.distinct > 1 || named_value) numbers.push_back(i);
    } else if (here.complete && here.distinct > 1 && 2 * here.distinct <= table.rows() &&
               here.distinct <= series_max && bad_rows(table, i).empty() &&
               !(map != nullptr && map->ignores(table.header[i]))) {
      form.names.push_back(i);
    }
  }
  if (map != nullptr && !map->pivot.empty()) {
    auto found = form_of(table, *map, values.size() == 1 ? values : numbers, problems);
    if (found) found->unit = form.unit;
    return found;
  }
  // A single series has the same name in all rows.
  if (form.names.empty() && values.size() == 1) {
    for (std::size_t i = 0; i < table.columns(); ++i) {
      if (time.has(i) || i == values[0] || i == form.unit) continue;
      const ColumnContent here = content_of(table, i);
      if (!here.numbers && here.complete && here.distinct == 1) form.names.push_back(i);
    }
    while (form.names.size() > 1) form.names.pop_back();
  }
  // One row per axis, as in a log of corrections.
  if (numbers.size() == 1)
    for (std::size_t i = 0; i < table.columns(); ++i) {
      if (time.has(i) || !holds_axes(table, i)) continue;
      std::vector<std::size_t> names{i};
      for (const std::size_t word : form.names)  // each tool has its own corrections
        if (word != i) names.push_back(word);
      form.names = std::move(names);
      form.value = numbers[0];
      return form;
    }
  if (form.names.empty()) return std::nullopt;
  const bool is_ordered = increases(time_s) || decreases(time_s);
  if (numbers.size() == 1 && !table.has_header && is_ordered) {
    const std::string& name = table.header[form.names[0]];
    problems.add(table.lines[0], name, table.field(0, form.names[0]),
                 "may say what the number of a row is: write pivot = [" + toml_text(name) +
                     "] in the file of --columns, or ignore = [" + toml_text(name) +
                     "] if all numbers are of one sensor");
    return std::nullopt;
  }
  const auto names =
      std::find_if(form.names.begin(), form.names.end(),
                   [&table](std::size_t column) { return names_series(table.header[column]); });
  const bool is_named = names != form.names.end();
  if (values.size() == 1) {
    form.value = values[0];
  } else if (numbers.size() == 1 && (is_named || !is_ordered)) {
    form.value = numbers[0];
  } else {
    if (is_named && !numbers.empty()) {
      const std::string& name = table.header[*names];
      problems.add(table.header_line, name, table.field(0, *names),
                   "names the sensor of a row, whose values are in several columns: write pivot = "
                   "[" +
                       toml_text(name) + ", " + toml_text(table.header[numbers[0]]) +
                       "] to read one of them, or ignore = [" + toml_text(name) +
                       "] if all rows are of one sensor");
    }
    return std::nullopt;
  }
  keep_needed_names(table, time_s, form);
  return form;
}

std::string pivot(TextTable& table, const TimeColumns& time, std::vector<double>& time_s,
                  const LongForm& form, double scan_s, ProblemList& problems) {
  const std::vector<std::size_t> others = other_columns(table, time, form);
  std::vector<bool> bad(table.rows());
  for (const std::size_t column : others) {
    const std::vector<bool> here = bad_rows(table, column);
    for (std::size_t row = 0; row < here.size(); ++row) bad[row] = bad[row] || here[row];
  }
  std::map<double, std::size_t> row_of;
  for (const double at : time_s) row_of.emplace(at, 0);
  std::vector<double> times;
  for (auto& [at, row] : row_of) {
    if (times.empty() || at - times.back() > scan_s) times.push_back(at);
    row = times.size() - 1;
  }
  // The unit comes from a column of units, else from the name of the value's column.
  const std::string& value_name = table.header[form.value];
  std::string value_unit = spelled_name(value_name).unit;
  if (value_unit.empty()) value_unit = unit_of(value_name).symbol;
  std::map<std::string, std::size_t> column_of;
  TextTable wide;
  std::vector<std::vector<std::string_view>> columns;
  wide.lines.assign(times.size(), 0);
  for (std::size_t row = 0; row < table.rows(); ++row) {
    const std::string series = series_of(table, row, form);
    if (series.starts_with("$RT_")) continue;  // WinCC: the archive was switched on or off
    const auto [found, is_new] = column_of.emplace(series, columns.size());
    const std::string_view unit = form.unit ? table.field(row, *form.unit) : value_unit;
    if (is_new && columns.size() < series_max) {
      columns.emplace_back(times.size());
      wide.header.push_back(series);
      wide.units.emplace_back(unit);
    } else if (is_new) {
      problems.add(table.lines[row], table.header[form.names[0]], series,
                   "must be one of at most " + std::to_string(series_max) + " series");
      return {};
    }
    const std::size_t at = row_of.at(time_s[row]);
    std::string_view& cell = columns[found->second][at];
    std::string_view value = bad[row] ? std::string_view() : table.field(row, form.value);
    std::string& of_series = wide.units[found->second];
    if (of_series.empty()) of_series = unit;
    if (unit != of_series && !unit.empty() && looks_like_number(value))
      value = table.joined.emplace_back(std::string(value) + " " + std::string(unit));
    if (!cell.empty() && cell != value)
      problems.add(table.lines[row], series, value,
                   (scan_s > 0 ? "must be there once within scan_s; an earlier row has "
                               : "must be there once at a time; an earlier row of that time has ") +
                       shortened(cell));
    cell = value;
    if (wide.lines[at] == 0) wide.lines[at] = table.lines[row];
  }
  std::string note = "a row per value: '" + table.header[form.names[0]] + "'";
  for (std::size_t i = 1; i < form.names.size(); ++i)
    note += " and '" + table.header[form.names[i]] + "'";
  note += " names the series, '" + table.header[form.value] + "' is the value; " +
          std::to_string(columns.size()) + " columns";
  for (const std::size_t column : others) note += ", '" + table.header[column] + "' left out";
  if (const auto count = std::count(bad.begin(), bad.end(), true); count > 0)
    note += "; bad quality, hence missing: " + std::to_string(count) + " values";
  const auto is_complete = [&](std::size_t row) {
    return std::none_of(columns.begin(), columns.end(),
                        [row](const auto& column) { return column[row].empty(); });
  };
  bool complete = false;
  for (std::size_t row = 0; row < times.size() && !complete; ++row) complete = is_complete(row);
  if (!complete)
    note +=
        "; no row has a value of each: if they are read one after the other, write scan_s = "
        "(seconds from the first to the last) in the file of --columns";
  table.header = std::move(wide.header);
  table.units = std::move(wide.units);
  table.lines = std::move(wide.lines);
  table.fields.clear();
  for (std::size_t row = 0; row < times.size(); ++row)
    for (const auto& column : columns) table.fields.push_back(column[row]);
  time_s = std::move(times);
  return note;
}

}  // namespace thermocomp
