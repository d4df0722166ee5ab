#include "config/run_forms/log_form.hpp"

namespace thermocomp::forms {

bool is_kw_watcher(std::string_view text) {
  const std::vector<std::string> fields = fields_of(take_line(text));
  return fields.size() > 2 && fields[0] == "Date" && fields[1] == "Time" && fields[2] == "1";
}

PlainTable plain_kw_watcher(const Log& log) {
  // Numbers, names, stations, registers, kinds of value, data formats, units.
  std::string_view rest = log.text;
  std::vector<std::vector<std::string>> head(7);
  for (auto& line : head) line = fields_of(take_line(rest));
  const std::size_t columns = head[0].size();
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

}  // namespace thermocomp::forms
