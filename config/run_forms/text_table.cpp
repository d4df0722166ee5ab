#include "config/run_forms/text_table.hpp"

#include <algorithm>

#include "config/run_forms/time_stamp.hpp"

namespace thermocomp {
namespace {

constexpr std::string_view separators = ";\t,";
constexpr std::size_t rows_judged = 100;
constexpr std::size_t columns_max = 1024;  // as of our own form

bool is_utf8(std::string_view text) {
  for (std::size_t i = 0; i < text.size();) {
    const auto lead = static_cast<unsigned char>(text[i]);
    std::size_t more = 0;
    if (lead >= 0xf0)
      more = lead < 0xf8 ? 3 : 4;
    else if (lead >= 0xe0)
      more = 2;
    else if (lead >= 0xc2)
      more = 1;
    else if (lead >= 0x80)
      return false;
    if (more > 3 || i + more >= text.size() + (more == 0 ? 1 : 0)) return false;
    for (std::size_t k = 1; k <= more; ++k)
      if ((static_cast<unsigned char>(text[i + k]) & 0xc0) != 0x80) return false;
    i += more + 1;
  }
  return true;
}

std::string utf8_of_latin1(std::string_view text) {
  std::string converted;
  converted.reserve(text.size() + text.size() / 8);
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x80) {
      converted += c;
    } else {
      converted += static_cast<char>(0xc0 | (byte >> 6));
      converted += static_cast<char>(0x80 | (byte & 0x3f));
    }
  }
  return converted;
}

/// Fields of a line; a quoted one may hold the separator.
/// @return false when a quote is not closed, or something stands behind it
bool split(std::string_view line, char separator, std::vector<std::string_view>& fields) {
  fields.clear();
  for (bool more = true; more;) {
    std::string_view start = line;
    while (!start.empty() && start.front() == ' ') start.remove_prefix(1);
    if (start.empty() || start.front() != '"') {
      std::string_view field;
      more = line.find(separator) != std::string_view::npos;
      static_cast<void>(take(line, separator, field));
      fields.push_back(trimmed(field));
      continue;
    }
    const auto end = start.find('"', 1);
    if (end == std::string_view::npos) return false;
    fields.push_back(trimmed(start.substr(1, end - 1)));
    line = start.substr(end + 1);
    while (!line.empty() && line.front() == ' ' && separator != ' ') line.remove_prefix(1);
    if (!line.empty() && line.front() != separator) return false;
    more = !line.empty();
    if (more) line.remove_prefix(1);
  }
  return true;
}

class TableReader {
 public:
  TableReader(const ColumnMap* map, ProblemList& problems) : map_(map), problems_(problems) {}

  TextTable read(std::string_view text) {
    table_.from_latin1 = !is_utf8(text);
    table_.text = table_.from_latin1 ? utf8_of_latin1(text) : std::string(text);
    find_lines();
    if (lines_.empty()) {
      problems_.add(0, "", "", "has no header row");
      return std::move(table_);
    }
    if (choose_separator() && read_header()) read_rows();
    return std::move(table_);
  }

 private:
  struct Line {
    int number;
    std::string_view text;
  };

  /// The header's line and those behind it. Excel's first line `sep=;` is taken at its word.
  void find_lines() {
    std::string_view rest = table_.text;
    std::string_view line;
    for (int number = 1; !rest.empty(); ++number) {
      static_cast<void>(take(rest, '\n', line));
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      if (map_ != nullptr && number < map_->header_line) continue;
      if (line.starts_with('#')) continue;
      if (lines_.empty() && line.size() == 5 && line.starts_with("sep=") &&
          separators.find(line[4]) != std::string_view::npos) {
        told_separator_ = line[4];
        continue;
      }
      if (trimmed(line).empty() && (lines_.empty() || trimmed(rest).empty())) continue;
      lines_.push_back({number, line});
    }
    const auto blank = [](const Line& each) {
      return each.text.find_first_not_of(" \t;,") == std::string_view::npos;
    };
    while (lines_.size() > 1 && blank(lines_.back())) lines_.pop_back();
  }

  bool choose_separator() {
    if (map_ != nullptr && map_->separator) told_separator_ = map_->separator;
    if (told_separator_) {
      table_.separator = *told_separator_;
      return true;
    }
    std::vector<char> in_header;
    std::vector<char> in_all;
    std::vector<std::string_view> fields;
    for (const char separator : separators) {
      static_cast<void>(split(lines_[0].text, separator, fields));
      const std::size_t count = fields.size();
      if (count < 2) continue;
      in_header.push_back(separator);
      const auto end =
          lines_.begin() + static_cast<std::ptrdiff_t>(std::min(lines_.size(), rows_judged + 1));
      if (std::all_of(lines_.begin() + 1, end, [&](const Line& line) {
            return split(line.text, separator, fields) && fields.size() == count;
          }))
        in_all.push_back(separator);
    }
    const std::vector<char>& possible = in_all.empty() ? in_header : in_all;
    if (possible.size() > 1) {
      std::string rule = "may be separated by";
      for (const char each : possible) rule += " '" + separator_name(each) + "'";
      problems_.add(lines_[0].number, "", lines_[0].text,
                    rule + ": write separator = \"" + separator_name(possible[0]) +
                        "\" (or the other) in the file of --columns");
      return false;
    }
    if (!possible.empty()) table_.separator = possible[0];
    return true;
  }

  bool read_header() {
    std::vector<std::string_view> fields;
    const Line& line = lines_.front();
    table_.header_line = line.number;
    if (!split(line.text, table_.separator, fields)) {
      problems_.add(line.number, "", line.text, "has a quote that is not closed");
      return false;
    }
    // A separator at the end of every line makes no column.
    while (fields.size() > 1 && fields.back().empty()) {
      fields.pop_back();
      ++empty_at_end_;
    }
    const auto is_value = [](std::string_view field) {
      return field.empty() || finite_number(field) || parse_time_stamp(field);
    };
    if (std::all_of(fields.begin(), fields.end(), is_value)) {
      problems_.add(line.number, "", line.text, "must be the header row, names of columns");
      return false;
    }
    if (fields.size() > columns_max) {
      problems_.add(line.number, "columns", std::to_string(fields.size()),
                    "must be at most " + std::to_string(columns_max));
      return false;
    }
    for (const std::string_view field : fields) table_.header.emplace_back(field);
    return true;
  }

  void read_rows() {
    std::vector<std::string_view> fields;
    table_.fields.reserve((lines_.size() - 1) * table_.columns());
    table_.lines.reserve(lines_.size() - 1);
    for (std::size_t i = 1; i < lines_.size() && !problems_.full(); ++i) {
      const Line& line = lines_[i];
      if (!split(line.text, table_.separator, fields)) {
        problems_.add(line.number, "", line.text, "has a quote that is not closed");
        continue;
      }
      for (std::size_t k = 0;
           k < empty_at_end_ && fields.size() > table_.columns() && fields.back().empty(); ++k)
        fields.pop_back();
      if (fields.size() != table_.columns()) {
        problems_.add(line.number, "", std::to_string(fields.size()) + " fields",
                      "must have " + std::to_string(table_.columns()) + ", as the header");
        continue;
      }
      table_.fields.insert(table_.fields.end(), fields.begin(), fields.end());
      table_.lines.push_back(line.number);
    }
    if (table_.rows() == 0 && problems_.empty()) problems_.add(0, "", "", "has no row of data");
  }

  const ColumnMap* map_;
  ProblemList& problems_;
  TextTable table_;
  std::vector<Line> lines_;
  std::optional<char> told_separator_;
  std::size_t empty_at_end_{0};
};

}  // namespace

TextTable read_text_table(std::string_view text, const ColumnMap* map, ProblemList& problems) {
  return TableReader(map, problems).read(text);
}

std::string separator_name(char separator) {
  return separator == '\t' ? "tab" : std::string(1, separator);
}

}  // namespace thermocomp
