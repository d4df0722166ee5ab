#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "modelling/command_line.hpp"
#include "modelling/inspection/inspection.hpp"
#include "modelling/series/series.hpp"
#include "report/files.hpp"
#include "report/terminal.hpp"

namespace thermocomp::inspection {
namespace {

constexpr double likelier_than_not = 0.5;

struct Options {
  std::vector<std::string> runs;
  std::string columns;
  std::string json;
  std::string report;
  bool all{false};
  std::string series;
};

std::vector<series::Comparison> beside_sisters(const Options& options,
                                               const std::vector<RunFile>& runs) {
  const series::Series series = series::load_series(options.series);
  std::vector<std::string> outputs;
  for (const auto& [name, output] : series.outputs) outputs.push_back(name);
  std::vector<std::string> notes;
  return series::compared(
      series, series::statistics_of(runs, "the machine", outputs, series.columns.taus_s, notes));
}

int run(const Options& options) {
  const std::vector<RunFile> runs = cli::RunLoader(options.columns).load(options.runs);
  Inspection inspection;
  {
    cli::Progress progress("inspecting");
    inspection = inspect(runs, options.all ? 0.0 : likelier_than_not,
                         [&progress](double fraction) { progress.update(fraction); });
  }
  std::vector<series::Comparison> sisters;
  if (!options.series.empty()) sisters = beside_sisters(options, runs);
  if (!options.json.empty())
    cli::write_file(options.json, inspection_json(inspection, series::comparison_json(sisters)));
  if (!options.report.empty()) cli::write_file(options.report, inspection_html(runs, inspection));
  if (options.json != "-" && options.report != "-")
    cli::write_file("-", inspection_text(inspection) + series::comparison_text(sisters));
  if (std::any_of(sisters.begin(), sisters.end(), series::departs)) return 1;
  for (const Finding& finding : inspection.findings)
    if (finding.probability >= likelier_than_not) return 1;
  return 0;
}

}  // namespace

void add_inspect_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub =
      app.add_subcommand("inspect", "faults of recordings, and the effects that they can show");
  sub->add_option("RUN.csv", options->runs, "runs: RUN.csv[@T0:T1]")->required();
  sub->add_option("--columns", options->columns, cli::columns_help);
  sub->add_option("--json", options->json, "file for the answer as JSON; - is the output");
  sub->add_option("--report", options->report, "page with pictures (HTML); - is the output");
  sub->add_flag("--all", options->all, "also list findings below 50 %");
  sub->add_option("--series", options->series,
                  "series file: also compare the machine with its sisters");
  sub->footer(
      "Exit status: 0 nothing found, 1 a fault or a departure, 2 usage error or bad input.");
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::inspection
