#include "config/run_forms/text_table.hpp"

#include <algorithm>
#include <map>
#include <set>

#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "config/text/printable_text.hpp"

namespace thermocomp {
namespace {

constexpr std::string_view separators = ";\t,|";
constexpr std::size_t rows_judged = 200;
constexpr std::size_t header_rows_max = 10;
constexpr std::size_t columns_max = 1024;  // as in our own form
constexpr double values_share_min = 0.2;

/// Splits a line; a quoted field may contain the separator and doubled quotes. A quote with text
/// behind it is a part of its field: "AI".Bed.
/// @return false for an unclosed quote
bool split(std::string_view line, char separator, std::vector<std::string_view>& fields) {
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

/// Replaces each doubled quote by one.
std::string unquoted(std::string_view field) {
  std::string text(field);
  for (auto at = text.find("\"\""); at != std::string::npos; at = text.find("\"\"", at + 1))
    text.erase(at, 1);
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

enum class Shows { text, nothing, number, time };

Shows shown_by(std::string_view field) {
  if (is_missing(field)) return Shows::nothing;
  if (looks_like_number(field)) return Shows::number;
  return parse_time_stamp(field) ? Shows::time : Shows::text;
}

class TableReader {
 public:
  TableReader(const ColumnMap* map, int lines_above, ProblemList& problems)
      : map_(map), lines_above_(lines_above), problems_(problems) {}

  TextTable read(std::string text) {
    table_.text = std::move(text);
    spell_numbers_plainly();
    table_.text.reserve(
        64);  // heap-allocated, so that moving the table keeps pointers into it valid
    find_lines();
    if (lines_.empty()) {
      problems_.add(0, "", "", "has no header row");
      return std::move(table_);
    }
    if (!choose_separator()) return std::move(table_);
    widen_to_header();
    if (find_header()) read_rows();
    return std::move(table_);
  }

 private:
  struct Line {
    int number;
    std::string_view text;
  };
  using Fields = std::vector<std::string_view>;

  /// The result of splitting all lines by one separator.
  struct Cut {
    char separator{','};
    std::size_t fields{1};
    std::size_t begin{0};  ///< first line with this number of fields
    double score{0.0};
    double values{0.0};  ///< share of fields that are numbers or times
  };

  /// Normalises "+    20.0" (aligned by loggers) to "    +20.0", typeset minus and digit groups.
  void spell_numbers_plainly() {
    std::string& all = table_.text;
    if (all.find_first_of("\xC2\xE2") != std::string::npos) all = with_plain_letters(all);
    for (auto at = all.find_first_of("+-"); at != std::string::npos;
         at = all.find_first_of("+-", at + 1)) {
      const bool begins =
          at == 0 || std::string_view(";\t,|\"\n").find(all[at - 1]) != std::string_view::npos;
      const auto digit = all.find_first_not_of(' ', at + 1);
      if (!begins || digit == std::string::npos || digit == at + 1 || !is_digit(all[digit]))
        continue;
      std::swap(all[at], all[digit - 1]);
      at = digit;
    }
  }

  /// "---------+-------" and "+-----+", as drawn by database consoles.
  static bool is_rule(std::string_view line) {
    return line.starts_with("+--") ||
           (line.starts_with("---") && line.find_first_not_of("-+") == std::string_view::npos);
  }

  /// Lines that programs write after the last row.
  static bool is_end(std::string_view line) {
    return line == "EOF" ||
           (line.starts_with('(') && (line.ends_with(" rows)") || line.ends_with(" row)")));
  }

  /// A quoted name may span several lines, as in a spreadsheet's header.
  std::string_view with_quoted_ends(std::string_view line, std::string_view& rest, int& number) {
    constexpr int lines_max = 8;
    const auto is_open = [](std::string_view text) {
      return std::count(text.begin(), text.end(), '"') % 2 == 1;
    };
    std::string_view longer = line;
    std::string_view behind = rest;
    for (int more = 1; more <= lines_max && is_open(longer) && !behind.empty(); ++more) {
      std::string_view next;
      static_cast<void>(take(behind, '\n', next));
      longer = {line.data(), static_cast<std::size_t>(next.data() + next.size() - line.data())};
      if (is_open(longer)) continue;
      const auto begin = static_cast<std::size_t>(line.data() - table_.text.data());
      for (std::size_t i = begin; i < begin + longer.size(); ++i)
        if (table_.text[i] == '\n' || table_.text[i] == '\r') table_.text[i] = ' ';
      rest = behind;
      number += more;
      return longer;
    }
    return line;
  }

  void find_lines() {
    std::string_view rest = table_.text;
    std::string_view line;
    for (int number = 1 + lines_above_; !rest.empty(); ++number) {
      static_cast<void>(take(rest, '\n', line));
      line = with_quoted_ends(line, rest, number);
      if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
      if (map_ != nullptr && number < map_->header_line) continue;
      const bool is_comment = line.starts_with('#');
      if (is_comment && lines_.empty()) last_comment_ = {number, line};
      if (is_comment || line.find_first_not_of(" \t;,|") == std::string_view::npos) continue;
      if (is_rule(line)) continue;
      // Excel's first line defines the separator.
      if (lines_.empty() && line.size() == 5 && line.starts_with("sep=")) {
        given_separator_ = line[4];
        continue;
      }
      lines_.push_back({number, line});
    }
    if (lines_.size() > 2 && is_end(lines_.back().text)) lines_.pop_back();
  }

  [[nodiscard]] std::size_t judged() const { return std::min(lines_.size(), rows_judged); }

  [[nodiscard]] Cut cut_by(char separator) const {
    std::map<std::size_t, std::size_t> lines_of;
    std::vector<Fields> cut(judged());
    for (std::size_t i = 0; i < cut.size(); ++i) {
      static_cast<void>(split(lines_[i].text, separator, cut[i]));
      ++lines_of[cut[i].size()];
    }
    Cut best;
    best.separator = separator;
    std::size_t most = 0;
    for (const auto& [fields, lines] : lines_of) {
      if (fields < 2 || lines < most) continue;
      most = lines;
      best.fields = fields;
    }
    if (best.fields < 2) return best;
    while (cut[best.begin].size() != best.fields) ++best.begin;
    std::size_t values = 0;
    std::size_t texts = 0;
    for (std::size_t i = (best.begin + cut.size()) / 2; i < cut.size(); ++i) {
      if (cut[i].size() != best.fields) continue;
      for (const std::string_view field : cut[i]) {
        const Shows shown = shown_by(field);
        if (shown != Shows::nothing) ++(shown == Shows::text ? texts : values);
      }
    }
    best.values = static_cast<double>(values) / std::max<double>(1.0, double(values + texts));
    best.score = static_cast<double>(most) / static_cast<double>(cut.size() - best.begin) *
                 (0.1 + best.values);
    return best;
  }

  bool choose_separator() {
    if (map_ != nullptr && map_->separator) given_separator_ = map_->separator;
    if (given_separator_) {
      cut_ = cut_by(*given_separator_);
    } else {
      for (const char separator : separators) {
        const Cut cut = cut_by(separator);
        if (cut.fields > 1 && cut.score > cut_.score) cut_ = cut;
      }
      if (cut_.fields < 2) cut_ = cut_by(' ');
    }
    table_.separator = cut_.separator;
    const bool is_table = cut_.fields > 1 && (cut_.values >= values_share_min || judged() == 1);
    if (!is_table)
      problems_.add(lines_[0].number, "", lines_[0].text,
                    "is not a known table: rows of numbers and times between ; , tab | "
                    "or blanks; docs/run_files.md lists the forms that are read");
    return is_table;
  }

  Fields fields_of(std::size_t line) {
    Fields fields;
    if (!split(lines_[line].text, table_.separator, fields)) fields.clear();
    fill_up(fields);
    return fields;
  }

  /// Missing last columns of a row are empty.
  void fill_up(Fields& fields) const {
    if (narrowest_ > 0 && fields.size() >= narrowest_ && fields.size() < cut_.fields)
      fields.resize(cut_.fields);
  }

  /// Allows most rows to omit the last column, a serial number that is only in the first row.
  void widen_to_header() {
    if (cut_.separator == ' ' || cut_.begin < 2) return;
    const std::size_t line = cut_.begin - 2;
    const Fields names = fields_of(line);
    if (names.size() != cut_.fields + 1 || !names.back().starts_with("Serial") ||
        !is_all_words(line) || fields_of(line + 1).size() != names.size())
      return;
    narrowest_ = cut_.fields;
    cut_.fields = names.size();
    cut_.begin = line;
  }

  bool is_all_words(std::size_t line) {
    const Fields fields = fields_of(line);
    return std::none_of(fields.begin(), fields.end(), [](std::string_view field) {
      const Shows shown = shown_by(field);
      return shown == Shows::number || shown == Shows::time;
    });
  }

  /// The kind of each column in the lower half of the judged lines.
  std::vector<Shows> kinds() {
    std::vector<std::array<std::size_t, 4>> counts(cut_.fields);
    for (std::size_t i = (cut_.begin + judged()) / 2; i < judged(); ++i) {
      const Fields fields = fields_of(i);
      if (fields.size() != cut_.fields) continue;
      for (std::size_t k = 0; k < fields.size(); ++k)
        ++counts[k][static_cast<std::size_t>(shown_by(fields[k]))];
    }
    std::vector<Shows> kinds;
    for (const auto& [texts, nothing, numbers, times] : counts)
      kinds.push_back(times > texts + numbers                   ? Shows::time
                      : numbers >= texts + times && numbers > 0 ? Shows::number
                                                                : Shows::text);
    return kinds;
  }

  /// The first line of values: its time column, or else its first numeric column and half of the
  /// others, have the same kind as below.
  std::size_t first_row() {
    const std::vector<Shows> kind = kinds();
    const auto time = std::find(kind.begin(), kind.end(), Shows::time);
    const auto numbers = std::count(kind.begin(), kind.end(), Shows::number);
    const auto first = std::find(kind.begin(), kind.end(), Shows::number);
    for (std::size_t i = cut_.begin; i < judged(); ++i) {
      const Fields fields = fields_of(i);
      if (fields.size() != cut_.fields) continue;
      if (time != kind.end()) {
        if (shown_by(fields[static_cast<std::size_t>(time - kind.begin())]) == Shows::time)
          return i;
        continue;
      }
      std::ptrdiff_t alike = 0;
      for (std::size_t k = 0; k < fields.size(); ++k)
        if (kind[k] == Shows::number && looks_like_number(fields[k])) ++alike;
      const bool first_is_alike =
          numbers > 0 && looks_like_number(fields[static_cast<std::size_t>(first - kind.begin())]);
      if (first_is_alike && 2 * alike >= numbers) return i;
    }
    return std::min(cut_.begin + 1, lines_.size());
  }

  /// Names of columns that are not a quantity: time stamp, record number.
  static bool is_word_of_logger(std::string_view field) {
    return field == "TS" || field == "RN" || field == "NO." || field == "Time";
  }

  void take_units(std::size_t line) {
    units_line_ = line;
    table_.units.clear();
    for (const std::string_view field : fields_of(line))
      table_.units.emplace_back(is_word_of_logger(field) ? "" : without_brackets(field));
  }

  /// A row of units has more units than other fields.
  static bool is_row_of_units(const Fields& fields) {
    std::size_t known = 0;
    std::size_t other = 0;
    for (const std::string_view field : fields) {
      if (field.empty() || field == "-") continue;
      const bool of_logger = is_word_of_logger(field);
      ++(of_logger || spelled_unit(without_brackets(field)) != nullptr ? known : other);
    }
    return known > other;
  }

  static std::string_view without_brackets(std::string_view field) {
    const bool has = field.size() > 2 && (field.front() == '[' || field.front() == '(');
    return has ? trimmed(field.substr(1, field.size() - 2)) : field;
  }

  /// Of the lines above the first row the one with the most names; in a tie the lowest.
  bool find_header() {
    const bool named = map_ != nullptr && map_->header_line > 0;
    row_begin_ = named ? std::max<std::size_t>(first_row(), 1) : first_row();
    std::optional<std::size_t> names;
    std::size_t most = 0;
    for (std::size_t up = 1; up <= std::min(row_begin_, header_rows_max); ++up) {
      const std::size_t i = row_begin_ - up;
      const Fields fields = fields_of(i);
      if (named ? i == 0 : fields.size() == cut_.fields) {
        if (fields.size() == cut_.fields && is_row_of_units(fields) && i > 0) {
          take_units(i);
          continue;
        }
        std::set<std::string_view> distinct(fields.begin(), fields.end());
        distinct.erase("");
        if (distinct.size() > most) {
          most = distinct.size();
          names = i;
        }
      } else if (named && fields.size() == cut_.fields && is_row_of_units(fields)) {
        take_units(i);
      } else if (!named) {
        break;
      }
    }
    const bool has_given = map_ != nullptr && !map_->names.empty();
    if (!names && row_begin_ > 0 && !has_given && is_all_words(row_begin_ - 1))
      names = row_begin_ - 1;
    if (cut_.fields > columns_max) {
      problems_.add(lines_[row_begin_ < lines_.size() ? row_begin_ : 0].number, "columns",
                    std::to_string(cut_.fields), "must be at most " + std::to_string(columns_max));
      return false;
    }
    if (names) {
      if (!take_names(*names)) return false;
    } else if (!take_commented_names() && !take_given_names()) {
      return false;
    } else if (row_begin_ > 0 && !is_all_words(row_begin_ - 1)) {
      problems_.add(lines_[row_begin_ - 1].number, "",
                    std::to_string(fields_of(row_begin_ - 1).size()) + " fields",
                    "must have " + std::to_string(cut_.fields) + ", as the rows below");
      return false;
    }
    return names_are_clear();
  }

  /// Whether the first column of the rows is a time, or counts them.
  bool begins_with_count_or_time() {
    std::optional<double> last;
    for (std::size_t i = row_begin_; i < judged(); ++i) {
      const Fields fields = fields_of(i);
      if (fields.size() != cut_.fields) continue;
      if (shown_by(fields[0]) == Shows::time) return true;
      const auto number = finite_number(fields[0]);
      if (!number || (last ? *number != *last + 1 : *number != 0 && *number != 1)) return false;
      last = number;
    }
    return true;
  }

  static std::string more_lines(std::size_t count) {
    if (count == 0) return {};
    return " and " + std::to_string(count) + (count == 1 ? " more line" : " more lines");
  }

  bool take_names(std::size_t line) {
    Fields fields = fields_of(line);
    while (fields.size() > cut_.fields && fields.back().empty()) fields.pop_back();
    if (fields.size() + 1 == cut_.fields) {
      const Fields row = fields_of(row_begin_);
      if (row.size() == cut_.fields && row.back().empty())
        fields.emplace_back();  // a separator at the end of each row
      else if (begins_with_count_or_time())
        fields.insert(fields.begin(), std::string_view());
    }
    if (fields.empty()) {
      problems_.add(lines_[line].number, "", lines_[line].text, "has a quote that is not closed");
      return false;
    }
    if (fields.size() != cut_.fields) {
      problems_.add(lines_[line].number, "", std::to_string(fields.size()) + " names",
                    "must be one for each of the " + std::to_string(cut_.fields) +
                        " fields of the rows below: write names = [\"time_s\", \"t1_degC\", ...] "
                        "in the file of --columns");
      return false;
    }
    table_.has_header = true;
    table_.header_line = lines_[line].number;
    for (const std::string_view field : fields) table_.header.push_back(unquoted(field));
    header_text_ = lines_[line].text;
    if (line > 0)
      table_.notes.push_back("above the header in line " + std::to_string(table_.header_line) +
                             " left out: '" + shortened(lines_[0].text) + "'" +
                             more_lines(line - 1));
    const std::size_t between = row_begin_ - line - 1 - (units_line_ > line ? 1 : 0);
    if (between > 0)
      table_.notes.push_back("between the header and the first row left out: '" +
                             shortened(lines_[row_begin_ - 1].text) + "'" +
                             more_lines(between - 1));
    return true;
  }

  /// "# time t1 z": names in the last comment before rows without a header.
  bool take_commented_names() {
    std::string_view text = last_comment_.text;
    if (row_begin_ > 0 || text.empty()) return false;
    Fields fields;
    static_cast<void>(split(text, table_.separator, fields));
    if (fields.size() != cut_.fields) {
      static_cast<void>(split(trimmed(text.substr(1)), table_.separator, fields));
    } else {
      fields[0] = trimmed(fields[0].substr(1));
    }
    if (fields.size() != cut_.fields || !std::all_of(fields.begin(), fields.end(), [](auto field) {
          return shown_by(field) == Shows::text || field.empty();
        }))
      return false;
    table_.has_header = true;
    table_.header_line = last_comment_.number;
    for (const std::string_view field : fields) table_.header.emplace_back(field);
    return true;
  }

  bool take_given_names() {
    row_begin_ = row_begin_ < lines_.size() ? row_begin_ : 0;
    table_.header.assign(cut_.fields, "");
    const bool has_names = map_ != nullptr && !map_->names.empty();
    if (!has_names) return true;
    if (map_->names.size() != cut_.fields) {
      problems_.add(
          lines_[row_begin_].number, "names", std::to_string(map_->names.size()) + " names",
          "must be one for each of the " + std::to_string(cut_.fields) + " fields of a row");
      return false;
    }
    table_.header = map_->names;
    return true;
  }

  bool names_are_clear() {
    if (table_.has_header && map_ != nullptr && !map_->names.empty())
      problems_.add(table_.header_line, "names", map_->names.front(),
                    "are for a table without a header; this one has names in this line");
    for (std::size_t i = 0; i < table_.header.size(); ++i)
      if (table_.header[i].empty()) table_.header[i] = unnamed(i);
    return problems_.empty();
  }

  void read_rows() {
    Fields fields;
    const std::size_t rows = lines_.size() - std::min(row_begin_, lines_.size());
    table_.fields.reserve(rows * table_.columns());
    table_.lines.reserve(rows);
    for (std::size_t i = row_begin_; i < lines_.size() && !problems_.full(); ++i) {
      const Line& line = lines_[i];
      if (!header_text_.empty() && line.text == header_text_) continue;
      if (!split(line.text, table_.separator, fields)) {
        problems_.add(line.number, "", line.text, "has a quote that is not closed");
        continue;
      }
      while (fields.size() > table_.columns() && fields.back().empty()) fields.pop_back();
      fill_up(fields);
      const bool is_cut_off = i + 1 == lines_.size() && table_.text.back() != '\n';
      if (is_cut_off && fields.size() < table_.columns() && table_.rows() > 0) {
        table_.notes.push_back("the last line, " + std::to_string(line.number) +
                               ", is cut off: left out");
        continue;
      }
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
  int lines_above_;
  ProblemList& problems_;
  TextTable table_;
  std::vector<Line> lines_;
  Line last_comment_{0, {}};
  std::optional<char> given_separator_;
  Cut cut_;
  std::size_t narrowest_{0};  ///< required fields of a row; 0: all
  std::size_t row_begin_{0};
  std::size_t units_line_{0};
  std::string_view header_text_;
};

}  // namespace

void TextTable::leave_out(const std::vector<bool>& left_out) {
  TextTable kept;
  for (std::size_t i = 0; i < columns(); ++i) {
    if (left_out[i]) continue;
    kept.header.push_back(header[i]);
    if (!units.empty()) kept.units.push_back(units[i]);
  }
  for (std::size_t k = 0; k < fields.size(); ++k)
    if (!left_out[k % columns()]) kept.fields.push_back(fields[k]);
  header = std::move(kept.header);
  units = std::move(kept.units);
  fields = std::move(kept.fields);
}

TextTable read_text_table(std::string text, const ColumnMap* map, int lines_above,
                          ProblemList& problems) {
  return TableReader(map, lines_above, problems).read(std::move(text));
}

std::string separator_name(char separator) {
  return separator == '\t' ? "tab" : separator == ' ' ? "blank" : std::string(1, separator);
}

std::string unnamed(std::size_t column) {
  return "column " + std::to_string(column + 1);
}

bool is_unnamed(std::string_view header) {
  return header.starts_with("column ") &&
         header.find_first_not_of("0123456789", 7) == std::string_view::npos;
}

}  // namespace thermocomp
