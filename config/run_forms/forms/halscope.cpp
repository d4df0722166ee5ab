#include <vector>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/text/number_text.hpp"

namespace thermocomp::forms {
namespace {

constexpr std::string_view mark = "Sampling period is ";

}  // namespace

bool is_halscope(std::string_view text) {
  return trimmed(text).starts_with(mark);
}

PlainTable plain_halscope(const Log& log) {
  std::string_view rest = trimmed(log.text);
  const std::string_view first = trimmed(take_line(rest)).substr(mark.size());
  const auto period_ns = finite_number(first.substr(0, first.find(' ')));
  if (!period_ns || !(*period_ns > 0))
    log.refuse(1, "", std::string(first), "must be the sampling period in ns");
  std::vector<std::string> labels;
  std::vector<std::vector<std::string_view>> values;
  for (int line = 2; !rest.empty(); ++line) {
    std::string_view words = trimmed(take_line(rest));
    while (!words.empty()) {
      const auto blank = words.find(' ');
      const std::string label(words.substr(0, blank));
      words = blank == std::string_view::npos ? std::string_view() : trimmed(words.substr(blank));
      const std::string_view value = words.substr(0, words.find(' '));
      if (!finite_number(value))
        log.refuse(line, label, std::string(value), "must be a label and its value, in turn");
      words = trimmed(words.substr(value.size()));
      std::size_t i = 0;
      while (i < labels.size() && labels[i] != label) ++i;
      if (i == labels.size()) {
        labels.push_back(label);
        values.emplace_back();
      }
      values[i].push_back(value);
    }
  }
  if (labels.empty()) log.refuse(0, "", "", "has no row of data");
  PlainTable table;
  table.text = "time_s";
  for (const std::string& label : labels) table.text.append(",").append(in_quotes(label));
  for (std::size_t row = 0; row < values[0].size(); ++row) {
    table.text += '\n';
    append_number(table.text, static_cast<double>(row) * *period_ns * 1e-9);
    for (const auto& column : values)
      table.text.append(",").append(row < column.size() ? column[row] : "");
  }
  table.text += '\n';
  table.said.push_back("halscope of LinuxCNC, a sample each " + number_text(*period_ns * 1e-9) +
                       " s");
  return table;
}

}  // namespace thermocomp::forms
