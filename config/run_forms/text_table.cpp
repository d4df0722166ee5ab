#include "config/run_forms/text_table.hpp"

#include <algorithm>
#include <array>
#include <iterator>
#include <map>
#include <utility>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_lines.hpp"
#include "config/run_forms/time_stamp.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

constexpr std::string_view separators = ";\t,|";
constexpr std::size_t rows_judged = 200;
constexpr std::size_t fields_max = 1024;  // as in our own form
constexpr double values_share_min = 0.2;
constexpr std::size_t header_rows_max = 10;

/// Kinds of values in a row of types, and statistics of a column.
constexpr std::string_view type_words =
    "|smp|avg|std|tot|string|text|double|float|real|int|integer|long|bool|boolean"
    "|datetime|";
constexpr std::string_view statistic_words =
    "|min|max|mean|average|minimum|maximum|mittelwert|lower limit|upper limit|";

enum class FieldKind { text, nothing, number, time };

using TableFields = std::vector<std::string_view>;

FieldKind kind_of_field(std::string_view field) {
  if (is_missing(field)) return FieldKind::nothing;
  if (looks_like_number(field)) return FieldKind::number;
  return parse_time_stamp(field) ? FieldKind::time : FieldKind::text;
}

/// One of the first lines.
struct HeadLine {
  bool is_closed{true};  ///< no quote is open
  TableFields fields;
  std::vector<FieldKind> kinds;

  [[nodiscard]] bool has(FieldKind kind) const {
    return std::ranges::find(kinds, kind) != kinds.end();
  }
  /// Whether no field is a number or a time.
  [[nodiscard]] bool is_all_words() const {
    return !has(FieldKind::number) && !has(FieldKind::time);
  }
};

/// The column that distinguishes rows from other lines: the first of times, else the first of
/// numbers.
std::optional<std::size_t> key_column(const std::vector<FieldKind>& kinds) {
  for (const FieldKind kind : {FieldKind::time, FieldKind::number})
    if (const auto found = std::ranges::find(kinds, kind); found != kinds.end())
      return static_cast<std::size_t>(found - kinds.begin());
  return std::nullopt;
}

/// Names of columns that are not a quantity: time stamp, record number.
bool is_word_of_logger(std::string_view field) {
  return field == "TS" || field == "RN" || field == "NO." || field == "Time";
}

/// The unit in a field of a row of units, without brackets; empty: none.
std::string_view unit_in_row(std::string_view field) {
  if (is_word_of_logger(field)) return {};
  const bool has = field.size() > 2 && (field.front() == '[' || field.front() == '(');
  return has ? trimmed(field.substr(1, field.size() - 2)) : field;
}

/// A row of units has more units than other fields.
bool is_row_of_units(const TableFields& fields) {
  std::size_t known = 0;
  std::size_t other = 0;
  for (const std::string_view field : fields) {
    if (field.empty() || field == "-") continue;
    ++(is_word_of_logger(field) || spelled_unit(unit_in_row(field)) != nullptr ? known : other);
  }
  return known > other;
}

bool is_row_of_types(const TableFields& fields) {
  return std::ranges::all_of(fields, [](std::string_view field) {
    return field.empty() || is_one_of(type_words, field.substr(0, field.find(':')));
  });
}

/// "Min", "Mittelwert:"
bool names_statistic(std::string_view field) {
  return is_one_of(statistic_words, field.substr(0, field.find_first_of(".:")));
}

/// Channel numbers, 1 2 3, or the statistics of each column.
bool is_known_row_of_numbers(const HeadLine& line) {
  if (names_statistic(line.fields[0])) return true;
  if (line.has(FieldKind::time)) return false;
  std::vector<double> numbers;
  for (std::size_t i = 0; i < line.kinds.size(); ++i)
    if (line.kinds[i] == FieldKind::number)
      numbers.push_back(finite_number(line.fields[i]).value_or(not_a_number));
  return numbers.size() > 1 && (numbers[0] == 0 || numbers[0] == 1) &&
         std::ranges::adjacent_find(numbers, [](double a, double b) { return !(b == a + 1); }) ==
             numbers.end();
}

/// Whether a line has words, and neither a number nor a time: an event, the end of a file. The
/// statistics of the columns are such a line, too, unless rows begin with words.
bool is_remark(const TableFields& fields, bool begins_with_words) {
  if (fields.empty() || fields[0].empty()) return false;
  if (!begins_with_words && names_statistic(fields[0])) return true;
  HeadLine line;
  std::ranges::transform(fields, std::back_inserter(line.kinds), kind_of_field);
  return line.is_all_words() && line.has(FieldKind::text);
}

/// Whether the key column has its kind, or is missing in a line without any word.
bool may_be_row(const HeadLine& line, const std::vector<FieldKind>& kinds, std::size_t key) {
  if (line.kinds.size() != kinds.size()) return false;
  if (line.kinds[key] != FieldKind::nothing) return line.kinds[key] == kinds[key];
  return kinds[key] == FieldKind::number && !line.is_all_words() &&
         !is_known_row_of_numbers(line) && !line.has(FieldKind::text);
}

/// True if, in addition, half of the numbers are present.
bool is_row(const HeadLine& line, const std::vector<FieldKind>& kinds, std::size_t key) {
  if (!may_be_row(line, kinds, key)) return false;
  std::ptrdiff_t alike = 0;
  for (std::size_t k = 0; k < kinds.size(); ++k)
    if (kinds[k] == FieldKind::number && line.kinds[k] == FieldKind::number) ++alike;
  return 2 * alike >= std::ranges::count(kinds, FieldKind::number);
}

/// 1 0.1 0.1 below a row of units.
bool may_be_factors(const TableFields& fields) {
  constexpr std::array powers{0.001, 0.01, 0.1, 1.0, 10.0, 100.0, 1000.0};
  bool all_one = true;
  for (const std::string_view field : fields) {
    const auto number = finite_number(field);
    if (!number || std::ranges::find(powers, *number) == powers.end()) return false;
    all_one = all_one && *number == 1.0;
  }
  return !all_one;
}

/// "Scale,0.1,0.1" above the names.
bool is_named_row_of_factors(const TableFields& fields) {
  constexpr std::string_view names = "|scale|scaling|factor|gain|multiplier|skalierung|faktor|";
  if (fields.empty() || !is_one_of(names, fields[0])) return false;
  return std::any_of(fields.begin() + 1, fields.end(), [](std::string_view field) {
    const auto number = finite_number(field);
    return number && *number != 1.0;
  });
}

bool names_time_or_unit(const TableFields& fields) {
  return std::ranges::any_of(fields, [](std::string_view field) {
    return names_time(field) || !unit_of_time_name(field).empty() ||
           spelled_name(field).known != nullptr;
  });
}

class TableReader {
 public:
  TableReader(const ColumnMap& map, ProblemList& problems)
      : map_(map), problems_(problems), table_(map, problems) {}

  TextTable read(PlainTable plain) {
    table_.text = std::move(plain.text);
    table_.has_own_names = plain.has_own_names;
    // Heap-allocated, so that moving the table keeps pointers into it valid.
    table_.text.reserve(64);
    found_ = find_lines(table_.text, plain.lines_above, map_.header_line);
    for (TextLine& line : found_.lines)
      if (!plain.numbers.empty())
        line.number = plain.numbers.at(static_cast<std::size_t>(line.number - 1));
    table_.references = found_.references;
    if (lines_.empty()) {
      problems_.add(0, "", "", "has no header row");
    } else if (choose_separator()) {
      widen_to_header();
      find_header();
      if (take_header()) read_rows();
    }
    return std::move(table_);
  }

 private:
  /// The result of splitting the first lines by one separator.
  struct Cut {
    char separator{','};
    std::vector<HeadLine> lines;
    std::size_t fields{1};
    std::size_t begin{0};  ///< first line with this number of fields
    double score{0.0};
    double values{0.0};  ///< share of fields that are numbers or times
  };

  [[nodiscard]] Cut cut_by(char separator) const {
    Cut cut{separator, {}};
    std::map<std::size_t, std::size_t> lines_of;
    for (std::size_t i = 0; i < std::min(lines_.size(), rows_judged); ++i) {
      HeadLine& line = cut.lines.emplace_back();
      line.is_closed = split_line(lines_[i].text, separator, line.fields);
      std::ranges::transform(line.fields, std::back_inserter(line.kinds), kind_of_field);
      ++lines_of[line.fields.size()];
    }
    std::size_t most = 0;
    for (const auto& [fields, lines] : lines_of) {
      if (fields < 2 || lines < most) continue;
      most = lines;
      cut.fields = fields;
    }
    if (cut.fields < 2) return cut;
    while (cut.lines[cut.begin].fields.size() != cut.fields) ++cut.begin;
    std::ptrdiff_t filled = 0;
    std::ptrdiff_t texts = 0;
    for (std::size_t i = (cut.begin + cut.lines.size()) / 2; i < cut.lines.size(); ++i) {
      const std::vector<FieldKind>& kinds = cut.lines[i].kinds;
      if (kinds.size() != cut.fields) continue;
      filled += std::ssize(kinds) - std::ranges::count(kinds, FieldKind::nothing);
      texts += std::ranges::count(kinds, FieldKind::text);
    }
    cut.values = static_cast<double>(filled - texts) / std::max(1.0, static_cast<double>(filled));
    cut.score = static_cast<double>(most) / static_cast<double>(cut.lines.size() - cut.begin) *
                (0.1 + cut.values);
    return cut;
  }

  bool choose_separator() {
    if (const auto given = map_.separator ? map_.separator : found_.separator) {
      cut_ = cut_by(*given);
    } else {
      for (const char separator : separators) {
        Cut cut = cut_by(separator);
        if (cut.fields > 1 && cut.score > cut_.score) cut_ = std::move(cut);
      }
      if (cut_.fields < 2) cut_ = cut_by(' ');
    }
    table_.separator = cut_.separator;
    const bool is_table =
        cut_.fields > 1 && (cut_.values >= values_share_min || cut_.lines.size() == 1);
    if (!is_table)
      refuse(lines_[0], lines_[0].text,
             "is not a known table: rows of numbers and times between ; , tab | or blanks; "
             "docs/run_files.md lists the forms that are read");
    for (HeadLine& line : cut_.lines)
      if (!line.is_closed) line = {};
    return is_table;
  }

  /// Missing last columns of a row are empty.
  void fill_up(TableFields& fields) const {
    if (narrowest_ > 0 && fields.size() >= narrowest_ && fields.size() < cut_.fields)
      fields.resize(cut_.fields);
  }

  /// Allows most rows to omit the last column, a serial number that is only in the first row.
  void widen_to_header() {
    if (cut_.separator == ' ' || cut_.begin < 2) return;
    const std::size_t line = cut_.begin - 2;
    const TableFields& names = head_[line].fields;
    if (names.size() != cut_.fields + 1 || !names.back().starts_with("Serial") ||
        !head_[line].is_all_words() || head_[line + 1].fields.size() != names.size())
      return;
    narrowest_ = cut_.fields;
    cut_.fields = names.size();
    cut_.begin = line;
    for (HeadLine& each : cut_.lines) {
      fill_up(each.fields);
      each.kinds.resize(each.fields.size(), FieldKind::nothing);
    }
  }

  // ---- header
  /// The kind of each column in the lower half of the lines.
  [[nodiscard]] std::vector<FieldKind> column_kinds() const {
    std::vector<std::array<std::size_t, 4>> counts(cut_.fields);
    for (std::size_t i = (cut_.begin + head_.size()) / 2; i < head_.size(); ++i)
      for (std::size_t k = 0; k < cut_.fields && head_[i].kinds.size() == cut_.fields; ++k)
        ++counts[k][static_cast<std::size_t>(head_[i].kinds[k])];
    std::vector<FieldKind> kinds;
    for (const auto& [texts, nothing, numbers, times] : counts)
      kinds.push_back(times > texts + numbers                   ? FieldKind::time
                      : numbers >= texts + times && numbers > 0 ? FieldKind::number
                                                                : FieldKind::text);
    return kinds;
  }

  /// The first row from `begin` on, with those before it whose values are missing.
  [[nodiscard]] std::size_t first_row(std::size_t begin) const {
    const std::vector<FieldKind> kinds = column_kinds();
    const auto key = key_column(kinds);
    for (const auto& is : {is_row, may_be_row}) {
      std::size_t row = key ? begin : head_.size();
      while (row < head_.size() && !is(head_[row], kinds, *key)) ++row;
      if (row == head_.size()) continue;
      while (row > begin && may_be_row(head_[row - 1], kinds, *key)) --row;
      return row;
    }
    return std::min(begin + 1, head_.size());
  }

  /// Finds names and units above the first row.
  void find_names() {
    bool is_found = false;
    for (std::size_t up = 1; up <= std::min(row_begin_, header_rows_max); ++up) {
      const std::size_t i = row_begin_ - up;
      const HeadLine& line = head_[i];
      if (line.fields.size() != cut_.fields) {
        // One name too few is explained; another count is refused.
        if (!names_line_ && line.is_all_words()) names_line_ = i;
        return;
      }
      if (is_row_of_units(line.fields) && i > 0) {
        if (!units_line_) units_line_ = i;
        continue;
      }
      const std::size_t named =
          cut_.fields - static_cast<std::size_t>(std::ranges::count(line.fields, ""));
      const bool has_names = named >= 2 || 2 * named >= cut_.fields;
      if (is_found || !has_names || line.has(FieldKind::time) || is_row_of_types(line.fields))
        continue;
      is_found = names_time_or_unit(line.fields);
      if (is_found || (!names_line_ && line.is_all_words())) names_line_ = i;
    }
  }

  /// The header is the lowest line above the first row that names the time or a unit, else the
  /// lowest one of words; it has as many fields as the rows. Lines of units, types, channel numbers
  /// and statistics between it and the first row are recognised; other numbers there are unclear.
  void find_header() {
    const bool is_first = map_.header_line > 0;
    row_begin_ = first_row(is_first ? 1 : cut_.begin);
    if (!is_first) find_names();
    if (is_first) names_line_ = 0;
    for (std::size_t i = 1; is_first && i < row_begin_; ++i)
      if (head_[i].fields.size() == cut_.fields && is_row_of_units(head_[i].fields))
        units_line_ = i;
    if (!names_line_) {
      if (row_begin_ > 0 && head_[row_begin_ - 1].fields.size() == cut_.fields &&
          !head_[row_begin_ - 1].is_all_words())
        unclear_line_ = row_begin_ - 1;
      return;
    }
    for (std::size_t i = 0; i < *names_line_; ++i)
      if (is_named_row_of_factors(head_[i].fields)) unclear_line_ = i;
    for (std::size_t i = *names_line_ + 1; i < row_begin_; ++i)
      if (!unclear_line_ && !head_[i].is_all_words() && i != units_line_ &&
          !is_known_row_of_numbers(head_[i]))
        unclear_line_ = i;
    if (units_line_ && row_begin_ + 1 < head_.size() && may_be_factors(head_[row_begin_].fields) &&
        !may_be_factors(head_[row_begin_ + 1].fields))
      unclear_line_ = row_begin_;
  }

  bool take_header() {
    if (cut_.fields > fields_max) {
      problems_.add(lines_[row_begin_ < lines_.size() ? row_begin_ : 0].number, "columns",
                    std::to_string(cut_.fields), "must be at most " + std::to_string(fields_max));
    } else if (unclear_line_) {
      const TextLine& line = lines_[*unclear_line_];
      const std::string rule =
          names_line_ ? "delete the line; where it holds factors also write \"T1\" = { name = "
                        "\"t1_degC\", unit = \"0.1 degC\" } under [columns]"
                      : "delete the line or, if it holds the names, write header_line = " +
                            std::to_string(line.number);
      refuse(line, line.text,
             "is neither a row like those below nor names, units or numbers of channels: " + rule +
                 " in the file of --columns");
    } else if (names_line_ &&
               (map_.names.empty() || head_[*names_line_].fields.size() == cut_.fields)) {
      return take_names(*names_line_) && make_columns();
    } else if (take_commented_names() || take_given_names()) {
      if (row_begin_ == 0 || head_[row_begin_ - 1].is_all_words()) return make_columns();
      refuse(lines_[row_begin_ - 1],
             std::to_string(head_[row_begin_ - 1].fields.size()) + " fields",
             "must have " + std::to_string(cut_.fields) + ", as the rows below");
    }
    return false;
  }

  bool refuse(const TextLine& line, std::string_view value, std::string rule) {
    problems_.add(line.number, "", value, std::move(rule));
    return false;
  }

  /// Whether the first column of the rows is a time, or counts them.
  [[nodiscard]] bool begins_with_count_or_time() const {
    std::optional<double> last;
    for (std::size_t i = row_begin_; i < head_.size(); ++i) {
      if (head_[i].fields.size() != cut_.fields) continue;
      if (head_[i].kinds[0] == FieldKind::time) return true;
      const auto number = finite_number(head_[i].fields[0]);
      if (!number || (last ? *number != *last + 1 : *number != 0 && *number != 1)) return false;
      last = number;
    }
    return true;
  }

  void note_left_out(const std::string& where, std::size_t count, std::string_view line) {
    if (count == 0) return;
    std::string note = where + " left out: '" + shortened(line) + "'";
    if (count > 1) note += " and " + std::to_string(count - 1) + " more line";
    table_.notes.push_back(note + (count > 2 ? "s" : ""));
  }

  bool take_names(std::size_t line) {
    TableFields fields = head_[line].fields;
    while (fields.size() > cut_.fields && fields.back().empty()) fields.pop_back();
    if (fields.size() + 1 == cut_.fields) {
      const TableFields row = row_begin_ < head_.size() ? head_[row_begin_].fields : TableFields{};
      if (row.size() == cut_.fields && row.back().empty())
        fields.emplace_back();  // a separator at the end of each row
      else if (begins_with_count_or_time())
        fields.insert(fields.begin(), std::string_view());
    }
    if (fields.empty())
      return refuse(lines_[line], lines_[line].text, "has a quote that is not closed");
    const std::string count = std::to_string(fields.size()) + " names";
    if (cut_.separator == ',' && cut_.fields == 2 * fields.size() - 1)
      return refuse(lines_[line], count,
                    "above rows of " + std::to_string(cut_.fields) +
                        " fields: a comma separates them and seems to be the decimal sign, too; "
                        "write the file with decimal points or with semicolons between the fields");
    if (fields.size() != cut_.fields)
      return refuse(lines_[line], count,
                    "must be one for each of the " + std::to_string(cut_.fields) +
                        " fields of the rows below: write names = [\"time_s\", \"t1_degC\", ...] "
                        "in the file of --columns");
    // Names that stand above a row of further ones: "Time" above "", "Min", "Max".
    if (line > 0 && head_[line - 1].fields.size() == fields.size() &&
        head_[line - 1].is_all_words())
      for (std::size_t i = 0; i < fields.size(); ++i)
        if (fields[i].empty()) fields[i] = head_[line - 1].fields[i];
    table_.has_header = true;
    table_.header_line = lines_[line].number;
    for (const std::string_view field : fields) names_.push_back(unquoted(field));
    header_text_ = lines_[line].text;
    note_left_out("above the header in line " + std::to_string(table_.header_line), line,
                  lines_[0].text);
    const std::size_t below = units_line_ == line + 1 ? line + 2 : line + 1;
    if (below < row_begin_)
      note_left_out("between the header and the first row",
                    row_begin_ - below - (units_line_ > below ? 1 : 0), lines_[below].text);
    return true;
  }

  /// "# time t1 z": names in the last comment before rows without a header.
  bool take_commented_names() {
    const std::string_view text = found_.last_comment.text;
    if (row_begin_ > 0 || text.empty()) return false;
    TableFields fields;
    split_line(text, table_.separator, fields);
    if (fields.size() != cut_.fields)
      split_line(trimmed(text.substr(1)), table_.separator, fields);
    else
      fields[0] = trimmed(fields[0].substr(1));
    if (fields.size() != cut_.fields || !std::ranges::all_of(fields, [](std::string_view field) {
          return kind_of_field(field) == FieldKind::text || field.empty();
        }))
      return false;
    table_.has_header = true;
    table_.header_line = found_.last_comment.number;
    names_.assign(fields.begin(), fields.end());
    return true;
  }

  bool take_given_names() {
    row_begin_ = row_begin_ < lines_.size() ? row_begin_ : 0;
    names_ = map_.names;
    if (names_.empty()) names_.resize(cut_.fields);
    if (names_.size() == cut_.fields) return true;
    problems_.add(
        lines_[row_begin_].number, "names", std::to_string(names_.size()) + " names",
        "must be one for each of the " + std::to_string(cut_.fields) + " fields of a row");
    return false;
  }

  /// Makes the columns of `names_`.
  bool make_columns() {
    if (table_.has_header && !map_.names.empty())
      problems_.add(table_.header_line, "names", map_.names.front(),
                    "are for a table without a header; this one has names in this line");
    table_.has_unit_row = !header_text_.empty() && units_line_;
    for (std::size_t i = 0; i < names_.size(); ++i) {
      TextColumn& column = table_.columns.emplace_back();
      column.header = names_[i].empty() ? unnamed(i) : names_[i];
      if (table_.has_unit_row) column.unit_in_row = unit_in_row(head_[*units_line_].fields[i]);
    }
    return problems_.empty();
  }

  void read_rows() {
    TableFields fields;
    const std::size_t columns = table_.columns.size();
    const std::size_t rows = lines_.size() - std::min(row_begin_, lines_.size());
    for (TextColumn& column : table_.columns) column.fields.reserve(rows);
    table_.lines.reserve(rows);
    for (std::size_t i = row_begin_; i < lines_.size() && !problems_.full(); ++i) {
      const TextLine& line = lines_[i];
      if (!header_text_.empty() && line.text == header_text_) continue;
      if (!split_line(line.text, table_.separator, fields)) {
        refuse(line, line.text, "has a quote that is not closed");
        continue;
      }
      while (fields.size() > columns && fields.back().empty()) fields.pop_back();
      const bool begins_with_words =
          table_.rows() > 0 && kind_of_field(table_.columns[0].fields[0]) == FieldKind::text;
      if (table_.rows() > 0 && is_remark(fields, begins_with_words)) {
        take_remark(fields, line);
        continue;
      }
      fill_up(fields);
      const bool is_cut_off = i + 1 == lines_.size() && table_.text.back() != '\n';
      if (is_cut_off && fields.size() < columns && table_.rows() > 0) {
        table_.notes.push_back("the last line, " + std::to_string(line.number) +
                               ", is cut off: left out");
      } else if (fields.size() != columns) {
        refuse(line, std::to_string(fields.size()) + " fields",
               "must have " + std::to_string(columns) + ", as the header");
      } else {
        for (std::size_t k = 0; k < columns; ++k) table_.columns[k].fields.push_back(fields[k]);
        table_.lines.push_back(line.number);
      }
    }
    if (table_.rows() == 0 && problems_.empty()) problems_.add(0, "", "", "has no row of data");
    note_left_out("among the rows", remarks_, first_remark_);
  }

  /// Leaves out a line among the rows that has no number; refuses another header.
  void take_remark(const TableFields& fields, const TextLine& line) {
    std::vector<std::string> words;
    for (const std::string_view field : fields) words.push_back(unquoted(field));
    if (words == names_) return;
    if (std::ranges::is_permutation(words, names_))
      refuse(line, line.text,
             "names the columns in another order than line " + std::to_string(table_.header_line) +
                 ": give the rows below it a file of their own");
    if (remarks_++ == 0) first_remark_ = line.text;
  }

  const ColumnMap& map_;
  ProblemList& problems_;
  TextTable table_;
  TextLines found_;
  const std::vector<TextLine>& lines_{found_.lines};
  Cut cut_;
  const std::vector<HeadLine>& head_{cut_.lines};
  std::size_t narrowest_{0};  ///< required fields of a row; 0: all
  std::size_t row_begin_{0};
  std::optional<std::size_t> names_line_;  ///< index; nullopt: none
  std::optional<std::size_t> units_line_;  ///< a row of units below the names
  std::optional<std::size_t>
      unclear_line_;  ///< factors, or numbers below the names that are no row
  std::vector<std::string> names_;
  std::string_view header_text_;
  std::size_t remarks_{0};  ///< lines without a number among the rows
  std::string_view first_remark_;
};

}  // namespace

std::size_t TextTable::find(std::string_view header) const {
  const auto found = std::ranges::find(columns, header, &TextColumn::header);
  return static_cast<std::size_t>(found - columns.begin());
}

void TextTable::refuse_field(std::size_t row, std::size_t column, std::string rule) const {
  problems.add(lines[row], columns[column].header, columns[column].fields[row], std::move(rule));
}

void TextTable::refuse_column(std::size_t column, std::string rule) const {
  const std::string& header = columns[column].header;
  problems.add(header_line, unnamed(column), header.empty() ? "(empty)" : header, std::move(rule));
}

TextTable read_text_table(PlainTable plain, const ColumnMap& map, ProblemList& problems) {
  return TableReader(map, problems).read(std::move(plain));
}

}  // namespace thermocomp
