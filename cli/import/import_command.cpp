#include <algorithm>
#include <cmath>
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "cli/commands.hpp"
#include "cli/import/import_runs.hpp"
#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"
#include "report/files.hpp"

namespace thermocomp::cli {
namespace {

struct ImportOptions {
  std::string log;
  std::string join;
  std::optional<double> shift_s;
  std::string columns;
  std::string output;
  std::vector<std::string> names;
  std::optional<double> period_s;
  std::string corrections;
};

void print_lines(const std::string& name, const std::vector<std::string>& lines) {
  std::fprintf(stderr, "%s: read as follows\n", name.c_str());
  for (const std::string& line : lines) std::fprintf(stderr, "  %s\n", line.c_str());
}

/// Converts seconds since 1970 to seconds since the first row, since selections would be long.
void count_from_first_row(RunFile& run) {
  constexpr double since_1970_s_min = 1e9;
  std::vector<double>& time_s = run.values[*run.find("time_s")];
  const double first_s = time_s.front();
  if (!(first_s >= since_1970_s_min)) return;
  for (double& value : time_s) value = std::round((value - first_s) * 1e6) / 1e6;
  run.wall_zero = WallZero{first_s, true};
  run.understood.push_back("time_s: seconds since 1970, now after the first row");
}

RunFile read_log(const std::string& file, const ColumnMap& map) {
  RunFile run = load_run({file}, &map);
  if (run.understood.empty()) {
    run.understood.emplace_back("a run file already");
    if (run.wall_zero) run.understood.emplace_back("a comment gives the wall time of time_s = 0");
    count_from_first_row(run);
  }
  print_lines(run.name, run.understood);
  return run;
}

/// Refuses a column of the map that neither of two files has.
void check_mapped(const ColumnMap& map, const std::vector<RunFile>& runs) {
  std::vector<std::string> headers = map.ignored;
  for (const auto& [header, column] : map.columns) headers.push_back(header);
  const auto is_read = [&](const RunFile& run, const std::string& header) {
    return std::ranges::any_of(run.understood, [&](const std::string& line) {
      return line.starts_with("'" + header + "'");
    });
  };
  for (const std::string& header : headers)
    if (!header.empty() &&
        std::ranges::none_of(runs, [&](const RunFile& run) { return is_read(run, header); }))
      throw ConfigurationError(
          {Problem{map.file, 0, "columns", header,
                   "is a column neither of " + runs[0].name + " nor of " + runs[1].name}});
}

int run_import(const ImportOptions& options) {
  ColumnMap map;
  if (!options.columns.empty()) map = load_column_map(options.columns);
  map.takes_signals = true;
  map.is_of_several = !options.join.empty();
  if (!options.names.empty()) map.names = options.names;
  if (options.period_s) map.period_s = options.period_s;
  if (options.shift_s && options.join.empty())
    throw Failure("--shift-s is the shift of the file of --join, which is missing");
  RunFile run = read_log(options.log, map);
  const auto convert = [&](RunFile& corrections) {
    corrections.understood.clear();
    corrections = displacements_of(std::move(corrections), options.corrections == "steps"
                                                               ? CorrectionEntry::step
                                                               : CorrectionEntry::total);
    print_lines(options.output, corrections.understood);
  };
  const bool has_corrections = !options.corrections.empty();
  if (options.join.empty()) {
    if (has_corrections) convert(run);
  } else {
    ColumnMap of_second = map;
    of_second.names.clear();
    of_second.period_s.reset();
    RunFile second = read_log(options.join, of_second);
    check_mapped(map, {run, second});
    if (has_corrections && has_axes(run) && has_axes(second))
      throw Failure(
          "--corrections is of one file, and both have columns named like axes: give "
          "those that are no corrections other names in the file of --columns");
    if (has_corrections) convert(has_axes(second) ? second : run);
    run = joined_runs(run, second, options.shift_s);
    print_lines(options.output, run.understood);
  }
  OutputFile file(options.output);
  if (run.wall_zero) file.stream() << wall_zero_comment(*run.wall_zero);
  file.stream() << write_run(run);
  file.commit();
  std::fprintf(stderr, "%zu rows, %zu columns\n", run.rows(), run.columns.size());
  return exit_success;
}

}  // namespace

void add_import_command(CLI::App& app, Action& action) {
  const auto options = std::make_shared<ImportOptions>();
  CLI::App* sub =
      app.add_subcommand("import",
                         "converts any log to a run file: tables of PLCs, loggers and databases, "
                         "JSON, workbooks, LinuxCNC's "
                         "halsampler and halscope; the interpretation is printed line by line");
  sub->add_option("LOG", options->log, "the log")->type_name("FILE")->required();
  sub->add_option("--names", options->names,
                  "columns of a log without a header, as a run file calls them: z_mm,t1_degC")
      ->delimiter(',')
      ->type_name("NAME,NAME");
  sub->add_option("--period-s", options->period_s, "seconds between two rows of a log without time")
      ->check(CLI::PositiveNumber)
      ->type_name("S");
  sub->add_option("--columns", options->columns, columns_help)->type_name("FILE");
  sub->add_option("--join", options->join,
                  "a second log of the same machine with its own clock, such as probings")
      ->type_name("FILE");
  sub->add_option(
         "--corrections", options->corrections,
         "the log is of corrections that operators entered: steps (each is added) or totals "
         "(each replaces the one before); they become displacements of the other sign")
      ->check(CLI::IsMember({"steps", "totals"}))
      ->type_name("HOW");
  sub->add_option("--shift-s", options->shift_s,
                  "seconds to add to the second's time_s, if neither dates nor columns that change "
                  "alike give the shift")
      ->type_name("S");
  sub->add_option("-o,--output", options->output, "run file; - is standard output")
      ->type_name("FILE")
      ->required();
  sub->footer("Exit status: 0 success, 2 usage error or bad input.");
  sub->callback([&action, options] { action = [options] { return run_import(*options); }; });
}

}  // namespace thermocomp::cli
