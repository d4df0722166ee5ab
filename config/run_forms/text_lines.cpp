#include "config/run_forms/text_lines.hpp"

#include <algorithm>
#include <cstdint>
#include <iconv.h>
#include <utility>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/run_data.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"

namespace thermocomp {
namespace {

bool is_utf8(std::string_view text) {
  int more = 0;  // bytes that continue a letter
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool is_next = byte >= 0x80 && byte < 0xc0;
    if (is_next != (more > 0) || byte == 0xc0 || byte == 0xc1 || byte >= 0xf8) return false;
    more = is_next ? more - 1 : byte >= 0xf0 ? 3 : byte >= 0xe0 ? 2 : byte >= 0xc0 ? 1 : 0;
  }
  return more == 0;
}

void append_letter(std::string& text, std::uint32_t letter) {
  const auto byte = [&](std::uint32_t value) { text += static_cast<char>(value); };
  if (letter < 0x80) {
    byte(letter);
  } else if (letter < 0x800) {
    byte(0xc0 | (letter >> 6));
    byte(0x80 | (letter & 0x3f));
  } else {
    byte(0xe0 | (letter >> 12));
    byte(0x80 | ((letter >> 6) & 0x3f));
    byte(0x80 | (letter & 0x3f));
  }
}

/// Code points above 0xFFFF, which logs do not contain, become '?'.
std::string utf8_of_utf16(std::string_view bytes, bool low_first) {
  std::string text;
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    const auto a = static_cast<unsigned char>(bytes[i + (low_first ? 1 : 0)]);
    const auto b = static_cast<unsigned char>(bytes[i + (low_first ? 0 : 1)]);
    const std::uint32_t letter = (std::uint32_t{a} << 8) | b;
    append_letter(text, letter >= 0xd800 && letter < 0xe000 ? std::uint32_t{'?'} : letter);
  }
  return text;
}

/// Old Macintosh lines end with a carriage return only.
std::string with_line_ends(std::string text) {
  if (text.find('\n') == std::string::npos) std::ranges::replace(text, '\r', '\n');
  return text;
}

struct Binary {
  std::string_view begin;
  const char* rule;
};
constexpr Binary binaries[] = {
    {"PK\x03\x04", "is an Excel workbook or another archive: save its sheet as CSV"},
    {"\xD0\xCF\x11\xE0", "is an Excel workbook of the old form (.xls): save its sheet as CSV"},
    {"\x1F\x8B", "is packed: unpack it with gunzip"},
    {"SQLite format 3", "is a database; a history becomes a run file by thermocomp export"},
    {"TDSm", "is LabVIEW's TDMS: save it as LVM or CSV"},
    {"\x89HDF", "is HDF5 (MATLAB's .mat too): save its table as CSV"},
    {"MATLAB 5.0", "is a MAT file: save its table as CSV (writetable)"},
    {"MDF ", "is ASAM's MDF: export its channels as CSV"},
    {"PAR1", "is Parquet: save its table as CSV"},
    {"%PDF", "is a PDF: the table itself is needed, as CSV"}};

/// Whether every second byte of the beginning is zero, as in UTF-16 of European text.
bool has_zeros_at(std::string_view bytes, std::size_t first) {
  const std::size_t size = std::min<std::size_t>(bytes.size(), 200);
  std::size_t zeros = 0;
  for (std::size_t i = 1 - first; i < size; i += 2)
    if (bytes[i] == '\0') return false;
  for (std::size_t i = first; i < size; i += 2) zeros += bytes[i] == '\0' ? 1U : 0U;
  return size >= 8 && 10 * zeros > 4 * size;
}

/// Whether the bytes that are not ASCII are those of Asian encodings: control characters in
/// Latin-1, or mostly side by side.
bool has_wide_letters(std::string_view bytes) {
  constexpr std::string_view windows_signs = "\x80\x85\x91\x92\x93\x94\x96\x97\x99";
  const auto is_high = [](char c) { return static_cast<unsigned char>(c) >= 0x80; };
  std::size_t high = 0;
  std::size_t beside = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (!is_high(bytes[i])) continue;
    ++high;
    if (static_cast<unsigned char>(bytes[i]) < 0xa0 &&
        windows_signs.find(bytes[i]) == std::string_view::npos)
      return true;
    if ((i > 0 && is_high(bytes[i - 1])) || (i + 1 < bytes.size() && is_high(bytes[i + 1])))
      ++beside;
  }
  return high >= 4 && 2 * beside > high;
}

/// @return nullopt: an unknown encoding, or bytes that are not of it
std::optional<std::string> converted(std::string bytes, const std::string& encoding) {
  const iconv_t converter = ::iconv_open("UTF-8", encoding.c_str());
  // NOLINTNEXTLINE(performance-no-int-to-ptr, cppcoreguidelines-pro-type-cstyle-cast)
  if (converter == reinterpret_cast<iconv_t>(-1)) return std::nullopt;
  std::string text(4 * bytes.size(), '\0');
  char* from = bytes.data();
  char* to = text.data();
  std::size_t left = bytes.size();
  std::size_t space = text.size();
  const bool is_done =
      ::iconv(converter, &from, &left, &to, &space) != static_cast<std::size_t>(-1);
  ::iconv_close(converter);
  text.resize(text.size() - space);
  return is_done ? std::optional(std::move(text)) : std::nullopt;
}

/// Zeros that a logger left when it lost power end a line; a single one is left out.
std::string without_zeros(std::string_view bytes) {
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (bytes[i] != '\0')
      text += bytes[i];
    else if (i > 0 && bytes[i - 1] == '\0' && !text.ends_with('\n'))
      text += '\n';
  }
  return text;
}

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
  const auto is_open = [](std::string_view part) { return std::ranges::count(part, '"') % 2 == 1; };
  std::string_view longer = line;
  std::string_view behind = rest;
  for (int more = 1; more <= lines_max && is_open(longer) && !behind.empty(); ++more) {
    const std::string_view next = take_line(behind);
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

bool is_workbook(std::string_view bytes) {
  return bytes.starts_with(binaries[0].begin);
}

RunText run_text(std::string_view bytes, const std::string& name, const std::string& encoding) {
  const auto refuse = [&](const char* key, const std::string& value, const char* rule) {
    throw ConfigurationError({Problem{name, 0, key, value, rule}});
  };
  for (const Binary& binary : binaries)
    if (bytes.starts_with(binary.begin)) refuse("", "(binary)", binary.rule);
  if (bytes.starts_with("\xFF\xFE") || bytes.starts_with("\xFE\xFF"))
    return {utf8_of_utf16(bytes.substr(2), bytes.front() == '\xFF'), false};
  if (bytes.starts_with(byte_order_mark)) bytes.remove_prefix(byte_order_mark.size());
  if (!encoding.empty()) {
    auto text = converted(std::string(bytes), encoding);
    if (!text)
      refuse("encoding", encoding,
             "must be the encoding of all letters of the file, by a name of iconv --list");
    return {with_line_ends(*std::move(text)), false};
  }
  for (const bool low_first : {true, false})
    if (has_zeros_at(bytes, low_first ? 1 : 0)) return {utf8_of_utf16(bytes, low_first), false};
  while (!bytes.empty() && bytes.back() == '\0') bytes.remove_suffix(1);
  const auto is_control = [](char c) { return c > 0 && c < '\t'; };
  if (std::ranges::any_of(bytes.substr(0, 4096), is_control))
    refuse("", "(binary)", "is neither text nor a known form; docs/run_files.md lists them");
  std::string without;
  if (bytes.find('\0') != std::string_view::npos) bytes = without = without_zeros(bytes);
  if (is_utf8(bytes)) return {with_line_ends(std::string(bytes)), false};
  if (has_wide_letters(bytes))
    refuse("encoding", "(unknown)",
           "must be known, since the letters are neither UTF-8 nor Latin-1: write encoding = "
           "\"shift_jis\" (Japanese), \"gb18030\" (Chinese), \"euc-kr\" (Korean), \"cp1251\" "
           "(Cyrillic) or what it is in the file of --columns");
  RunText latin1{{}, true};
  latin1.text.reserve(bytes.size() + bytes.size() / 8);
  for (const char c : bytes) append_letter(latin1.text, static_cast<unsigned char>(c));
  return latin1;
}

TextLines find_lines(std::string& text, int lines_above, int first_line) {
  spell_numbers_plainly(text);
  TextLines found;
  std::vector<TextLine>& lines = found.lines;
  std::string_view rest = text;
  for (int number = 1 + lines_above; !rest.empty(); ++number) {
    const std::string_view line = with_quoted_ends(text, take_line(rest), rest, number);
    if (number < first_line) continue;
    const bool is_comment =
        line.starts_with('#') || line.starts_with("% ") || line.starts_with("//");
    if (is_comment && line.ends_with(reference_mark)) found.references.push_back(number);
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
  // A spreadsheet quotes whole lines whose separator it does not know.
  const auto is_quoted = [](const TextLine& line) {
    return line.text.size() > 2 && line.text.starts_with('"') && line.text.ends_with('"') &&
           std::ranges::count(line.text, '"') == 2;
  };
  if (2 * std::ranges::count_if(lines, is_quoted) > std::ssize(lines))
    for (TextLine& line : lines)
      if (is_quoted(line)) line.text = line.text.substr(1, line.text.size() - 2);
  if (lines.size() > 2 && is_end(lines.back().text)) lines.pop_back();
  return found;
}

std::vector<std::string_view> words_of(std::string_view line) {
  std::vector<std::string_view> words;
  for (line = trimmed(line); !line.empty(); line = trimmed(line)) {
    words.push_back(line.substr(0, line.find_first_of(" \t")));
    line.remove_prefix(words.back().size());
  }
  return words;
}

bool split_line(std::string_view line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  if (separator == ' ') {
    fields = words_of(line);
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
