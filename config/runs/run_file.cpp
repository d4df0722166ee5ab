#include "config/runs/run_file.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <fcntl.h>
#include <set>
#include <spawn.h>
#include <unistd.h>

#include <sys/wait.h>

#include "config/run_forms/field_text.hpp"
#include "config/run_forms/foreign_run.hpp"
#include "config/run_forms/text_lines.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"

namespace thermocomp {
namespace {

constexpr std::size_t problems_max = 100;
/// The largest model has 512 inputs and 64 outputs; searches among columns take quadratic time.
constexpr std::size_t columns_max = 1024;

/// Parses a decimal number with so few digits that digits and power of ten are exact in a double:
/// their quotient equals the result of std::from_chars, in a third of the time.
/// @return number of characters; 0 if it is another kind of number, or not a number
std::size_t plain_number(std::string_view text, double& value) {
  constexpr std::array<double, 16> power_of_ten{1e0, 1e1, 1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                                1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15};
  const char* at = text.data();
  const char* const end = at + text.size();
  const bool negative = at != end && *at == '-';
  if (negative) ++at;
  std::uint64_t digits = 0;
  const auto take_digits = [&] {
    const char* const first = at;
    for (; at != end && *at >= '0' && *at <= '9'; ++at)
      digits = 10 * digits + static_cast<std::uint64_t>(*at - '0');
    return static_cast<std::size_t>(at - first);
  };
  const std::size_t whole = take_digits();
  std::size_t fraction = 0;
  if (at != end && *at == '.') {
    ++at;
    fraction = take_digits();
    if (fraction == 0) return 0;
  }
  if (whole == 0 || whole + fraction >= power_of_ten.size()) return 0;
  value = static_cast<double>(digits) / power_of_ten[fraction];
  if (negative) value = -value;
  return static_cast<std::size_t>(at - text.data());
}

class RunParser {
 public:
  RunParser(std::string_view text, const std::string& name) : rest_(text) { run_.name = name; }

  RunFile parse() {
    std::string_view line;
    while (next_line(line)) {
      if (run_.columns.empty()) {
        read_header(line);
        if (!problems_.empty()) break;  // rows cannot be checked
      } else if (!blank_to_the_end(line)) {
        if (take_plain_row(line))
          check_time();
        else
          read_row(line);
      }
      if (problems_.size() >= problems_max) break;
    }
    if (problems_.empty() && run_.columns.empty()) add(0, "", "", "has no header row");
    if (problems_.empty() && run_.rows() == 0) add(0, "", "", "has no row of data");
    if (!problems_.empty()) throw ConfigurationError(std::move(problems_));
    return std::move(run_);
  }

 private:
  void add(int line, std::string key, std::string_view value, std::string rule) {
    if (problems_.size() >= problems_max) return;  // checked here too, for rows of many columns
    constexpr std::size_t shown_max = 40;
    std::string shown(value.substr(0, shown_max));
    if (value.size() > shown_max) shown += " ...";
    problems_.push_back({run_.name, line, std::move(key), std::move(shown), std::move(rule)});
  }

  /// The next line that is not a comment. A reference before the first row changes nothing.
  bool next_line(std::string_view& line) {
    while (!rest_.empty()) {
      ++line_number_;
      line = take_line(rest_);
      if (!line.starts_with('#')) return true;
      const std::size_t row = run_.rows();
      std::vector<std::size_t>& references = run_.references;
      if (line.ends_with(reference_mark) && row > 0 &&
          (references.empty() || references.back() < row))
        references.push_back(row);
    }
    return false;
  }

  /// Empty lines are allowed at the end of the file only.
  [[nodiscard]] bool blank_to_the_end(std::string_view line) const {
    return trimmed(line).empty() && rest_.find_first_not_of(" \t\r\n") == std::string_view::npos &&
           run_.columns.size() > 1;
  }

  void read_header(std::string_view line) {
    const auto count = static_cast<std::size_t>(std::count(line.begin(), line.end(), ',')) + 1;
    if (count > columns_max) {
      add(line_number_, "", std::to_string(count) + " columns",
          "must be at most " + std::to_string(columns_max));
      return;
    }
    std::set<std::string> seen;
    std::string_view rest = line;
    std::string_view field;
    int position = 0;
    while (take(rest, ',', field)) {
      ++position;
      const std::string name(trimmed(field));
      const std::string where = "column " + std::to_string(position);
      if (name.find('"') != std::string::npos) {
        add(line_number_, where, name, "must not be quoted");
      } else if (!is_column_name(name)) {
        add(line_number_, where, name.empty() ? "(empty)" : name, std::string(column_name_rule));
      } else if (!seen.insert(name).second) {
        add(line_number_, where, name, "is listed twice");
      }
      run_.columns.push_back(name);
    }
    time_ = run_.find("time_s");
    if (!time_) add(line_number_, "time_s", "(missing)", "must be one of the columns");
    run_.values.resize(run_.columns.size());
    std::size_t rows = 1;
    for (auto at = rest_.find('\n'); at != std::string_view::npos; at = rest_.find('\n', at + 1))
      ++rows;
    for (auto& column : run_.values) column.reserve(rows);
    row_.resize(run_.columns.size());
  }

  /// Fast path for a row of plain decimal numbers.
  /// @return false if it is not, with the state unchanged
  bool take_plain_row(std::string_view line) {
    for (double& value : row_) {
      const std::size_t length = plain_number(line, value);
      if (length == 0) return false;
      const bool last = &value == &row_.back();
      if (last ? length < line.size() : length == line.size() || line[length] != ',') return false;
      line.remove_prefix(last ? length : length + 1);
    }
    for (std::size_t i = 0; i < row_.size(); ++i) run_.values[i].push_back(row_[i]);
    return true;
  }

  void read_row(std::string_view line) {
    const auto fields = static_cast<std::size_t>(std::count(line.begin(), line.end(), ',')) + 1;
    if (fields != run_.columns.size()) {
      add(line_number_, "", std::to_string(fields) + " fields",
          "must have " + std::to_string(run_.columns.size()) + ", as the header");
      return;
    }
    std::string_view rest = line;
    std::string_view field;
    for (std::size_t i = 0; i < run_.columns.size(); ++i) {
      static_cast<void>(take(rest, ',', field));
      run_.values[i].push_back(value_of(trimmed(field), run_.columns[i]));
    }
    check_time();
  }

  double value_of(std::string_view field, const std::string& column) {
    if (is_missing(field)) return std::numeric_limits<double>::quiet_NaN();
    if (const auto number = finite_number(field)) return *number;
    const bool has_quote = field.find('"') != std::string_view::npos;
    add(line_number_, column, field,
        has_quote ? "must not be quoted" : "must be a finite number, empty or nan");
    bad_time_ = bad_time_ || column == "time_s";
    return std::numeric_limits<double>::quiet_NaN();
  }

  void check_time() {
    const double time_s = run_.values[*time_].back();
    if (std::isnan(time_s)) {
      if (!bad_time_) add(line_number_, "time_s", "(missing)", "must not be missing");
      bad_time_ = false;
      return;
    }
    if (last_time_s_ && !(time_s > *last_time_s_)) {
      add(line_number_, "time_s", number_text(time_s),
          "must be greater than in the row before (" + number_text(*last_time_s_) + ")");
    }
    last_time_s_ = time_s;
  }

  std::string_view rest_;
  int line_number_{0};
  RunFile run_;
  std::vector<double> row_;
  std::optional<std::size_t> time_;
  std::optional<double> last_time_s_;
  bool bad_time_{false};  ///< reported already
  std::vector<Problem> problems_;
};

void select(RunFile& run, const RunSelection& selection) {
  const std::vector<double>& time_s = run.time_s();
  const auto row = [&](double time) {
    return static_cast<std::size_t>(std::lower_bound(time_s.begin(), time_s.end(), time) -
                                    time_s.begin());
  };
  run.selected_begin = row(selection.from_s);
  run.selected_end = row(selection.to_s);
  if (run.selected_begin >= run.selected_end) {
    throw ConfigurationError(
        {{run.name, 0, "selection",
          number_text(selection.from_s) + ":" + number_text(selection.to_s),
          "selects no row; the file has time_s from " + number_text(time_s.front()) + " to " +
              number_text(time_s.back())}});
  }
}

}  // namespace

RunSelection parse_selection(std::string_view argument) {
  RunSelection selection;
  const auto at = argument.rfind('@');
  const auto colon = argument.rfind(':');
  if (at == std::string_view::npos || colon == std::string_view::npos || colon < at) {
    selection.file = argument;
    if (argument.empty()) throw ConfigurationError({{"", 0, "file", "(empty)", "must be named"}});
    return selection;
  }
  selection.file = argument.substr(0, at);
  const auto refuse = [&](const std::string& rule) {
    throw ConfigurationError({{"", 0, "selection", std::string(argument), rule}});
  };
  if (selection.file.empty()) refuse("must be FILE@T0:T1, and the file is not named");
  const auto bound = [&](std::string_view text, double& value) {
    if (text.empty()) return;
    const auto number = finite_number(text);
    if (!number) refuse("must be FILE@T0:T1 with T0 and T1 numbers [s] or left out");
    value = number.value_or(value);
  };
  bound(argument.substr(at + 1, colon - at - 1), selection.from_s);
  bound(argument.substr(colon + 1), selection.to_s);
  if (!(selection.from_s < selection.to_s)) refuse("T0 must be below T1");
  return selection;
}

std::optional<std::size_t> RunFile::find(std::string_view column_name) const {
  const auto found = std::find(columns.begin(), columns.end(), column_name);
  if (found == columns.end()) return std::nullopt;
  return static_cast<std::size_t>(found - columns.begin());
}

namespace {

/// Whether there is a displacement other than offsets and applied offsets.
bool has_displacement(const std::vector<std::string>& columns) {
  return std::any_of(columns.begin(), columns.end(), [](const std::string& column) {
    return is_output(column) && !column.ends_with("_offset_um") && !column.ends_with("_applied_um");
  });
}

}  // namespace

const std::vector<double>& RunFile::column(std::string_view column_name) const {
  const auto index = find(column_name);
  if (!index) {
    std::string rule = "must be one of the columns";
    const auto stem = column_name.rfind('_');
    const std::string position = std::string(column_name.substr(0, stem)) + "_mm";
    if (is_output(column_name) && find(position))
      rule += "; there is " + position + ", a position, which --columns can make a displacement";
    else if (is_output(column_name) && !has_displacement(columns))
      rule =
          "this file has no measured displacement: report indicator readings with `thermocomp "
          "measured AXIS UM`, or add a column *_um";
    throw ConfigurationError({{this->name, 0, std::string(column_name), "(missing)", rule}});
  }
  return values[*index];
}

namespace {

/// The first line that is not a comment or empty.
std::string_view header_of(std::string_view text) {
  while (!text.empty()) {
    const std::string_view line = take_line(text);
    if (!line.starts_with('#') && !trimmed(line).empty()) return line;
  }
  return {};
}

bool names_a_column(const ColumnMap& map, std::string_view header) {
  std::string_view field;
  while (take(header, ',', field)) {
    const std::string name(trimmed(field));
    if (map.columns.contains(name) ||
        std::find(map.ignored.begin(), map.ignored.end(), name) != map.ignored.end() ||
        std::find(map.time.begin(), map.time.end(), name) != map.time.end())
      return true;
  }
  return false;
}

/// Converts the sheet of a workbook to CSV, with Debian's program for that.
std::string sheet_of(const std::filesystem::path& path) {
  const auto refuse = [&](const std::string& rule) {
    throw ConfigurationError({{path.string(), 0, "", "(Excel workbook)", rule}});
  };
  std::array<int, 2> ends{};
  if (::pipe2(ends.data(), O_CLOEXEC) != 0) refuse("cannot be read: no pipe");
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, ends[1], STDOUT_FILENO);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  std::string program = "xlsx2csv";
  std::string format = "--dateformat=%Y-%m-%d %H:%M:%S";
  std::string file = std::filesystem::absolute(path).string();
  std::array<char*, 4> arguments{program.data(), format.data(), file.data(), nullptr};
  pid_t child = 0;
  const int failed =
      ::posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  ::close(ends[1]);
  std::string text;
  std::array<char, 65536> part{};
  for (ssize_t size = 1; failed == 0 && size > 0 && text.size() <= run_bytes_max;) {
    size = ::read(ends[0], part.data(), part.size());
    if (size > 0) text.append(part.data(), static_cast<std::size_t>(size));
  }
  ::close(ends[0]);
  int status = 0;
  if (failed == 0) ::waitpid(child, &status, 0);
  if (failed != 0 || (WIFEXITED(status) && WEXITSTATUS(status) == 127))
    refuse(
        "is read by xlsx2csv, which is not installed: apt install xlsx2csv, or save the sheet "
        "as CSV");
  if (status != 0 || text.empty()) refuse("xlsx2csv cannot read it: save the sheet as CSV");
  return text;
}

}  // namespace

std::filesystem::path file_of(const RunFile& run) {
  return run.is_part ? parse_selection(run.name).file : std::filesystem::path(run.name);
}

std::vector<RunFile> between_references(const RunFile& run) {
  std::vector<std::size_t> bounds{0};
  for (const std::size_t row : run.references)
    if (row < run.rows()) bounds.push_back(row);
  if (bounds.size() == 1) return {run};
  bounds.push_back(run.rows());
  std::vector<RunFile> parts;
  for (std::size_t i = 0; i + 1 < bounds.size(); ++i) {
    const std::size_t begin = std::max(bounds[i], run.selected_begin);
    const std::size_t end = std::min(bounds[i + 1], run.selected_end);
    if (begin >= end) continue;
    RunFile& part = parts.emplace_back();
    part.columns = run.columns;
    part.understood = run.understood;
    part.wall_zero = run.wall_zero;
    for (const std::vector<double>& column : run.values)
      part.values.emplace_back(column.begin() + static_cast<std::ptrdiff_t>(bounds[i]),
                               column.begin() + static_cast<std::ptrdiff_t>(bounds[i + 1]));
    const std::vector<double>& time_s = run.time_s();
    const auto bound = [&](std::size_t row) {
      return row == 0 || row == run.rows() ? "" : number_text(time_s[row]);
    };
    part.name = part.argument = run.name + "@" + bound(bounds[i]) + ":" + bound(bounds[i + 1]);
    part.is_part = true;
    part.selected_begin = begin - bounds[i];
    part.selected_end = end - bounds[i];
  }
  return parts;
}

std::string selected_name(const RunFile& run) {
  if (run.selected_begin == 0 && run.selected_end == run.rows()) return run.name;
  const RunSelection whole = run.is_part ? parse_selection(run.name) : RunSelection{run.name};
  const std::vector<double>& time_s = run.time_s();
  const double from_s = run.selected_begin == 0 ? whole.from_s : time_s[run.selected_begin];
  const double to_s = run.selected_end == run.rows() ? whole.to_s : time_s[run.selected_end];
  const auto bound = [](double each_s) { return std::isfinite(each_s) ? number_text(each_s) : ""; };
  return whole.file.string() + "@" + bound(from_s) + ":" + bound(to_s);
}

RunFile parse_run(std::string_view text, const std::string& name, const RunSelection& selection,
                  const ColumnMap* map) {
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  const std::string_view header = header_of(text);
  const bool own =
      (is_own_form(header) && (map == nullptr || !names_a_column(*map, header))) || header.empty();
  RunFile run = own ? RunParser(text, name).parse() : read_foreign_run(text, name, map);
  if (own) run.wall_zero = stated_wall_zero(text.substr(0, text.find(header)));
  select(run, selection);
  return run;
}

RunFile load_run(const RunSelection& selection, const ColumnMap* map) {
  std::string text = read_text_file(selection.file, run_bytes_max);
  const bool is_sheet = is_workbook(text);
  if (is_sheet) text = sheet_of(selection.file);
  RunFile run = parse_run(text, selection.file.string(), selection, map);
  if (is_sheet) run.understood.emplace_back("an Excel workbook, by xlsx2csv");
  return run;
}

std::string write_run(const RunFile& run) {
  std::string text;
  for (std::size_t i = 0; i < run.columns.size(); ++i) {
    if (i > 0) text += ',';
    text += run.columns[i];
  }
  text += '\n';
  for (std::size_t row = 0; row < run.rows(); ++row) {
    if (std::binary_search(run.references.begin(), run.references.end(), row))
      text.append("# ").append(number_text(run.time_s()[row])).append(reference_mark) += '\n';
    for (std::size_t i = 0; i < run.columns.size(); ++i) {
      if (i > 0) text += ',';
      const double value = run.values[i][row];
      if (!std::isnan(value)) append_number(text, value);
    }
    text += '\n';
  }
  return text;
}

}  // namespace thermocomp
