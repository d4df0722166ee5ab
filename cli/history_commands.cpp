#include "cli/history_commands.hpp"

#include <cstdio>
#include <memory>
#include <optional>

#include <CLI/CLI.hpp>

#include "cli/output_file.hpp"
#include "cli/terminal.hpp"
#include "config/daemon_config.hpp"
#include "config/run_file.hpp"
#include "daemon/history/replay.hpp"
#include "daemon/history/run_replay.hpp"

namespace thermocomp::cli {

namespace {

struct ExportOptions {
  std::string history;
  std::string from;
  std::string to;
  std::string output;
};

std::optional<HistoryTime> time_or_none(const std::string& text) {
  if (text.empty()) return std::nullopt;
  return parse_history_time(text);
}

int run_export(const ExportOptions& options) {
  const auto from = time_or_none(options.from);
  const auto to = time_or_none(options.to);
  OutputFile file(options.output);
  ExportSummary summary;
  {
    Progress progress("export");
    summary = export_run(options.history, from, to, file.stream(),
                         [&progress](double fraction) { progress.update(fraction); });
  }
  if (summary.rows == 0) throw Failure(options.history + ": nothing was recorded in that time");
  file.commit();
  std::fprintf(stderr, "%llu rows, %zu columns\n", static_cast<unsigned long long>(summary.rows),
               summary.columns.size());
  if (summary.gaps > 0) {
    std::fprintf(stderr, "%llu gap%s, each told by a comment line in the file\n",
                 static_cast<unsigned long long>(summary.gaps), summary.gaps == 1 ? "" : "s");
  }
  return exit_success;
}

struct ReplayOptions {
  std::string input;  ///< history, or run file where config is given
  std::string config;
  std::string output;
};

int run_history_replay(const ReplayOptions& options) {
  OutputFile file(options.output);
  ReplaySummary summary;
  {
    Progress progress("replay");
    summary = replay_to_csv(options.input, file.stream(),
                            [&progress](double fraction) { progress.update(fraction); });
  }
  file.commit();
  std::fprintf(
      stderr, "%llu segments (%llu after a gap), %llu cycles, %llu offsets compared, %llu differ\n",
      static_cast<unsigned long long>(summary.segments),
      static_cast<unsigned long long>(summary.gaps),
      static_cast<unsigned long long>(summary.cycles),
      static_cast<unsigned long long>(summary.compared),
      static_cast<unsigned long long>(summary.different));
  if (summary.different == 0) return exit_success;
  std::fprintf(stderr, "first at %.3f s, cycle %llu; largest difference %g um\n",
               summary.first_different_time_s.value_or(0.0),
               static_cast<unsigned long long>(summary.first_different_cycle.value_or(0)),
               summary.largest_difference_um);
  return exit_no;
}

int run_file_replay(const ReplayOptions& options) {
  const DaemonConfig config = load_daemon_config(options.config);
  const RunFile run = load_run(parse_selection(options.input));
  OutputFile file(options.output);
  const RunReplaySummary summary = replay_run_file(config, run, file.stream());
  file.commit();
  for (const std::string& note : summary.notes) std::fprintf(stderr, "note: %s\n", note.c_str());
  std::fprintf(stderr, "%llu rows, %llu steps of %g s\n",
               static_cast<unsigned long long>(summary.rows),
               static_cast<unsigned long long>(summary.steps), summary.step_period_s);
  return exit_success;
}

}  // namespace

void add_history_commands(CLI::App& app, Action& action) {
  const auto export_options = std::make_shared<ExportOptions>();
  CLI::App* sub = app.add_subcommand("export", "a daemon's history as a run file");
  sub->add_option("HISTORY", export_options->history, "history of thermocompd")
      ->type_name("FILE")
      ->required();
  sub->add_option("--from", export_options->from,
                  "seconds since the history's start, or a time such as 2026-03-01T08:30:00");
  sub->add_option("--to", export_options->to, "end, not included; as --from");
  sub->add_option("-o,--output", export_options->output, "run file; - is standard output")
      ->type_name("FILE")
      ->required();
  sub->callback([&action, export_options] {
    action = [export_options] { return run_export(*export_options); };
  });

  const auto replay_options = std::make_shared<ReplayOptions>();
  sub = app.add_subcommand(
      "replay", "the daemon's estimator over its history (exact), or over a run file (--config)");
  sub->add_option("--config", replay_options->config,
                  "configuration of thermocompd; the input is then a run file")
      ->type_name("FILE");
  sub->add_option("INPUT", replay_options->input, "history of thermocompd, or RUN.csv[@T0:T1]")
      ->type_name("FILE")
      ->required();
  sub->add_option("-o,--output", replay_options->output, "CSV file; - is standard output")
      ->type_name("FILE")
      ->required();
  sub->callback([&action, replay_options] {
    action = [replay_options] {
      return replay_options->config.empty() ? run_history_replay(*replay_options)
                                            : run_file_replay(*replay_options);
    };
  });
}

}  // namespace thermocomp::cli
