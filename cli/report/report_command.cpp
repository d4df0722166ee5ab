#include <algorithm>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>

#include "cli/commands.hpp"
#include "cli/report/machine_week.hpp"
#include "cli/report/week_page.hpp"
#include "daemon/history/format/history_time.hpp"
#include "report/files.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {
namespace {

constexpr double day_s = 86400.0;
constexpr double week_s = 7.0 * day_s;
/// The newest rows may not be committed yet: an end up to this time after them is accepted.
constexpr double uncommitted_s = 60.0;

struct ReportOptions {
  std::string history;
  std::string from;
  std::string to;
  std::string output;
  std::string machine;
};

/// Wall time, or seconds since the start of the history.
double moment_of(const std::string& text, double otherwise_s, const WallSpan& recorded) {
  if (text.empty()) return otherwise_s;
  const HistoryTime time = parse_history_time(text);
  if (time.wall_ns) return 1e-9 * static_cast<double>(*time.wall_ns);
  return recorded.from_s + time.seconds.value_or(0.0);
}

int run_report(const ReportOptions& options) {
  if (options.output.ends_with(".pdf"))
    throw Failure(options.output +
                  ": a report is written as HTML; a browser prints it: chromium --headless "
                  "--print-to-pdf=" +
                  options.output + " REPORT.html");
  const WallSpan recorded = recorded_span(options.history);
  WallSpan span;
  span.to_s = moment_of(options.to, recorded.to_s, recorded);
  if (span.to_s < recorded.to_s + uncommitted_s) span.to_s = std::min(span.to_s, recorded.to_s);
  // If the daemon stopped long ago, the page includes its last day.
  const double week_before_s = std::min(span.to_s - week_s, recorded.to_s - day_s);
  span.from_s = moment_of(options.from, std::max(recorded.from_s, week_before_s), recorded);
  if (!(span.to_s > span.from_s)) throw Failure("--from must be before --to");
  if (!(span.within(recorded).length_s() > 0.0))
    throw Failure(options.history + ": nothing was recorded in this period");
  constexpr double worth_saying_s = 3600.0;
  const double silent_s = static_cast<double>(std::time(nullptr)) - recorded.to_s;
  if (options.to.empty() && silent_s > worth_saying_s)
    std::fprintf(
        stderr,
        "the page ends with the last record, %s ago; --to now counts the time since then, in "
        "which nothing was recorded\n",
        duration_text(silent_s).c_str());
  MachineWeek week = machine_week(options.history, span);
  week.machine = options.machine;
  cli::write_file(options.output, week_html(week));
  for (const HistoryDamage& damage : week.damage)
    std::fprintf(stderr, "%s: %s\n", options.history.c_str(), to_string(damage).c_str());
  return exit_success;
}

}  // namespace

void add_report_command(CLI::App& app, Action& action) {
  const auto options = std::make_shared<ReportOptions>();
  CLI::App* sub =
      app.add_subcommand("report",
                         "page about a machine's last week for its owner: compensated hours and "
                         "reasons for the rest, offsets, probings, sensors, buses, actions");
  sub->add_option("HISTORY", options->history, "history of thermocompd")
      ->type_name("FILE")
      ->required();
  sub->add_option("--from", options->from,
                  "start, default a week before the end: a time such as 2026-03-01T08:30:00, "
                  "\"8 days ago\", -3d");
  sub->add_option("--to", options->to, "end, not included, default the last record; as --from");
  sub->add_option("--machine", options->machine, "the machine's name, for the title")
      ->type_name("NAME");
  sub->add_option("-o,--output", options->output, "page (HTML); - is standard output")
      ->type_name("FILE")
      ->required();
  sub->callback([&action, options] { action = [options] { return run_report(*options); }; });
}

}  // namespace thermocomp::cli
