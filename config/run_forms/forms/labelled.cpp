#include <cctype>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/number_form.hpp"
#include "config/run_forms/time_stamp.hpp"

namespace thermocomp::forms {
namespace {

struct Labelled {
  std::string time;
  std::vector<std::pair<std::string, std::string>> values;  ///< name and number, maybe with unit
};

bool is_name(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '@' || c == '.';
}

/// Takes the leading time off a line: in brackets, or the longest prefix that is a time.
std::string take_time(std::string_view& line) {
  line = trimmed(line);
  const bool bracketed = !line.empty() && (line.front() == '(' || line.front() == '[');
  if (bracketed) {
    const auto end = line.find(line.front() == '(' ? ')' : ']');
    if (end == std::string_view::npos) return {};
    const std::string_view time = line.substr(1, end - 1);
    if (!parse_time_stamp(time) && !finite_number(time)) return {};
    line.remove_prefix(end + 1);
    return std::string(time);
  }
  std::string found;
  std::size_t taken = 0;
  for (std::size_t words = 0, end = 0; words < 3 && end < line.size(); ++words) {
    end = std::min(line.find(' ', end + 1), line.size());
    const std::string_view time = line.substr(0, end);
    if (parse_time_stamp(time) || (words == 0 && finite_number(time))) {
      found = time;
      taken = end;
    }
  }
  line.remove_prefix(taken);
  return found;
}

/// Parses "T:25.00 /0.00", "T1: 10.0 degC", "temp=22.1".
Labelled labelled_of(std::string_view line) {
  Labelled found;
  found.time = take_time(line);
  for (std::size_t i = 0; i < line.size(); ++i) {
    if ((line[i] != ':' && line[i] != '=') || i == 0 || !is_name(line[i - 1])) continue;
    std::size_t begin = i;
    while (begin > 0 && is_name(line[begin - 1])) --begin;
    const std::string name(line.substr(begin, i - begin));
    std::string_view rest = trimmed(line.substr(i + 1));
    const std::string_view word = rest.substr(0, rest.find_first_of(" ,;)/\t"));
    if (!finite_number(word) || finite_number(name)) continue;
    rest = rest.substr(word.size());
    const bool has_unit = rest.starts_with(' ');
    const std::string_view unit =
        has_unit ? trimmed(rest).substr(0, trimmed(rest).find_first_of(" ,;)\t")) : "";
    const std::string both = std::string(word) + " " + std::string(unit);
    found.values.emplace_back(name,
                              number_text_of(both).unit != nullptr ? both : std::string(word));
  }
  return found;
}

}  // namespace

bool is_labelled(std::string_view text) {
  constexpr int lines_judged = 20;
  int lines = 0;
  int labelled = 0;
  while (!text.empty() && lines < lines_judged) {
    const std::string_view line = take_line(text);
    if (trimmed(line).empty()) continue;
    ++lines;
    const Labelled found = labelled_of(line);
    if (!found.time.empty() && !found.values.empty()) ++labelled;
  }
  return labelled > 0 && 2 * labelled >= lines;
}

PlainTable plain_labelled(const Log& log) {
  std::vector<std::string> names;
  std::vector<std::pair<std::string, std::vector<std::string>>> rows;
  std::string_view rest = log.text;
  std::size_t left_out = 0;
  while (!rest.empty()) {
    const Labelled found = labelled_of(take_line(rest));
    if (found.time.empty() || found.values.empty()) {
      ++left_out;
      continue;
    }
    // Lines of equal time form one row.
    if (rows.empty() || rows.back().first != found.time)
      rows.emplace_back(found.time, std::vector<std::string>(names.size()));
    std::vector<std::string>& row = rows.back().second;
    for (const auto& [name, value] : found.values) {
      std::size_t i = 0;
      while (i < names.size() && names[i] != name) ++i;
      if (i == names.size()) names.push_back(name);
      row.resize(names.size());
      row[i] = value;
    }
  }
  PlainTable table;
  table.text = "time";
  for (const std::string& name : names) table.text.append(",").append(in_quotes(name));
  for (auto& [time, row] : rows) {
    row.resize(names.size());
    table.text.append("\n").append(in_quotes(time));
    for (const std::string& value : row) table.text.append(",").append(in_quotes(value));
  }
  table.text += '\n';
  table.notes.emplace_back("lines of a time and named values");
  if (left_out > 0)
    table.notes.push_back(std::to_string(left_out) + " lines without these left out");
  return table;
}

}  // namespace thermocomp::forms
