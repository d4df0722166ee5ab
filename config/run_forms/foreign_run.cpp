#include "config/run_forms/foreign_run.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "config/run_forms/column_meanings.hpp"
#include "config/run_forms/column_roles.hpp"
#include "config/run_forms/log_form.hpp"
#include "config/run_forms/long_table.hpp"
#include "config/run_forms/number_form.hpp"
#include "config/run_forms/row_order.hpp"
#include "config/run_forms/run_text.hpp"
#include "config/run_forms/spelled_unit.hpp"
#include "config/run_forms/text_table.hpp"
#include "config/run_forms/time_column.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {
namespace {

/// Usual words for a missing value, in lower case.
constexpr auto missing_words = std::to_array<std::string_view>(
    {"na",       "n/a",         "#n/a",    "#nv",   "null",         "none",     "-",
     "--",       "---",         "----",    "-.-",   "--.-",         "*",        "***",
     "inf",      "+inf",        "-inf",    "ol",    "open",         "overflow", "overload",
     "burnout",  "unavailable", "unknown", "error", "no data",      "bad",      "invalid",
     "#div/0!",  "#value!",     "undef",   "n.a.",  "disconnected", "over",     "under",
     "no value", "nodata",      "logged",  "nan"});

/// Outside, a temperature is a sign of a fault, such as -9999.
constexpr double degC_min = -273.15;
constexpr double degC_max = 2500.0;

std::optional<double> switch_word(std::string_view field) {
  for (const std::string_view on : {"on", "ON", "On", "true", "TRUE", "True"})
    if (field == on) return 1.0;
  for (const std::string_view off : {"off", "OFF", "Off", "false", "FALSE", "False"})
    if (field == off) return 0.0;
  return std::nullopt;
}

class ForeignReader {
 public:
  ForeignReader(std::string_view text, const std::string& name, const ColumnMap* map)
      : problems_(name), map_(map) {
    run_.name = name;
    RunText read = run_text(text, name);
    from_latin1_ = read.from_latin1;
    run_.wall_zero = stated_wall_zero(read.text);
    auto plain = plain_table(read.text, name, map);
    if (plain && !run_.wall_zero) run_.wall_zero = stated_wall_zero(plain->text);
    has_own_names_ = plain && plain->has_own_names;
    ColumnMap without_names;
    if (has_own_names_ && map != nullptr) {
      without_names = *map;  // already used by the form
      without_names.names.clear();
    }
    table_ = read_text_table(std::move(plain ? plain->text : read.text),
                             has_own_names_ && map != nullptr ? &without_names : map,
                             plain ? plain->lines_above : 0, problems_);
    if (plain) run_.understood = std::move(plain->notes);
  }

  RunFile read() {
    problems_.throw_any();
    leave_empty_columns_out();
    read_units();
    form_ = number_form(table_, map_, problems_);
    problems_.throw_any();
    note_layout();
    const auto found = find_time(table_, map_, units_, form_, problems_);
    problems_.throw_any();
    TimeColumns time = *found;
    if (map_ != nullptr && map_->period_s && !time.columns.empty() && !has_own_names_)
      problems_.add({map_->file, 0, "period_s", number_text(*map_->period_s),
                     "is for a table without time; in " + run_.name + " '" +
                         table_.header[time.columns[0]] + "' is the time"});
    problems_.throw_any();
    RunTime run_time = read_time(table_, time, map_, units_, form_, problems_);
    problems_.throw_any();
    run_.understood.push_back(run_time.note);
    if (run_time.wall_zero) run_.wall_zero = run_time.wall_zero;
    order_rows(time, run_time.time_s);
    problems_.throw_any();
    run_.columns.emplace_back("time_s");
    run_.values.push_back(std::move(run_time.time_s));
    find_meanings(time);
    problems_.throw_any();
    for (const ColumnMeaning& meaning : meanings_) read_values(meaning);
    ask_for_words();
    problems_.throw_any();
    if (missing_ > 0)
      run_.understood.push_back("missing: " + std::to_string(missing_) + " fields like '" +
                                missing_as_ + "'");
    return std::move(run_);
  }

 private:
  /// A separator at the end of every line does not make a column.
  void leave_empty_columns_out() {
    std::vector<bool> left_out(table_.columns());
    for (std::size_t i = 0; i < table_.columns(); ++i) {
      left_out[i] = is_unnamed(table_.header[i]);
      for (std::size_t row = 0; row < table_.rows() && left_out[i]; ++row)
        left_out[i] = table_.field(row, i).empty();
    }
    table_.leave_out(left_out);
  }

  /// Reads units from the header, the row of units, or the cells.
  void read_units() {
    units_.clear();
    for (std::size_t i = 0; i < table_.columns(); ++i) {
      units_.push_back(spelled_name(table_.header[i]).unit);
      if (units_[i].empty() && !table_.units.empty()) units_[i] = table_.units[i];
      if (units_[i].empty()) units_[i] = unit_of_cells(i);
    }
  }

  /// The first unit of a column's cells, if each number has one: in "80.6 A" below 20.5 the A may
  /// be a flag.
  [[nodiscard]] std::string_view unit_of_cells(std::size_t column) const {
    std::string_view first;
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string_view field = table_.field(row, column);
      const SpelledUnit* unit = number_text_of(field).unit;
      if (unit == nullptr && looks_like_number(field)) return {};
      if (first.empty() && unit != nullptr) first = unit->spelling;
    }
    return first;
  }

  /// Pivots a long table, and refuses a time that does not increase.
  void order_rows(TimeColumns& time, std::vector<double>& time_s) {
    if (const auto form = long_form(table_, time, time_s, map_, problems_)) {
      const double scan_s = map_ == nullptr ? 0.0 : map_->scan_s;
      run_.understood.push_back(pivot(table_, time, time_s, *form, scan_s, problems_));
      if (!problems_.empty()) return;
      const double first = time_s.front();  // the earliest, which is 0
      if (first < 0)
        for (double& at : time_s) at -= first;
      if (run_.wall_zero && first < 0) run_.wall_zero->seconds += first;
      time = {};
      read_units();
    } else {
      join_units(table_, map_);
      read_units();
      std::string note = leave_bad_values_out(table_, time, map_);
      if (!note.empty()) run_.understood.push_back(std::move(note));
    }
    order_in_time(table_, time_s, run_);
    const auto at = std::adjacent_find(time_s.begin(), time_s.end(),
                                       [](double a, double b) { return !(b > a); });
    if (at == time_s.end()) return;
    const auto row = static_cast<std::size_t>(at - time_s.begin()) + 1;
    const std::size_t column = time.columns.empty() ? 0 : time.columns.back();
    std::string rule = "must be later than in line " + std::to_string(table_.lines[row - 1]) +
                       " (" + shortened(table_.field(row - 1, column)) + "): ";
    if (has_text(row, time))
      rule +=
          "for one row per value write pivot = \"the column that names the series\" in the "
          "file of --columns";
    else if (time_s[row] == time_s[row - 1])
      rule += "delete one of the two lines, or write the time with its fraction of a second";
    else if (row == 1 && table_.lines[0] < table_.lines[1])
      rule += "delete line " + std::to_string(table_.lines[0]) +
              " if it belongs to the header, or put the rows in the order of time";
    else
      rule +=
          "put the rows in the order of time; where the clock was set, delete the lines before "
          "or after it";
    problems_.add(table_.lines[row], table_.header[column], table_.field(row, column), rule);
  }

  /// Whether a column could name the series of a row's value.
  [[nodiscard]] bool has_text(std::size_t row, const TimeColumns& time) const {
    for (std::size_t i = 0; i < table_.columns(); ++i)
      if (!time.has(i) && is_text(i) && !table_.field(row, i).empty()) return true;
    return false;
  }

  void note_layout() {
    std::string note = "separator '" + separator_name(table_.separator) + "', decimal " +
                       (form_.decimal == ',' ? "comma" : "point");
    if (form_.thousands != '\0') note += std::string(", thousands '") + form_.thousands + "'";
    if (from_latin1_) note += ", letters Latin-1";
    if (!table_.units.empty()) note += ", units in a row of their own";
    if (!table_.has_header) note += ", no header";
    run_.understood.push_back(note);
    run_.understood.insert(run_.understood.end(), table_.notes.begin(), table_.notes.end());
  }

  /// Whether the column has no number at all: it cannot be a value and is left out.
  [[nodiscard]] bool is_text(std::size_t column) const {
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string_view field = table_.field(row, column);
      if (looks_like_number(field) || switch_word(field)) return false;
    }
    return true;
  }

  /// "3 K rpm", "4.5 K rpm": numbers with a unit that is not known.
  [[nodiscard]] bool begins_with_numbers(std::size_t column) const {
    bool is_filled = false;
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string_view field = table_.field(row, column);
      if (field.empty()) continue;
      if (!finite_number(field.substr(0, field.find(' ')))) return false;
      is_filled = true;
    }
    return is_filled;
  }

  /// Whether the column numbers the rows, 0 1 2 or 1 2 3.
  [[nodiscard]] bool counts_rows(std::size_t column) const {
    const auto first = finite_number(table_.field(0, column));
    if (!first || (*first != 0.0 && *first != 1.0)) return false;
    for (std::size_t row = 1; row < table_.rows(); ++row)
      if (finite_number(table_.field(row, column)) != *first + static_cast<double>(row))
        return false;
    return table_.rows() > 1;
  }

  /// Why an unmapped column is not a value; empty: it is one.
  [[nodiscard]] std::string no_value(std::size_t i) const {
    const std::string& header = table_.header[i];
    if (is_mapped(header)) return {};
    const bool is_count = is_unnamed(header) || header == "#" || header == "RECORD" ||
                          header == "No." || header == "Nr." || header == "index" ||
                          (units_[i].empty() && !has_own_unit(header) && table_.rows() >= 10);
    if (is_count && (counts_rows(i) || header == "RECORD")) return "it counts the rows";
    const SpelledUnit* unit = spelled_unit(units_[i]);
    if (unit != nullptr && unit->dimension == "time") return "another time";
    if (!bad_rows(table_, i).empty()) return "it is the quality of values";
    const bool is_left_out =
        unit == nullptr && is_text(i) && !has_own_unit(header) && !begins_with_numbers(i);
    return is_left_out ? "no field of it is a number" : "";
  }

  [[nodiscard]] bool is_mapped(const std::string& header) const {
    return map_ != nullptr && map_->columns.contains(header);
  }

  void find_meanings(const TimeColumns& time) {
    check_map();
    ColumnMeanings meanings(table_, map_, units_, has_own_names_, problems_, run_.understood);
    std::set<std::string> seen{"time_s"};
    for (std::size_t i = 0; i < table_.columns(); ++i) {
      const std::string& header = table_.header[i];
      if (time.has(i)) continue;
      if (map_ != nullptr && map_->ignores(header)) {
        run_.understood.push_back("'" + header + "' left out");
        continue;
      }
      if (const std::string why = no_value(i); !why.empty()) {
        run_.understood.push_back("'" + header + "' left out: " + why);
        continue;
      }
      if (const std::string why = is_mapped(header) ? "" : unclear_role(table_, i); !why.empty()) {
        refuse_column(table_, i, why, problems_);
        continue;
      }
      auto meaning = meanings.of(i);
      if (!meaning) continue;
      if (!is_mapped(header)) number_name(*meaning, seen);
      if (!seen.insert(meaning->name).second) {
        refuse_column(table_, i,
                      "becomes " + meaning->name + ", which appears twice: write " +
                          toml_text(header) +
                          " = \"another name\" under [columns] in the file of --columns",
                      problems_);
        continue;
      }
      meanings.note(*meaning);
      run_.columns.push_back(meaning->name);
      meanings_.push_back(*meaning);
    }
    if (meanings_.empty() && problems_.empty())
      problems_.add(0, "", "", "has no column of numbers besides the time");
  }

  /// Numbers columns of equal names: Temp_degC, Temp_2_degC.
  static void number_name(ColumnMeaning& meaning, const std::set<std::string>& seen) {
    const std::string suffix(unit_of(meaning.name).suffix);
    const std::string base = meaning.name.substr(0, meaning.name.size() - suffix.size());
    for (int i = 2; seen.contains(meaning.name); ++i)
      meaning.name = base + "_" + std::to_string(i) + suffix;
  }

  void check_map() {
    if (map_ == nullptr) return;
    const auto check = [&](const std::string& key, const std::string& header) {
      const auto count = std::count(table_.header.begin(), table_.header.end(), header);
      if (count == 1) return;
      std::string rule = count > 1 ? "appears twice in " : "is not a column of ";
      rule += run_.name;
      std::string near = nearest_name(header, table_.header);
      for (const std::string& each : table_.header)
        if (spelled_name(each).base == header) near = each;  // equal except for the unit
      if (count == 0 && !near.empty()) rule += "; '" + near + "' is";
      problems_.add({map_->file, 0, key, header, rule});
    };
    for (const auto& [header, column] : map_->columns) check("columns", header);
    for (const std::string& header : map_->ignored)
      if (!header.empty()) check("ignore", header);
  }

  void read_values(const ColumnMeaning& meaning) {
    const bool is_switch = unit_of(meaning.name).suffix == "_on";
    const bool is_degC = unit_of(meaning.name).suffix == "_degC";
    std::vector<double> values;
    values.reserve(table_.rows());
    for (std::size_t row = 0; row < table_.rows(); ++row) {
      const std::string_view field = table_.field(row, meaning.source);
      const NumberText parts = number_text_of(field);
      std::optional<double> number = number_of(parts.digits, form_);
      const bool missing = takes_as_missing(field, number);
      if (missing) number.reset();
      if (number && parts.unit != nullptr)
        number = in_unit_of_column(meaning, *number, *parts.unit);
      if (!number && is_switch) number = switch_word(field);
      if (!number && !missing) ask_for_word(row, meaning);
      double value = number.value_or(std::numeric_limits<double>::quiet_NaN());
      if (!meaning.conversion.is_identity())
        value = meaning.conversion.factor * value + meaning.conversion.offset;
      if (std::isinf(value)) value = std::numeric_limits<double>::quiet_NaN();
      if (is_degC && (value < degC_min || value > degC_max)) {
        is_impossible_ = is_impossible_ || words_.empty();
        ask_for_word(row, meaning);
      }
      values.push_back(value);
    }
    run_.values.push_back(std::move(values));
  }

  /// Converts a cell in another unit than its column: 850 mA among A.
  std::optional<double> in_unit_of_column(const ColumnMeaning& meaning, double number,
                                          const SpelledUnit& unit) const {
    const SpelledUnit* of_column = spelled_unit(units_[meaning.source]);
    if (of_column == nullptr || of_column->dimension != unit.dimension) return std::nullopt;
    if (of_column->factor == unit.factor && of_column->offset == unit.offset) return number;
    return (unit.factor * number + unit.offset - of_column->offset) / of_column->factor;
  }

  void ask_for_word(std::size_t row, const ColumnMeaning& meaning) {
    const std::string word(table_.field(row, meaning.source));
    if (words_.empty()) word_at_ = {table_.lines[row], table_.header[meaning.source], word};
    words_.insert(word);
  }

  /// One problem for all words that are not numbers, and for impossible temperatures.
  void ask_for_words() {
    if (words_.empty()) return;
    constexpr std::size_t words_max = 5;
    std::string list;
    std::size_t count = 0;
    for (const std::string& word : words_)
      if (count++ < words_max) list += (list.empty() ? "" : ", ") + toml_text(shortened(word));
    const auto& [line, header, first] = word_at_;
    if (switch_word(first)) {
      problems_.add(line, header, first,
                    "is a switch: write " + toml_text(header) + " = " +
                        toml_text(plain_name(spelled_name(header).base) + "_on") +
                        " under [columns] in the file of --columns");
      return;
    }
    problems_.add(line, header, first,
                  (is_impossible_ ? "must be between -273.15 and 2500 degC"
                                  : "must be a number with a decimal " +
                                        std::string(form_.decimal == ',' ? "comma" : "point")) +
                      ", or empty: if it means a missing value, write missing = [" + list +
                      (count > words_max ? ", ..." : "") + "], to leave the column out ignore = [" +
                      toml_text(header) + "] in the file of --columns");
  }

  /// Words, what the map lists, and the infinity of SCPI instruments, 9.9E37.
  bool takes_as_missing(std::string_view field, const std::optional<double>& number) {
    constexpr double overload_min = 1e37;
    if (is_missing(field)) return true;
    const bool is_word = is_one_of(missing_words, field);
    const bool is_listed = map_ != nullptr && std::find(map_->missing.begin(), map_->missing.end(),
                                                        field) != map_->missing.end();
    const bool is_overload = number && std::abs(*number) >= overload_min;
    if (!is_word && !is_listed && !is_overload) return false;
    if (missing_++ == 0) missing_as_ = field;
    return true;
  }

  ProblemList problems_;
  const ColumnMap* map_;
  TextTable table_;
  RunFile run_;
  std::vector<std::string> units_;  ///< as written, by column
  bool from_latin1_{false};
  bool has_own_names_{false};
  std::set<std::string> words_;  ///< neither numbers nor known words for missing values
  std::tuple<int, std::string, std::string> word_at_;  ///< line, column and word of the first
  bool is_impossible_{false};  ///< the first of them is a number, but no temperature
  NumberForm form_;
  std::vector<ColumnMeaning> meanings_;
  std::size_t missing_{0};
  std::string missing_as_;
};

}  // namespace

bool is_own_form(std::string_view header) {
  bool has_time = false;
  std::string_view field;
  while (take(header, ',', field)) {
    field = trimmed(field);
    has_time = has_time || field == "time_s";
    if (spelled_name(field).known != nullptr) return false;
  }
  return has_time;
}

RunFile read_foreign_run(std::string_view text, const std::string& name, const ColumnMap* map) {
  return ForeignReader(text, name, map).read();
}

}  // namespace thermocomp
