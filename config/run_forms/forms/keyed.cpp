// Logs with a header of keys, each with values for all channels.
#include <algorithm>
#include <map>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp::forms {
namespace {

char separator_of(std::string_view text) {
  const auto at = text.find("SampleTime[ms]");
  const std::string_view behind = text.substr(std::min(at + 14, text.size()));
  return behind.empty() || behind.front() == '"' ? '\t' : behind.front();
}

/// The exported values may be those before or after the scale.
void check_scales(const Log& log, const std::vector<std::string>& fields, int line) {
  const double neutral = fields[0] == "Offset" ? 0.0 : 1.0;
  for (const std::string& field : fields) {
    if (&field == &fields[0] || field.empty() || field == fields[0]) continue;
    if (number_of(field, {','}) == neutral || finite_number(field) == neutral) continue;
    log.refuse(line, fields[0], field,
               "may be in the values or not: export with a factor of 1 and an offset of 0, or "
               "write the values that are meant and delete this line");
  }
}

/// Converts 100 ns since 1601 to ms since 1970.
double ms_of_ticks(double ticks) {
  return ticks * 1e-4 - 11644473600000.0;
}

}  // namespace

std::optional<PlainTable> kw_watcher(const Log& log) {
  // Numbers, names, stations, registers, kinds of value, data formats, units.
  std::string_view rest = log.text;
  std::vector<std::vector<std::string>> head(7);
  for (auto& line : head) line = fields_of(take_line(rest));
  const std::size_t columns = head[0].size();
  if (columns < 3 || head[0][0] != "Date" || head[0][1] != "Time" || head[0][2] != "1")
    return std::nullopt;
  for (std::size_t i = 1; i < head.size(); ++i)
    if (head[i].size() != columns)
      log.refuse(static_cast<int>(i) + 1, "", std::to_string(head[i].size()) + " fields",
                 "must have as many as the first line, " + std::to_string(columns));
  PlainTable table;
  table.text = "\"Date\",\"Time\"";
  for (std::size_t i = 2; i < columns; ++i)
    table.text.append(",").append(with_unit(head[1][i], head[6][i]));
  table.text.append("\n").append(rest);
  table.lines_above = 6;
  table.notes.emplace_back("KW Watcher: names in line 2, units in line 7");
  return table;
}

std::optional<PlainTable> lvm(const Log& log) {
  constexpr std::string_view end_of_header = "***End_of_Header***";
  if (!log.text.starts_with("LabVIEW Measurement")) return std::nullopt;
  std::map<std::string, std::vector<std::string>> keys;
  std::string_view rest = log.text;
  const bool by_commas = rest.substr(0, 2000).find("Separator,Comma") != std::string_view::npos;
  const char separator = by_commas ? ',' : '\t';
  int line = 0;
  bool is_behind = false;  // a header; the first one ends with an empty line, the others with names
  std::vector<std::string> names;
  while (!rest.empty() && names.empty()) {
    ++line;
    const std::vector<std::string> fields = fields_of(take_line(rest), separator);
    const bool is_end = !is_behind && fields[0].starts_with(end_of_header);
    if (is_behind && fields[0] == "X_Value") names = fields;
    if (!is_behind && !is_end && !fields[0].empty()) keys[fields[0]] = fields;
    is_behind = is_end;
  }
  if (rest.empty()) log.refuse(line, "X_Value", "(missing)", "must head the rows of an LVM file");
  PlainTable table;
  const bool has_comments = names.back() == "Comment";  // most rows omit it
  if (has_comments) names.pop_back();
  const auto key = [&](const char* name, std::size_t i) {
    const auto found = keys.find(name);
    return found == keys.end() || i >= found->second.size() ? std::string() : found->second[i];
  };
  const auto zero = wall_time(key("Date", 1) + " " + key("Time", 1));
  if (zero) table.text = wall_zero_comment({zero->seconds, false});
  for (std::size_t i = 0; i < names.size(); ++i) {
    if (i > 0) table.text += separator;
    table.text += with_unit(names[i], names[i] == "X_Value" ? "s" : key("Y_Unit_Label", i));
  }
  table.lines_above = line - 1 - (zero ? 1 : 0);
  // Without times in the rows the header has their distance.
  const char decimal = key("Decimal_Separator", 1) == "," ? ',' : '.';
  const auto step_s = key("X_Columns", 1) == "No"
                          ? number_of(key("Delta_X", 1), NumberForm{decimal, '\0'})
                          : std::nullopt;
  for (int count = 0; !rest.empty(); ++count) {
    const std::string_view row = take_line(rest);
    if (step_s && row.empty()) continue;
    std::size_t end = has_comments ? 0 : std::string_view::npos;
    for (std::size_t i = 0; i < names.size() && end != std::string_view::npos; ++i)
      end = row.find(separator, i == 0 ? 0 : end + 1);
    table.text += '\n';
    if (step_s) {
      std::string time = number_text(count * *step_s);
      std::ranges::replace(time, '.', decimal);
      table.text += time;
    }
    table.text.append(row.substr(0, end));
  }
  if (has_comments) table.notes.emplace_back("'Comment' left out");
  table.notes.emplace_back("LVM of LabVIEW: names in line " + std::to_string(line));
  return table;
}

std::optional<PlainTable> twincat(const Log& log) {
  if (log.text.substr(0, 20000).find("SampleTime[ms]") == std::string_view::npos)
    return std::nullopt;
  const char separator = separator_of(log.text);
  std::string_view rest = log.text;
  std::vector<std::string> names;
  std::vector<std::string> units;
  double zero_ms = 0.0;
  std::string_view rows;
  int line = 0;
  for (std::string_view before = rest; !rest.empty(); before = rest) {
    ++line;
    const std::vector<std::string> fields = fields_of(take_line(rest), separator);
    const std::string& key = fields[0];
    if (key.starts_with("Start") && fields.size() > 1 && zero_ms == 0.0)
      if (const auto ticks = finite_number(fields[1]); ticks && *ticks > 1.2e17 && *ticks < 1.5e17)
        zero_ms = ms_of_ticks(*ticks);
    if (key == "Name" && fields.size() >= names.size()) names = fields;
    if (key == "Unit") units = fields;
    if (key == "ScaleFactor" || key == "Offset") check_scales(log, fields, line);
    if (!looks_like_number(key) || fields.size() < 2) continue;
    rows = before;
    break;
  }
  if (rows.empty() || names.size() < 2)
    log.refuse(line, "Name", "(missing)", "must name the channels of TwinCAT's scope");
  // A column called Name is a time column, and applies to the channels after it.
  const bool many_times = std::ranges::count(names, "Name") > 1;
  units.resize(names.size());
  PlainTable table;
  table.text = many_times ? "time [ms];series;value" : "\"time [ms]\"";
  std::vector<std::string> labels;
  for (std::size_t i = 0; i < names.size(); ++i) {
    labels.push_back(with_unit(names[i], units[i].starts_with('(') ? "" : units[i]));
    if (i > 0 && !many_times) table.text.append(";").append(labels[i]);
  }
  const NumberForm form{separator != ',' && rows.find(',') != std::string_view::npos ? ',' : '.',
                        '\0'};
  if (many_times)
    table.numbers = {line - 1};
  else
    table.lines_above = line - 2;
  for (; !rows.empty(); ++line) {
    const std::vector<std::string> fields = fields_of(take_line(rows), separator);
    if (fields.size() < 2) continue;  // "EOF"
    std::string time;
    for (std::size_t i = 0; i < std::min(fields.size(), names.size()); ++i) {
      const std::string& field = fields[i];
      if (names[i] == "Name") {
        const auto at = number_of(field, form);
        time = at ? number_text(*at < 1e15 ? *at + zero_ms : ms_of_ticks(*at)) : "";
        std::ranges::replace(time, '.', form.decimal);
        if (!many_times) table.text.append("\n").append(time);
      } else if (!many_times) {
        table.text.append(";").append(field);
      } else if (!field.empty() && !time.empty()) {
        table.text.append("\n").append(time).append(";").append(labels[i]).append(";").append(
            field);
        table.numbers.push_back(line);
      }
    }
  }
  table.text += '\n';
  table.notes.emplace_back("scope of TwinCAT: the channels' names in the line \"Name\"");
  return table;
}

}  // namespace thermocomp::forms
