#include <algorithm>
#include <array>
#include <map>

#include "config/run_forms/column_meanings.hpp"
#include "config/run_forms/field_text.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp::forms {
namespace {

struct Labelled {
  std::string time;
  std::vector<std::pair<std::string, std::string>> values;  ///< name and its number or word
  std::string words;  ///< in front of the first name, without levels such as INFO
};

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

/// The number or word at the start of `text`: "-0.5um", "20,5", "- 0.6"; of "25.00/0.00" the first.
std::string_view first_word(std::string_view text) {
  std::size_t end = std::min(text.find_first_not_of("+- "), text.size());
  if (end == text.size() || !is_digit(text[end])) end = 0;
  for (; end < text.size(); ++end) {
    const char next = end + 1 < text.size() ? text[end + 1] : ' ';
    if (std::string_view(" \t;)]}|").find(text[end]) != std::string_view::npos) break;
    if (text[end] == ',' && !is_digit(next)) break;
    if (text[end] == '/' && (is_digit(next) || next == ' ' || next == '-')) break;
  }
  return text.substr(0, end);
}

/// The unit after a number, unless it is the name of the next value: "20.5 A = 3".
std::string_view unit_after(std::string_view rest) {
  if (!rest.starts_with(' ')) return {};
  rest = trimmed(rest);
  const std::string_view unit = rest.substr(0, rest.find_first_of(" ,;)\t"));
  rest = trimmed(rest.substr(unit.size()));
  return rest.starts_with('=') || rest.starts_with(':') ? std::string_view() : unit;
}

/// The words of a text, without digits and without the levels of a log.
std::string words_of(std::string_view text) {
  constexpr std::string_view levels = "|info|warn|warning|error|debug|trace|notice|";
  std::string words;
  std::string word;
  for (const char c : std::string(text) + ' ') {
    const bool is_letter = static_cast<unsigned char>(c | 0x20) >= 'a';
    if (is_letter) word += c;
    if (is_letter || word.empty()) continue;
    if (!is_one_of(levels, word)) words.append(words.empty() ? "" : " ").append(word);
    word.clear();
  }
  return words;
}

/// Refuses lines of equal names with differing words that all recur: they may be of several
/// sensors.
class WordsBesideNames {
 public:
  void add(const Log& log, int line, const Labelled& found) {
    std::string names;
    for (const auto& [name, value] : found.values) names += name + ' ';
    auto& counts = counts_[names];
    ++counts[found.words];
    const auto repeated = [](const auto& each) { return each.second > 1; };
    const auto first = std::ranges::find_if(counts, repeated);
    const auto second =
        first == counts.end() ? first : std::find_if(std::next(first), counts.end(), repeated);
    if (second == counts.end()) return;
    log.refuse(line, names.substr(0, names.find(' ')), second->first,
               "may be of another sensor than the lines with '" + shortened(first->first) +
                   "': give each value a name of its own, such as " + plain_name(second->first) +
                   "=");
  }

 private:
  std::map<std::string, std::map<std::string, int>> counts_;  ///< by names, then by words
};

/// Parses "T:25.00 /0.00", "T1: 10.0 degC", "temp = 22,1".
Labelled labelled_of(std::string_view line) {
  Labelled found;
  found.time = take_time(line);
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] != ':' && line[i] != '=') continue;
    std::string_view name = trimmed(line.substr(0, i));
    if (name.ends_with('"')) name.remove_suffix(1);
    name.remove_prefix(name.find_last_of(" \t,;:=()[]{}|/\"") + 1);
    const std::string_view word = first_word(trimmed(line.substr(i + 1)));
    if (name.empty() || word.empty() || finite_number(name)) continue;
    if (found.values.empty())
      found.words = words_of(line.substr(0, static_cast<std::size_t>(name.data() - line.data())));
    if (names_series(name)) found.words += words_of(word);
    std::string value(word);
    const auto end = static_cast<std::size_t>(word.data() + word.size() - line.data());
    const std::string with_unit = value + " " + std::string(unit_after(line.substr(end)));
    if (number_text_of(with_unit).unit != nullptr) value = with_unit;
    found.values.emplace_back(name, std::move(value));
  }
  return found;
}

/// Parses "TIME|name|value|name|value", as MTConnect's adapters send.
Labelled piped_of(std::string_view line) {
  const std::vector<std::string> fields = fields_of(line, '|');
  Labelled found;
  if (fields.size() < 3 || fields.size() % 2 == 0 || !parse_time_stamp(fields[0])) return found;
  for (std::size_t i = 1; i < fields.size(); i += 2) {
    if (fields[i].empty() || looks_like_number(fields[i])) return {};
    found.values.emplace_back(fields[i], fields[i + 1]);
  }
  found.time = fields[0];
  return found;
}

/// Whether all of the first lines are such, and one has several values.
bool is_piped(std::string_view text) {
  bool has_several = false;
  for (int line = 0; line < 20 && !text.empty(); ++line) {
    const Labelled found = piped_of(take_line(text));
    if (found.time.empty()) return false;
    has_several = has_several || found.values.size() > 1;
  }
  return has_several;
}

bool is_labelled(std::string_view text) {
  constexpr int lines_judged = 20;
  int lines = 0;
  int labelled = 0;
  while (!text.empty() && lines < lines_judged) {
    const std::string_view line = take_line(text);
    if (trimmed(line).empty()) continue;
    ++lines;
    const Labelled found = labelled_of(line);
    const auto is_number = [](const auto& value) { return looks_like_number(value.second); };
    if (!found.time.empty() && std::ranges::any_of(found.values, is_number)) ++labelled;
  }
  return labelled > 0 && 2 * labelled >= lines;
}

}  // namespace

std::optional<PlainTable> labelled(const Log& log) {
  const auto parse = is_piped(log.text) ? piped_of : labelled_of;
  if (parse == labelled_of && !is_labelled(log.text)) return std::nullopt;
  std::map<std::string, bool> has_number;
  for (std::string_view rest = log.text; !rest.empty();)
    for (const auto& [name, value] : parse(take_line(rest)).values)
      has_number[name] |= looks_like_number(value);
  NamedColumns columns;
  const std::size_t time = columns.add("time");
  std::vector<int> lines;  // of each row
  std::string last;        // time, with its values
  std::map<std::string, std::string> values;
  std::size_t left_out = 0;
  WordsBesideNames words;
  std::string_view rest = log.text;
  for (int line = 1; !rest.empty(); ++line) {
    Labelled found = parse(take_line(rest));
    std::erase_if(found.values, [&](const auto& value) { return !has_number.at(value.first); });
    if (found.time.empty() || found.values.empty()) {
      ++left_out;
      continue;
    }
    words.add(log, line, found);
    // Lines of equal time form one row.
    if (lines.empty() || last != found.time) {
      lines.push_back(line);
      values.clear();
    }
    last = found.time;
    const std::size_t row = lines.size() - 1;
    columns.cell(row, time) = in_quotes(last);
    for (const auto& [name, value] : found.values) {
      const auto [earlier, is_new] = values.emplace(name, value);
      if (!is_new && earlier->second != value)
        log.refuse(line, name, value,
                   "must be there once at a time, under a name of one word; an earlier value of "
                   "that time is " +
                       shortened(earlier->second));
      columns.cell(row, columns.find_or_add(name)) = in_quotes(value);
    }
  }
  PlainTable table{columns.text(lines), {"lines of a time and named values"}, -1};
  if (left_out > 0)
    table.notes.push_back(std::to_string(left_out) + " lines without these left out");
  for (const auto& [name, is_number] : has_number)
    if (!is_number) table.notes.push_back("'" + name + "' left out: no value of it is a number");
  return table;
}

}  // namespace thermocomp::forms
