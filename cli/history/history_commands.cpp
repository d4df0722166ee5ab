#include <algorithm>
#include <fmt/format.h>
#include <iostream>
#include <memory>
#include <optional>
#include <vector>

#include <CLI/CLI.hpp>

#include "cli/commands.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/runs/run_file.hpp"
#include "daemon/history/replay/replay.hpp"
#include "daemon/history/replay/run_replay.hpp"
#include "report/files.hpp"
#include "report/terminal.hpp"

namespace thermocomp::cli {

namespace {

struct ExportOptions {
  std::string history;
  std::string from;
  std::string to;
  std::string output;
  bool sensors{false};
};

/// @return the exit status
int report_damage(const std::string& history, const std::vector<HistoryDamage>& damage) {
  constexpr std::size_t shown_max = 20;
  for (std::size_t i = 0; i < std::min(damage.size(), shown_max); ++i)
    std::cerr << fmt::format("{}: {}\n", history, to_string(damage[i]));
  if (damage.size() > shown_max)
    std::cerr << fmt::format("{}: and {} more\n", history, damage.size() - shown_max);
  return damage.empty() ? exit_success : exit_no;
}

int run_export(const ExportOptions& options) {
  const auto from = time_or_none(options.from);
  const auto to = time_or_none(options.to);
  OutputFile file(options.output);
  ExportSummary summary;
  {
    Progress progress("export");
    summary = export_run(
        options.history, from, to, file.stream(),
        [&progress](double fraction) { progress.update(fraction); }, parse_setup,
        options.sensors ? ExportContent::sensors : ExportContent::inputs);
  }
  if (summary.rows == 0) {
    report_damage(options.history, summary.damage);
    throw Failure(options.history + ": nothing was recorded in this period");
  }
  file.commit();
  std::cerr << fmt::format("{} rows, {} columns\n", summary.rows, summary.columns.size());
  if (summary.gaps > 0)
    std::cerr << fmt::format("{} gap{}, each marked by a comment line in the file\n", summary.gaps,
                             summary.gaps == 1 ? "" : "s");
  return report_damage(options.history, summary.damage);
}

struct ReplayOptions {
  std::string input;  ///< history; with `config`, a run file
  std::string config;
  std::string columns;
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
  const int status = report_damage(options.input, summary.damage);
  if (summary.compared == 0 && status != exit_success) {
    throw Failure(options.input + ": no segment can be replayed");
  }
  file.commit();
  std::cerr << fmt::format(
      "{} segments ({} after a gap), {} cycles, {} offsets compared, {} differ\n", summary.segments,
      summary.gaps, summary.cycles, summary.compared, summary.different);
  if (summary.different == 0) return status;
  std::cerr << fmt::format("first at {:.3f} s, cycle {}; largest difference {:g} um\n",
                           summary.first_different_time_s.value_or(0.0),
                           summary.first_different_cycle.value_or(0),
                           summary.largest_difference_um);
  return exit_no;
}

int run_file_replay(const ReplayOptions& options) {
  const DaemonConfig config = load_daemon_config(options.config);
  const RunFile run = RunLoader(options.columns).load(options.input);
  OutputFile file(options.output);
  const RunReplaySummary summary = replay_run_file(config, run, file.stream());
  file.commit();
  for (const std::string& note : summary.notes) std::cerr << fmt::format("note: {}\n", note);
  std::cerr << fmt::format("{} rows, {} steps of {:g} s\n", summary.rows, summary.steps,
                           summary.step_period_s);
  return exit_success;
}

int run_history_check(const std::string& history) {
  HistoryCheck check;
  {
    Progress progress("check");
    check = check_history(history, [&progress](double fraction) { progress.update(fraction); });
  }
  std::size_t sound = 0;
  for (const SegmentCheck& part : check.segments) {
    const SegmentInfo& segment = part.segment;
    std::cout << fmt::format("segment {}: run {}, cycles {} to {}, from {}, {} records: {}\n",
                             segment.id, segment.run, segment.first_cycle, segment.last_cycle,
                             utc_text(segment.wall_ns), part.records,
                             part.damage.empty() ? "sound" : "damaged");
    for (const HistoryDamage& damage : part.damage) std::cout << fmt::format("  {}\n", damage.why);
    if (part.damage.empty()) ++sound;
  }
  for (const HistoryDamage& damage : check.damage)
    std::cout << fmt::format("{}: cannot be read\n", to_string(damage));
  std::cout << fmt::format("{}: {} of {} segments sound\n", history, sound,
                           check.segments.size() + check.damage.size());
  return check.is_sound() ? exit_success : exit_no;
}

void add_history_check(CLI::App& app, Action& action) {
  CLI::App* group = app.add_subcommand("history", "tests a daemon's history");
  group->require_subcommand(1);
  CLI::App* sub = group->add_subcommand(
      "check", "tests the segments of a history, read only. Exit status 1: some are damaged");
  const auto history = std::make_shared<std::string>();
  sub->add_option("HISTORY", *history, "history of thermocompd")->type_name("FILE")->required();
  sub->callback([&action, history] { action = [history] { return run_history_check(*history); }; });
}

}  // namespace

void add_history_commands(CLI::App& app, Action& action) {
  const auto export_options = std::make_shared<ExportOptions>();
  CLI::App* sub = app.add_subcommand(
      "export",
      "a daemon's history as a run file for predict, fit, diagnose and inspect: the model's inputs "
      "as the daemon used them, signals, probed displacement, offsets; wall time, faults, commands "
      "and damage are in comment lines");
  sub->add_option("HISTORY", export_options->history, "history of thermocompd")
      ->type_name("FILE")
      ->required();
  sub->add_option("--from", export_options->from,
                  "start: a time such as 2026-03-01T08:30:00 (local; Z: UTC) or 2026-03-01, "
                  "\"8 hours ago\", -8h, or seconds since the history's start");
  sub->add_option("--to", export_options->to, "end, not included; as --from");
  sub->add_flag("--sensors", export_options->sensors,
                "raw readings of every sensor, instead of the model's inputs");
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
  sub->add_option("--columns", replay_options->columns, columns_help)->type_name("FILE");
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
  add_history_check(app, action);
}

}  // namespace thermocomp::cli
