#include <map>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/time_stamp.hpp"

namespace thermocomp::forms {
namespace {

constexpr std::string_view end_of_header = "***End_of_Header***";

}  // namespace

bool is_lvm(std::string_view text) {
  return text.starts_with("LabVIEW Measurement");
}

PlainTable plain_lvm(const Log& log) {
  std::map<std::string, std::vector<std::string>> keys;
  std::string_view rest = log.text;
  const bool by_commas = rest.substr(0, 2000).find("Separator,Comma") != std::string_view::npos;
  const char separator = by_commas ? ',' : '\t';
  int line = 0;
  int names_line = 0;
  std::vector<std::string> names;
  std::string_view rows;
  while (!rest.empty()) {
    ++line;
    std::vector<std::string> fields = fields_of(take_line(rest), separator);
    if (names_line == line) {
      names = std::move(fields);
      rows = rest;
    } else if (fields[0].starts_with(end_of_header)) {
      names_line = line + 1;
    } else if (!fields[0].empty() && rows.empty()) {
      const std::string key = fields[0];
      keys[key] = std::move(fields);
    }
    // The first header ends with an empty line, that of a segment with the names.
    if (names_line == line && (names.empty() || names[0] != "X_Value")) rows = {};
    if (!rows.empty()) break;
  }
  if (rows.empty()) log.refuse(line, "X_Value", "(missing)", "must head the rows of an LVM file");
  PlainTable table;
  const bool has_comments = names.back() == "Comment";  // most rows omit it
  if (has_comments) names.pop_back();
  const auto key = [&](const char* name, std::size_t i) {
    const auto found = keys.find(name);
    return found == keys.end() || i >= found->second.size() ? std::string() : found->second[i];
  };
  const auto stamp = parse_time_stamp(key("Date", 1) + " " + key("Time", 1));
  const auto zero_s = stamp ? seconds_of(*stamp, DateOrder::unknown, false) : std::nullopt;
  if (zero_s) table.text = wall_zero_comment({*zero_s, false});
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) table.text += separator;
    table.text += with_unit(names[i], i == 0 ? "s" : key("Y_Unit_Label", i));
  }
  table.lines_above = names_line - 1 - (zero_s ? 1 : 0);
  while (!rows.empty()) {
    const std::string_view row = take_line(rows);
    std::size_t end = has_comments ? 0 : std::string_view::npos;
    for (std::size_t i = 0; i < names.size() && end != std::string_view::npos; ++i)
      end = row.find(separator, i == 0 ? 0 : end + 1);
    table.text.append("\n").append(row.substr(0, end));
  }
  if (has_comments) table.notes.emplace_back("'Comment' left out");
  table.notes.emplace_back("LVM of LabVIEW: names in line " + std::to_string(names_line));
  return table;
}

}  // namespace thermocomp::forms
