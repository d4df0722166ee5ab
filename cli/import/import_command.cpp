#include "cli/import/import_command.hpp"

#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <CLI/CLI.hpp>

#include "cli/import/import_log.hpp"
#include "cli/import/joined_runs.hpp"
#include "config/runs/run_file.hpp"
#include "report/output_file.hpp"
#include "report/run_loader.hpp"

namespace thermocomp::cli {
namespace {

struct ImportOptions {
  std::string log;
  std::string join;
  std::optional<double> shift_s;
  std::string columns;
  std::string output;
  LogOptions of_log;
};

void tell(const std::string& name, const std::vector<std::string>& lines) {
  std::fprintf(stderr, "%s: read as follows\n", name.c_str());
  for (const std::string& line : lines) std::fprintf(stderr, "  %s\n", line.c_str());
}

void refuse_onto(const std::string& input, const std::string& output) {
  std::error_code error;
  if (output != "-" && std::filesystem::equivalent(input, output, error) && !error)
    throw Failure(output + ": is what is read; the output must be another file");
}

int run_import(const ImportOptions& options) {
  std::optional<ColumnMap> map;
  if (!options.columns.empty()) map = load_column_map(options.columns);
  for (const std::string& input : {options.log, options.join})
    if (!input.empty()) refuse_onto(input, options.output);
  if (options.shift_s && options.join.empty())
    throw Failure("--shift-s is the shift of the file of --join, which is missing");
  ImportedLog log = import_log(options.log, map ? &*map : nullptr, options.of_log);
  tell(log.run.name, log.run.understood);
  RunFile run;
  if (options.join.empty()) {
    run = std::move(log.run);
  } else {
    const ImportedLog second = import_log(options.join, map ? &*map : nullptr, {});
    tell(second.run.name, second.run.understood);
    run = joined_runs(log, second, options.shift_s);
    tell(options.output, run.understood);
  }
  OutputFile file(options.output);
  file.stream() << write_run(run);
  file.commit();
  std::fprintf(stderr, "%zu rows, %zu columns\n", run.rows(), run.columns.size());
  return exit_success;
}

}  // namespace

void add_import_command(CLI::App& app, Action& action) {
  const auto options = std::make_shared<ImportOptions>();
  CLI::App* sub = app.add_subcommand(
      "import",
      "any log as a run file: tables of PLCs and data loggers, LinuxCNC's halsampler, Moonraker's "
      "temperature store; what was understood is told line by line");
  sub->add_option("LOG", options->log, "the log")->type_name("FILE")->required();
  sub->add_option("--names", options->of_log.names,
                  "columns of a log without a header, as a run file calls them: z_mm,t1_degC")
      ->delimiter(',')
      ->type_name("NAME,NAME");
  sub->add_option("--period-s", options->of_log.period_s,
                  "seconds between two rows of a log without time")
      ->check(CLI::PositiveNumber)
      ->type_name("S");
  sub->add_option("--columns", options->columns, columns_help)->type_name("FILE");
  sub->add_option(
         "--join", options->join,
         "a second log of the same machine, by its own clock: temperatures there, probings "
         "here")
      ->type_name("FILE");
  sub->add_option("--shift-s", options->shift_s,
                  "what makes the second's time_s that of the first, where dates do not say it")
      ->type_name("S");
  sub->add_option("-o,--output", options->output, "run file; - is standard output")
      ->type_name("FILE")
      ->required();
  sub->footer("Exit status: 0 success, 2 bad use or bad input.");
  sub->callback([&action, options] { action = [options] { return run_import(*options); }; });
}

}  // namespace thermocomp::cli
