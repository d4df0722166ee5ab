#include <algorithm>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <unistd.h>
#include <vector>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/commands.hpp"
#include "cli/observe/status_text.hpp"
#include "cli/observe/watch_text.hpp"
#include "config/text/clean_output.hpp"
#include "daemon/history/reading/history_reader.hpp"
#include "daemon/socket/status_client.hpp"
#include "report/terminal.hpp"
#include "status/status.hpp"
#include "status/verdict.hpp"

namespace thermocomp::cli {

namespace {

using nlohmann::json;
using std::chrono::steady_clock;

struct StatusOptions {
  bool as_json{false};
  bool strict{false};
};

int run_status(const GlobalOptions& global, const StatusOptions& options) {
  json answer = StatusClient(global.socket).call("status", json::object());
  const auto status = part_from<Status>(answer);
  const std::vector<std::string> why = why_not(status, options.strict);
  const int exit_status = why.empty() ? exit_success : exit_no;
  if (options.as_json) {
    answer["exit_status"] = exit_status;
    answer["why"] = why;
    std::cout << answer.dump(2) << '\n';
  } else {
    std::cout << status_text(status, stdout_is_terminal());
  }
  return exit_status;
}

struct EventsOptions {
  std::string history;  ///< empty: ask the daemon
  std::string from;
  std::string to;
  bool as_json{false};
};

/// @return the daemon's answer, or the same from a history with the run of each event
json events_of(const GlobalOptions& global, const EventsOptions& options) {
  if (options.history.empty()) {
    if (!options.from.empty() || !options.to.empty())
      throw Failure("--from and --to need a history: thermocomp events HISTORY.db");
    return StatusClient(global.socket).call("events", json::object());
  }
  return {{"events", json_of(read_events(options.history, time_or_none(options.from),
                                         time_or_none(options.to)))}};
}

int run_events(const GlobalOptions& global, const EventsOptions& options) {
  const json events = events_of(global, options);
  std::cout << (options.as_json ? events.dump(2, ' ', false, json::error_handler_t::replace) + "\n"
                                : events_text(part_from<EventsAnswer>(events).events));
  return exit_success;
}

int run_sensors(const GlobalOptions& global, bool as_json) {
  const json sensors = StatusClient(global.socket).call("sensors", json::object());
  if (as_json) {
    std::cout << sensors.dump(2) << '\n';
  } else {
    std::cout << sensors_text(part_from<SensorsAnswer>(sensors), stdout_is_terminal());
  }
  return exit_success;
}

struct WatchOptions {
  double period_s{1.0};
  double for_s{0.0};  ///< 0: until interrupted
  std::string truth;  ///< file with a simulated machine's true displacement; empty: none
};

// Ctrl-C ends a watch and leaves the table on the screen.
void end_watch(int) {
  constexpr char newline = '\n';
  [[maybe_unused]] const auto written = ::write(STDOUT_FILENO, &newline, 1);
  ::_exit(exit_success);
}

int run_watch(const GlobalOptions& global, const WatchOptions& options) {
  const bool terminal = stdout_is_terminal();
  if (terminal) std::signal(SIGINT, end_watch);
  const auto end = steady_clock::now() + std::chrono::duration<double>(options.for_s);
  const auto remaining = [end] {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(end - steady_clock::now());
    return std::max(left, std::chrono::milliseconds(0));
  };
  const auto over = [&] { return options.for_s > 0.0 && steady_clock::now() >= end; };
  StatusClient client(global.socket);
  client.call("subscribe", {{"methods", {"status"}}, {"period_s", options.period_s}});
  AxisTrends trends(terminal_is_wide());
  std::optional<TruthFile> truth;
  if (!options.truth.empty()) truth.emplace(options.truth);
  const auto patience =
      std::chrono::milliseconds(static_cast<std::int64_t>(1000.0 * options.period_s) + 5000);
  WatchLog log;
  while (!over()) {
    json notification;
    try {
      notification = client.next(options.for_s > 0.0 ? std::min(patience, remaining()) : patience);
    } catch (const ClientError&) {
      if (over()) return exit_success;
      throw;
    }
    if (notification.value("method", "") != "status") continue;
    const TruthRow* row = truth ? truth->newest() : nullptr;
    const auto status = part_from<Status>(notification.value("params", json::object()));
    trends.add(status);
    if (terminal)
      std::cout << terminal_code("[H") << terminal_code("[J")
                << watch_screen(status, row, true, &trends);
    else
      std::cout << log.next(status, row);
    std::cout.flush();
  }
  return exit_success;
}

}  // namespace

void add_observe_commands(CLI::App& app, const GlobalOptions& global, Action& action) {
  const auto as_json = std::make_shared<bool>(false);
  const auto wanted = std::make_shared<StatusOptions>();
  CLI::App* status = app.add_subcommand("status", "shows mode, offsets and problems of the daemon");
  status->add_flag("--json", wanted->as_json,
                   "print the daemon's answer as JSON, with exit_status and its reason");
  status->add_flag("--strict", wanted->strict,
                   "exit status 1 also while it compensates with a problem: a bound reached, a "
                   "mismatch, a bad sensor, a silent unit");
  status->callback([&, wanted] { action = [&, wanted] { return run_status(global, *wanted); }; });

  CLI::App* events =
      app.add_subcommand("events",
                         "events since the daemon's start or of a whole history: faults and their "
                         "durations, changes of mode, commands and their users");
  const auto asked = std::make_shared<EventsOptions>();
  events
      ->add_option("HISTORY", asked->history,
                   "history of thermocompd, including earlier runs of the daemon; default: the "
                   "running daemon's list")
      ->type_name("FILE");
  events->add_option(
      "--from", asked->from,
      "of a history: start, a time such as 2026-03-01T08:30:00, \"8 hours ago\", -8h");
  events->add_option("--to", asked->to, "end, not included; as --from");
  events->add_flag("--json", asked->as_json, "the list as JSON");
  events->callback([&, asked] { action = [&, asked] { return run_events(global, *asked); }; });

  CLI::App* sensors = app.add_subcommand("sensors", "every sensor: raw, smoothed, fault");
  sensors->add_flag("--json", *as_json, "the daemon's answer as JSON");
  sensors->callback(
      [&, as_json] { action = [&, as_json] { return run_sensors(global, *as_json); }; });

  const auto options = std::make_shared<WatchOptions>();
  CLI::App* watch = app.add_subcommand("watch", "a live table of the running daemon");
  watch->add_option("--period", options->period_s, "seconds between two updates (default 1)")
      ->check(CLI::Range(0.1, 60.0));
  watch->add_option("--for", options->for_s, "end after this many seconds")
      ->check(CLI::PositiveNumber);
  watch
      ->add_option("--truth", options->truth,
                   "file that a simulated machine writes its true displacement to")
      ->type_name("FILE");
  watch->callback([&, options] { action = [&, options] { return run_watch(global, *options); }; });
}

}  // namespace thermocomp::cli
