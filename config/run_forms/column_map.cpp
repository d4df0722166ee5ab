#include "config/run_forms/column_map.hpp"

#include <algorithm>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {
namespace {

void read_column(const TomlTable& table, const std::string& key, ColumnMap& map) {
  MappedColumn column;
  if (table.is_text(key)) {
    column.name = table.text(key);
  } else {
    const TomlTable entry = table.table(key);
    if (!entry) return;
    column.name = entry.text("name");
    column.unit = entry.text("unit", "");
    if (!column.unit.empty() && !unit_with_factor(column.unit))
      entry.problem("unit", "is not a known unit; docs/run_files.md lists them");
  }
  if (!is_column_name(column.name)) table.problem(key, column.name, column_name_rule);
  if (column.name == "time_s") table.problem(key, "belongs in the key time");
  map.columns.emplace(key, column);
}

}  // namespace

std::string unnamed(std::size_t column) {
  return "column " + std::to_string(column + 1);
}

bool is_unnamed(std::string_view header) {
  return header.starts_with("column ") &&
         header.find_first_not_of("0123456789", 7) == std::string_view::npos;
}

bool ColumnMap::ignores(std::string_view header) const {
  return std::ranges::any_of(ignored, [&](const std::string& name) {
    return name == header || (name.empty() && is_unnamed(header));
  });
}

const MappedColumn* ColumnMap::find(const std::string& header) const {
  const auto found = columns.find(header);
  return found == columns.end() ? nullptr : &found->second;
}

bool ColumnMap::uses(const std::string& header) const {
  return ignores(header) || find(header) != nullptr;
}

std::string write_column(std::string_view header, const std::string& value) {
  return "write " + toml_text(header) + " = " + value + " under [columns] in the file of --columns";
}

std::string ignore_column(std::string_view header) {
  return "ignore = [" + toml_text(header) + "]";
}

std::string pivot_or_ignore(std::string_view header) {
  return "write pivot = [" + toml_text(header) +
         ", \"the column of the values\"] in the file of --columns, or " + ignore_column(header) +
         " if all rows are of the same";
}

ColumnMap parse_column_map(const std::string& text, const std::string& name) {
  const TomlDocument document = TomlDocument::from_text(text, name);
  const TomlTable root = document.root();
  ColumnMap map;
  map.file = name;
  static_cast<void>(root.integer("format", 1, 1, 1));
  map.encoding = root.text("encoding", "");
  if (root.has("separator"))
    map.separator = root.choice<char>(
        "separator", {{",", ','}, {";", ';'}, {"|", '|'}, {"tab", '\t'}, {"blank", ' '}});
  if (root.has("decimal")) map.decimal = root.choice<char>("decimal", {{".", '.'}, {",", ','}});
  if (root.has("thousands"))
    map.thousands = root.choice<char>("thousands", {{".", '.'}, {",", ','}, {"'", '\''}});
  if (map.thousands && map.decimal == map.thousands)
    root.problem("thousands", "must differ from the decimal sign");
  map.header_line = root.integer("header_line", 1, 100000, 0);
  map.date_order = root.choice<DateOrder>("date_order",
                                          {{"day.month.year", DateOrder::day_month_year},
                                           {"month.day.year", DateOrder::month_day_year},
                                           {"year.month.day", DateOrder::year_month_day}},
                                          DateOrder::unknown);
  const auto one_or_more = [&](const char* key) {
    return root.is_text(key) ? std::vector{root.text(key)} : root.texts(key, {});
  };
  map.time = one_or_more("time");
  if (map.time.size() > 2) root.problem("time", "must be one column, or date and clock time");
  map.pivot = one_or_more("pivot");
  if (map.pivot.size() > 2)
    root.problem("pivot", "must be the column of the names, or it and the column of the values");
  map.names = root.texts("names", {});
  if (root.has("period_s")) map.period_s = root.number("period_s", Range::above(0));
  if (root.has("scan_s")) map.scan_s = root.number("scan_s", Range::above(0));
  map.missing = root.texts("missing", {});
  const Names<std::string> units{
      {"ns", "ns"}, {"us", "us"},   {"ms", "ms"},       {"s", "s"},         {"min", "min"},
      {"h", "h"},   {"day", "day"}, {"hh:mm", "hh:mm"}, {"mm:ss", "mm:ss"}, {"hhmmss", "hhmmss"}};
  map.time_unit = root.choice<std::string>("time_unit", units, "");
  map.ignored = root.texts("ignore", {}, true);  // "": without a name
  const TomlTable columns = root.table_or_empty("columns");
  if (columns) {
    for (const std::string& key : columns.keys()) read_column(columns, key, map);
  }
  document.finish();
  return map;
}

ColumnMap load_column_map(const std::filesystem::path& path) {
  return parse_column_map(read_text_file(path), path.string());
}

}  // namespace thermocomp
