#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "modelling/command_line.hpp"
#include "modelling/identification/printed.hpp"
#include "modelling/series/series.hpp"
#include "report/files.hpp"

namespace thermocomp::series {
namespace {

using identification::printed;

struct Options {
  std::vector<std::string> files;
  std::string columns;
  std::vector<std::string> outputs;
  std::optional<double> scatter;
  std::string machine;
  std::string prior;
  double drift_percent{5.0};
  std::string result;
};

/// CSV files of a folder, sorted by name.
std::vector<std::string> runs_in(const std::filesystem::path& folder) {
  std::vector<std::string> runs;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    if (entry.path().extension() == ".csv") runs.push_back(entry.path().string());
  if (runs.empty()) throw std::runtime_error(folder.string() + ": has no run file (*.csv)");
  std::sort(runs.begin(), runs.end());
  return runs;
}

Statistics of_runs(const Options& options, cli::RunLoader& loader,
                   const std::vector<std::string>& runs, const std::string& machine) {
  std::vector<std::string> notes;
  Statistics statistics =
      statistics_of(loader.load(runs), machine, options.outputs, series_taus_s, notes);
  for (const std::string& note : notes) std::fprintf(stderr, "%s\n", note.c_str());
  return statistics;
}

Statistics of_argument(const Options& options, cli::RunLoader& loader, const std::string& file) {
  const std::filesystem::path path(file);
  if (path.extension() == ".toml") return load_statistics(path);
  if (std::filesystem::is_directory(path)) return of_runs(options, loader, runs_in(path), file);
  return of_runs(options, loader, {file}, file);
}

std::string text_of(const Series& series) {
  std::string text = printed("%zu machines, %.3g h, %zu columns\n", series.machines.size(),
                             series.hours, static_cast<std::size_t>(series.columns.size()));
  for (const auto& [name, output] : series.outputs) {
    const double scatter_um = std::sqrt((output.covariance * series.moment).trace());
    text += name + printed(
                       ": displacement %.3g um RMS, difference of a machine from the mean %.3g um, "
                       "residual %.3g um\n",
                       output.displacement_um, scatter_um, output.remainder_um);
  }
  return text;
}

std::string text_of_machine(const Options& options, const Statistics& machine) {
  if (options.prior.empty()) return write_statistics(machine);
  return write_series(own_series(load_series(options.prior), machine, options.prior,
                                 options.drift_percent / 100.0));
}

int run(const Options& options) {
  cli::RunLoader loader(options.columns);
  if (!options.machine.empty()) {
    cli::write_file(options.result, text_of_machine(options, of_runs(options, loader, options.files,
                                                                     options.machine)));
    return 0;
  }
  std::vector<Statistics> machines;
  machines.reserve(options.files.size());
  for (const std::string& file : options.files)
    machines.push_back(of_argument(options, loader, file));
  for (std::size_t i = 0; i < machines.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      if (machines[i].xx.rows() == machines[j].xx.rows() &&
          machines[i].yy.size() == machines[j].yy.size() && machines[i].xx == machines[j].xx &&
          machines[i].yy == machines[j].yy)
        throw std::runtime_error(options.files[i] + ": is the recording of " + options.files[j] +
                                 "; a machine counts once");
  const Series series = series_of(machines, options.scatter);
  cli::write_file(options.result, write_series(series));
  if (options.result != "-") cli::write_file("-", text_of(series));
  return 0;
}

}  // namespace

void add_series_command(CLI::App& app, std::function<int()>& action) {
  const auto options = std::make_shared<Options>();
  CLI::App* sub =
      app.add_subcommand("series", "compute the mean model and scatter of machines of one type");
  sub->add_option("FILE", options->files,
                  "one argument per machine: a run RUN.csv[@T0:T1], a folder of runs, or "
                  "statistics written by --machine")
      ->required();
  sub->add_option("-o", options->result, "series file, for fit --prior and inspect --series")
      ->required();
  sub->add_option("--columns", options->columns, cli::columns_help);
  sub->add_option("--outputs", options->outputs, "displacements z_um[,...]; default: all")
      ->delimiter(',')
      ->type_name("NAME");
  CLI::Option* machine =
      sub->add_option("--machine", options->machine,
                      "write statistics of this machine, of which all files are runs, instead of a "
                      "series; they do not contain the runs")
          ->type_name("NAME");
  CLI::Option* prior =
      sub->add_option("--prior", options->prior,
                      "with --machine: write a series of this machine alone, from its runs and "
                      "this series, to compare its next runs with its own past")
          ->type_name("SERIES.toml")
          ->needs(machine);
  sub->add_option("--drift-percent", options->drift_percent,
                  "with --prior: expected change of the machine itself, as a share of the "
                  "displacement")
      ->check(CLI::Range(0.0, 100.0))
      ->needs(prior);
  sub->add_option("--scatter", options->scatter,
                  "assumed difference between machines, as a share of the displacement, with the "
                  "weight of two machines; default: 0.15, and one machine is refused")
      ->check(CLI::Range(0.01, 10.0));
  sub->callback([options, &action] { action = [options] { return run(*options); }; });
}

}  // namespace thermocomp::series
