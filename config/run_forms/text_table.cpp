#include "config/run_forms/text_table.hpp"

#include <algorithm>
#include <map>

#include "config/run_forms/table_header.hpp"
#include "config/run_forms/text_lines.hpp"

namespace thermocomp {
namespace {

constexpr std::string_view separators = ";\t,|";
constexpr std::size_t rows_judged = 200;
constexpr std::size_t fields_max = 1024;  // as in our own form
constexpr double values_share_min = 0.2;

class TableReader {
 public:
  TableReader(const ColumnMap* map, int lines_above, ProblemList& problems)
      : map_(map), lines_above_(lines_above), problems_(problems) {}

  TextTable read(std::string text) {
    table_.text = std::move(text);
    // Heap-allocated, so that moving the table keeps pointers into it valid.
    table_.text.reserve(64);
    const int first_line = map_ == nullptr ? 0 : map_->header_line;
    TextLines found = find_lines(table_.text, lines_above_, first_line);
    lines_ = std::move(found.lines);
    last_comment_ = found.last_comment;
    given_separator_ = found.separator;
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
  /// The result of splitting all lines by one separator.
  struct Cut {
    char separator{','};
    std::size_t fields{1};
    std::size_t begin{0};  ///< first line with this number of fields
    double score{0.0};
    double values{0.0};  ///< share of fields that are numbers or times
  };

  [[nodiscard]] std::size_t judged() const { return std::min(lines_.size(), rows_judged); }

  [[nodiscard]] Cut cut_by(char separator) const {
    std::map<std::size_t, std::size_t> lines_of;
    std::vector<TableFields> cut(judged());
    for (std::size_t i = 0; i < cut.size(); ++i) {
      static_cast<void>(split_line(lines_[i].text, separator, cut[i]));
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
        const FieldKind kind = kind_of_field(field);
        if (kind != FieldKind::nothing) ++(kind == FieldKind::text ? texts : values);
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

  TableFields fields_of(std::size_t line) {
    TableFields fields;
    if (!split_line(lines_[line].text, table_.separator, fields)) fields.clear();
    fill_up(fields);
    return fields;
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
    const TableFields names = fields_of(line);
    if (names.size() != cut_.fields + 1 || !names.back().starts_with("Serial") ||
        !is_all_words(names) || fields_of(line + 1).size() != names.size())
      return;
    narrowest_ = cut_.fields;
    cut_.fields = names.size();
    cut_.begin = line;
  }

  bool find_header() {
    std::vector<TableFields> fields;
    for (std::size_t i = 0; i < judged(); ++i) fields.push_back(fields_of(i));
    const bool is_first = map_ != nullptr && map_->header_line > 0;
    header_ = find_table_header(fields, cut_.begin, cut_.fields, is_first);
    row_begin_ = header_.row_begin;
    const TextLine& first = lines_[row_begin_ < lines_.size() ? row_begin_ : 0];
    const bool has_given = map_ != nullptr && !map_->names.empty();
    if (cut_.fields > fields_max) {
      problems_.add(first.number, "columns", std::to_string(cut_.fields),
                    "must be at most " + std::to_string(fields_max));
    } else if (header_.unclear) {
      const TextLine& line = lines_[*header_.unclear];
      const std::string rule =
          header_.names ? "delete the line; where it holds factors also write \"T1\" = { name = "
                          "\"t1_degC\", unit = \"0.1 degC\" } under [columns]"
                        : "delete the line or, if it holds the names, write header_line = " +
                              std::to_string(line.number);
      problems_.add(line.number, "", line.text,
                    "is neither a row like those below nor names, units or numbers of channels: " +
                        rule + " in the file of --columns");
    } else if (header_.names && !(has_given && fields[*header_.names].size() != cut_.fields)) {
      if (header_.units)
        for (const std::string_view field : fields[*header_.units])
          table_.units.emplace_back(unit_in_row(field));
      return take_names(*header_.names) && names_are_clear();
    } else if (take_commented_names() || take_given_names()) {
      if (row_begin_ == 0 || is_all_words(fields[row_begin_ - 1])) return names_are_clear();
      problems_.add(lines_[row_begin_ - 1].number, "",
                    std::to_string(fields[row_begin_ - 1].size()) + " fields",
                    "must have " + std::to_string(cut_.fields) + ", as the rows below");
    }
    return false;
  }

  /// Whether the first column of the rows is a time, or counts them.
  bool begins_with_count_or_time() {
    std::optional<double> last;
    for (std::size_t i = row_begin_; i < judged(); ++i) {
      const TableFields fields = fields_of(i);
      if (fields.size() != cut_.fields) continue;
      if (kind_of_field(fields[0]) == FieldKind::time) return true;
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
    TableFields fields = fields_of(line);
    while (fields.size() > cut_.fields && fields.back().empty()) fields.pop_back();
    if (fields.size() + 1 == cut_.fields) {
      const TableFields row = fields_of(row_begin_);
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
    const std::size_t between = row_begin_ - line - 1 - (header_.units > line ? 1 : 0);
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
    TableFields fields;
    static_cast<void>(split_line(text, table_.separator, fields));
    if (fields.size() != cut_.fields) {
      static_cast<void>(split_line(trimmed(text.substr(1)), table_.separator, fields));
    } else {
      fields[0] = trimmed(fields[0].substr(1));
    }
    if (fields.size() != cut_.fields || !std::all_of(fields.begin(), fields.end(), [](auto field) {
          return kind_of_field(field) == FieldKind::text || field.empty();
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
    TableFields fields;
    const std::size_t rows = lines_.size() - std::min(row_begin_, lines_.size());
    table_.fields.reserve(rows * table_.columns());
    table_.lines.reserve(rows);
    for (std::size_t i = row_begin_; i < lines_.size() && !problems_.full(); ++i) {
      const TextLine& line = lines_[i];
      if (!header_text_.empty() && line.text == header_text_) continue;
      if (!split_line(line.text, table_.separator, fields)) {
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
  std::vector<TextLine> lines_;
  TextLine last_comment_;
  std::optional<char> given_separator_;
  Cut cut_;
  std::size_t narrowest_{0};  ///< required fields of a row; 0: all
  std::size_t row_begin_{0};
  TableHeader header_;
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

}  // namespace thermocomp
