#include "cli/import/log_form.hpp"

#include <algorithm>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/text/problems.hpp"

namespace thermocomp::cli {
namespace {

/// Taken off the front; without the end of the line.
std::string_view take_line(std::string_view& text) {
  std::string_view line;
  static_cast<void>(take(text, '\n', line));
  if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
  return line;
}

std::vector<std::string> fields_of(std::string_view line) {
  std::vector<std::string> fields;
  std::string field;
  bool quoted = false;
  for (const char c : line) {
    if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      fields.emplace_back(trimmed(field));
      field.clear();
    } else {
      field += c;
    }
  }
  fields.emplace_back(trimmed(field));
  return fields;
}

/// Whether nothing but numbers and blanks, in at least one row.
bool is_bare_numbers(std::string_view text) {
  constexpr int rows_judged = 20;
  int rows = 0;
  while (!text.empty() && rows < rows_judged) {
    std::string_view line = trimmed(take_line(text));
    if (line.empty() || line == "overrun") continue;
    while (!line.empty()) {
      const std::size_t end = std::min(line.find_first_of(" \t"), line.size());
      if (!finite_number(line.substr(0, end))) return false;
      line = trimmed(line.substr(end));
    }
    ++rows;
  }
  return rows > 0;
}

[[noreturn]] void refuse(const std::string& name, int line, const std::string& value,
                         std::string rule) {
  throw ConfigurationError({Problem{name, line, "", value, std::move(rule)}});
}

/// "PTemp [C]", quoted for commas inside. A logger's programmer writes his units as he likes.
std::string with_unit(const std::string& name, std::string unit) {
  for (const char* celsius : {"Deg C", "DegC", "Deg_C", "deg_C", "degc"})
    if (unit == celsius) unit = "degC";
  std::string header("\"");
  header.append(name);
  if (!unit.empty() && spelled_name(name).known == nullptr)
    header.append(" [").append(unit).append("]");
  return header.append("\"");
}

/// What a logger writes of a quotient without a value.
bool is_infinite(std::string_view field) {
  return field == "INF" || field == "+INF" || field == "-INF";
}

/// A table's rows with the fields of `left_out` taken away.
/// Infinite values are missing there; the table says how many.
void append_rows(std::string_view rest, int line, const std::string& name, std::size_t columns,
                 const std::vector<bool>& left_out, PlainTable& table) {
  std::size_t infinite = 0;
  while (!rest.empty()) {
    ++line;
    const std::string_view row = take_line(rest);
    if (trimmed(row).empty()) continue;
    const std::vector<std::string> fields = fields_of(row);
    if (fields.size() != columns)
      refuse(name, line, std::to_string(fields.size()) + " fields",
             "must have as many as the names above, " + std::to_string(columns));
    bool first = true;
    for (std::size_t i = 0; i < fields.size(); ++i) {
      if (left_out[i]) continue;
      if (!first) table.text += ',';
      if (is_infinite(fields[i]))
        ++infinite;
      else
        table.text += fields[i];
      first = false;
    }
    table.text += '\n';
  }
  if (infinite > 0) table.said.push_back("INF, taken as missing: " + std::to_string(infinite));
}

}  // namespace

LogForm log_form(std::string_view text) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  std::string_view rest = text;
  const std::string_view first = trimmed(take_line(rest));
  if (first.starts_with('{')) return LogForm::temperature_store;
  if (first.starts_with("\"TOA5\"")) return LogForm::toa5;
  const std::vector<std::string> fields = fields_of(first);
  if (fields.size() > 2 && fields[0] == "Date" && fields[1] == "Time" && fields[2] == "1")
    return LogForm::kw_watcher;
  return is_bare_numbers(text) ? LogForm::halsampler : LogForm::table;
}

PlainTable plain_toa5(std::string_view text, const std::string& name) {
  std::vector<std::vector<std::string>> head(4);
  for (auto& line : head) line = fields_of(take_line(text));
  const auto& names = head[1];
  if (head[2].size() != names.size() || head[3].size() != names.size())
    refuse(name, 3, std::to_string(head[2].size()) + " units",
           "must be as many as the names in line 2, " + std::to_string(names.size()));
  PlainTable table;
  std::vector<bool> left_out;
  for (std::size_t i = 0; i < names.size(); ++i) {
    left_out.push_back(names[i] == "RECORD");
    if (left_out.back()) continue;
    if (!table.text.empty()) table.text += ',';
    const bool is_time = names[i] == "TIMESTAMP";
    table.text += with_unit(names[i], is_time ? "" : head[2][i]);
  }
  table.text += '\n';
  append_rows(text, 4, name, names.size(), left_out, table);
  table.said.push_back("TOA5 of station '" + (head[0].size() > 1 ? head[0][1] : std::string()) +
                       "', table '" + head[0].back() + "': names in line 2, units in line 3");
  if (std::find(left_out.begin(), left_out.end(), true) != left_out.end())
    table.said.emplace_back("'RECORD' left out");
  return table;
}

PlainTable plain_kw_watcher(std::string_view text, const std::string& name) {
  // Numbers, names, stations, registers, kinds of value, data formats, units.
  std::vector<std::vector<std::string>> head(7);
  for (auto& line : head) line = fields_of(take_line(text));
  const std::size_t columns = head[0].size();
  for (std::size_t i = 1; i < head.size(); ++i)
    if (head[i].size() != columns)
      refuse(name, static_cast<int>(i) + 1, std::to_string(head[i].size()) + " fields",
             "must have as many as the first line, " + std::to_string(columns));
  PlainTable table;
  table.text = "\"Date\",\"Time\"";
  for (std::size_t i = 2; i < columns; ++i)
    table.text.append(",").append(with_unit(head[1][i], head[6][i]));
  table.text += '\n';
  append_rows(text, 7, name, columns, std::vector<bool>(columns, false), table);
  table.said.emplace_back("KW Watcher: names in line 2, units in line 7");
  return table;
}

}  // namespace thermocomp::cli
