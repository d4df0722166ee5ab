#include "config/runs/run_file.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fcntl.h>
#include <set>
#include <spawn.h>
#include <unistd.h>

#include <sys/wait.h>

#include "config/run_forms/column_map.hpp"
#include "config/run_forms/field_text.hpp"
#include "config/run_forms/foreign_run.hpp"
#include "config/run_forms/text_lines.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/units.hpp"
#include "config/toml/toml_reader.hpp"
#include "estimator/types.hpp"

namespace thermocomp {
namespace {

/// The largest model has 512 inputs and 64 outputs; searches among columns take quadratic time.
constexpr std::size_t columns_max = 1024;

class RunParser {
 public:
  RunParser(std::string_view text, const std::string& name) : rest_(text), problems_(name) {
    run_.name = name;
  }

  RunFile parse() {
    std::string_view line;
    while (!problems_.full() && next_line(line)) {
      if (!run_.columns.empty()) {
        if (!blank_to_the_end(line)) read_row(line);
        continue;
      }
      read_header(line);
      problems_.throw_any();  // rows cannot be checked
    }
    if (run_.columns.empty()) problems_.add(0, "", "", "has no header row");
    if (problems_.empty() && run_.rows() == 0) problems_.add(0, "", "", "has no row of data");
    problems_.throw_any();
    return std::move(run_);
  }

 private:
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

  static std::size_t fields_in(std::string_view line) {
    return static_cast<std::size_t>(std::ranges::count(line, ',')) + 1;
  }

  void read_header(std::string_view line) {
    if (const std::size_t count = fields_in(line); count > columns_max) {
      problems_.add(line_number_, "", std::to_string(count) + " columns",
                    "must be at most " + std::to_string(columns_max));
      return;
    }
    std::set<std::string> seen;
    std::string_view field;
    while (take(line, ',', field)) {
      const std::string& name = run_.columns.emplace_back(trimmed(field));
      const auto refuse = [&](std::string_view rule) {
        problems_.add(line_number_, unnamed(run_.columns.size() - 1),
                      name.empty() ? "(empty)" : name, std::string(rule));
      };
      if (name.find('"') != std::string::npos)
        refuse("must not be quoted");
      else if (!is_column_name(name))
        refuse(column_name_rule);
      else if (!seen.insert(name).second)
        refuse("is listed twice");
    }
    time_ = run_.find("time_s");
    if (!time_) problems_.add(line_number_, "time_s", "(missing)", "must be one of the columns");
    run_.values.resize(run_.columns.size());
    const auto rows = static_cast<std::size_t>(std::ranges::count(rest_, '\n')) + 1;
    for (auto& column : run_.values) column.reserve(rows);
  }

  void read_row(std::string_view line) {
    if (const std::size_t count = fields_in(line); count != run_.columns.size()) {
      problems_.add(line_number_, "", std::to_string(count) + " fields",
                    "must have " + std::to_string(run_.columns.size()) + ", as the header");
      return;
    }
    bool has_time = false;
    for (std::size_t i = 0; i < run_.columns.size(); ++i) {
      std::string_view field;
      static_cast<void>(take(line, ',', field));
      field = trimmed(field);
      run_.values[i].push_back(value_of(field, run_.columns[i]));
      if (i == time_) has_time = !is_missing(field);
    }
    if (!has_time) problems_.add(line_number_, "time_s", "(missing)", "must not be missing");
    const double time_s = run_.values[*time_].back();
    if (time_s <= last_time_s_)
      problems_.add(line_number_, "time_s", number_text(time_s),
                    "must be greater than in the row before (" + number_text(last_time_s_) + ")");
    if (std::isfinite(time_s)) last_time_s_ = time_s;
  }

  /// NaN for a missing value, and after a problem.
  double value_of(std::string_view field, const std::string& column) {
    if (is_missing(field)) return not_a_number;
    if (const auto number = finite_number(field)) return *number;
    const bool has_quote = field.find('"') != std::string_view::npos;
    problems_.add(line_number_, column, field,
                  has_quote ? "must not be quoted" : "must be a finite number, empty or nan");
    return not_a_number;
  }

  std::string_view rest_;
  int line_number_{0};
  RunFile run_;
  std::optional<std::size_t> time_;
  double last_time_s_{-std::numeric_limits<double>::infinity()};
  ProblemList problems_;
};

void select(RunFile& run, const RunSelection& selection) {
  const std::vector<double>& time_s = run.time_s();
  const auto row = [&](double time) {
    return static_cast<std::size_t>(std::ranges::lower_bound(time_s, time) - time_s.begin());
  };
  run.selected_begin = row(selection.from_s);
  run.selected_end = row(selection.to_s);
  if (run.selected_begin < run.selected_end) return;
  throw ConfigurationError(
      {{run.name, 0, "selection", number_text(selection.from_s) + ":" + number_text(selection.to_s),
        "selects no row; the file has time_s from " + number_text(time_s.front()) + " to " +
            number_text(time_s.back())}});
}

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
  for (const std::string& column : run.columns) text.append(text.empty() ? "" : ",").append(column);
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
