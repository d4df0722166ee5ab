#include <algorithm>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/number_form.hpp"
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
std::string start_ms(const std::string& filetime) {
  const auto ticks = finite_number(filetime);
  if (!ticks || !(*ticks > 1.2e17 && *ticks < 1.5e17)) return {};
  return number_text(*ticks * 1e-4 - 11644473600000.0);
}

}  // namespace

bool is_twincat(std::string_view text) {
  return text.substr(0, 20000).find("SampleTime[ms]") != std::string_view::npos;
}

PlainTable plain_twincat(const Log& log) {
  const char separator = separator_of(log.text);
  std::string_view rest = log.text;
  std::vector<std::string> names;
  std::vector<std::string> units;
  std::string start;
  std::string_view rows;
  int line = 0;
  for (std::string_view before = rest; !rest.empty(); before = rest) {
    ++line;
    const std::vector<std::string> fields = fields_of(take_line(rest), separator);
    std::string key = fields[0];
    if (key.starts_with("Start") && fields.size() > 1 && start.empty()) start = start_ms(fields[1]);
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
  std::vector<std::string> series;
  PlainTable table;
  const bool many_times = std::count(names.begin(), names.end(), "Name") > 1;
  units.resize(names.size());
  if (!many_times) {
    table.text = "\"time [ms]\"";
    for (std::size_t i = 1; i < names.size(); ++i)
      table.text.append(";").append(with_unit(names[i], units[i].starts_with('(') ? "" : units[i]));
  } else {
    table.text = "time [ms];series;value";
  }
  const double zero_ms = finite_number(start).value_or(0.0);
  const NumberForm form{separator != ',' && rows.find(',') != std::string_view::npos ? ',' : '.',
                        '\0'};
  table.lines_above = line - 2;
  while (!rows.empty()) {
    const std::vector<std::string> fields = fields_of(take_line(rows), separator);
    if (fields.size() < 2) continue;  // "EOF"
    std::string time;
    for (std::size_t i = 0; i < std::min(fields.size(), names.size()); ++i) {
      const std::string& field = fields[i];
      if (names[i] == "Name") {
        const auto at = number_of(field, form);
        time = at ? number_text(*at < 1e15 ? *at + zero_ms : *at * 1e-4 - 11644473600000.0) : "";
        std::replace(time.begin(), time.end(), '.', form.decimal);
        if (!many_times) table.text.append("\n").append(time);
      } else if (!many_times) {
        table.text.append(";").append(field);
      } else if (!field.empty() && !time.empty()) {
        table.text.append("\n").append(time).append(";");
        table.text.append(with_unit(names[i], units[i].starts_with('(') ? "" : units[i]));
        table.text.append(";").append(field);
      }
    }
  }
  table.text += '\n';
  table.notes.emplace_back("scope of TwinCAT: the channels' names in the line \"Name\"");
  return table;
}

}  // namespace thermocomp::forms
