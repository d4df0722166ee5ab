#include "config/run_forms/text_lines.hpp"

#include <algorithm>

#include "config/run_forms/field_text.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

/// Before a digit: replaces a typeset minus by '-', removes a blank that groups digits.
std::string with_plain_letters(std::string_view all) {
  constexpr std::string_view minus = "\u2212";
  std::string text;
  text.reserve(all.size() + 64);
  while (!all.empty()) {
    const auto is_next = [&](std::string_view letter) {
      return all.starts_with(letter) && letter.size() < all.size() && is_digit(all[letter.size()]);
    };
    const bool groups = !text.empty() && is_digit(text.back());
    std::size_t used = 0;
    for (const std::string_view blank : {"\u00a0", "\u202f", "\u2009"})
      if (groups && is_next(blank)) used = blank.size();
    if (is_next(minus)) {
      text += '-';
      used = minus.size();
    } else if (used == 0) {
      text += all.front();
      used = 1;
    }
    all.remove_prefix(used);
  }
  return text;
}

/// Normalises "+    20.0" (aligned by loggers) to "    +20.0", typeset minus and digit groups.
void spell_numbers_plainly(std::string& all) {
  if (all.find_first_of("\xC2\xE2") != std::string::npos) all = with_plain_letters(all);
  for (auto at = all.find_first_of("+-"); at != std::string::npos;
       at = all.find_first_of("+-", at + 1)) {
    const bool begins =
        at == 0 || std::string_view(";\t,|\"\n").find(all[at - 1]) != std::string_view::npos;
    const auto digit = all.find_first_not_of(' ', at + 1);
    if (!begins || digit == std::string::npos || digit == at + 1 || !is_digit(all[digit])) continue;
    std::swap(all[at], all[digit - 1]);
    at = digit;
  }
}

/// "---------+-------" and "+-----+", as drawn by database consoles.
bool is_rule(std::string_view line) {
  return line.starts_with("+--") ||
         (line.starts_with("---") && line.find_first_not_of("-+") == std::string_view::npos);
}

/// Lines that programs write after the last row.
bool is_end(std::string_view line) {
  return line == "EOF" ||
         (line.starts_with('(') && (line.ends_with(" rows)") || line.ends_with(" row)")));
}

/// A quoted name may span several lines, as in a spreadsheet's header.
std::string_view with_quoted_ends(std::string& text, std::string_view line, std::string_view& rest,
                                  int& number) {
  constexpr int lines_max = 8;
  const auto is_open = [](std::string_view part) {
    return std::count(part.begin(), part.end(), '"') % 2 == 1;
  };
  std::string_view longer = line;
  std::string_view behind = rest;
  for (int more = 1; more <= lines_max && is_open(longer) && !behind.empty(); ++more) {
    std::string_view next;
    static_cast<void>(take(behind, '\n', next));
    longer = {line.data(), static_cast<std::size_t>(next.data() + next.size() - line.data())};
    if (is_open(longer)) continue;
    const auto begin = static_cast<std::size_t>(line.data() - text.data());
    for (std::size_t i = begin; i < begin + longer.size(); ++i)
      if (text[i] == '\n' || text[i] == '\r') text[i] = ' ';
    rest = behind;
    number += more;
    return longer;
  }
  return line;
}

}  // namespace

TextLines find_lines(std::string& text, int lines_above, int first_line) {
  spell_numbers_plainly(text);
  TextLines found;
  std::vector<TextLine>& lines = found.lines;
  std::string_view rest = text;
  std::string_view line;
  for (int number = 1 + lines_above; !rest.empty(); ++number) {
    static_cast<void>(take(rest, '\n', line));
    line = with_quoted_ends(text, line, rest, number);
    if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
    if (number < first_line) continue;
    const bool is_comment = line.starts_with('#');
    if (is_comment && lines.empty()) found.last_comment = {number, line};
    if (is_comment || line.find_first_not_of(" \t;,|") == std::string_view::npos) continue;
    if (is_rule(line)) continue;
    // Excel's first line defines the separator.
    if (lines.empty() && line.size() == 5 && line.starts_with("sep=")) {
      found.separator = line[4];
      continue;
    }
    lines.push_back({number, line});
  }
  if (lines.size() > 2 && is_end(lines.back().text)) lines.pop_back();
  return found;
}

bool split_line(std::string_view line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  if (separator == ' ') {
    for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
      const auto end = std::min(line.find_first_of(" \t"), line.size());
      fields.push_back(line.substr(0, end));
      line.remove_prefix(end);
    }
    return true;
  }
  for (bool more = true; more;) {
    std::string_view start = line;
    while (!start.empty() && start.front() == ' ') start.remove_prefix(1);
    auto end = start.starts_with('"') ? start.find('"', 1) : 0;
    while (end > 0 && end != std::string_view::npos && start.substr(end).starts_with("\"\""))
      end = start.find('"', end + 2);
    if (end == std::string_view::npos) {
      fields.push_back(start);
      return false;
    }
    std::string_view behind = start.substr(std::min(end + 1, start.size()));
    while (!behind.empty() && behind.front() == ' ') behind.remove_prefix(1);
    if (end == 0 || (!behind.empty() && behind.front() != separator)) {
      std::string_view field;
      more = line.find(separator) != std::string_view::npos;
      static_cast<void>(take(line, separator, field));
      fields.push_back(trimmed(field));
      continue;
    }
    fields.push_back(trimmed(start.substr(1, end - 1)));
    line = behind;
    more = !line.empty();
    if (more) line.remove_prefix(1);
  }
  return true;
}

std::string unquoted(std::string_view field) {
  std::string text(field);
  for (auto at = text.find("\"\""); at != std::string::npos; at = text.find("\"\"", at + 1))
    text.erase(at, 1);
  return text;
}

}  // namespace thermocomp
