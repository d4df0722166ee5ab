#include "simulator/command_line.hpp"

#include <CLI/CLI.hpp>

namespace thermocomp {
namespace {

constexpr const char* footer = R"(
When all buses are open one line of JSON is printed:
  {"ready":true,"ports":{"cabinet":40123},"paths":{"line":"/tmp/line"},"unavailable":{}}
At the end (duration reached, SIGINT or SIGTERM) the last line is
  error rms at the tool: uncompensated A um, compensated B um
Every key of the machine file is in the commented example machine.toml.
Exit status: 0 success, 2 usage error or bad input.)";

/// CLI::Range accepts "nan".
CLI::Validator number_between(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& text) {
        double value = 0.0;
        const bool number = CLI::detail::lexical_cast(text, value);
        if (number && value >= low && value <= high) return std::string();
        return text + " must be a number from " + CLI::detail::to_string(low) + " to " +
               CLI::detail::to_string(high);
      },
      "NUMBER");
}

}  // namespace

void declare_simulator_command_line(CLI::App& app, SimulatorArguments& arguments) {
  app.name("thermocomp-sim");
  app.description(
      "Simulates a machine with thermal displacement, thermocouples and a controller on real "
      "buses");
  const auto positive = number_between(1e-9, 1e9);
  const auto not_negative = number_between(0.0, 1e9);
  SessionOptions& session = arguments.session;
  app.add_option("machine", arguments.machine, "Machine file (TOML)")
      ->type_name("FILE")
      ->required();
  app.add_option("--seed", arguments.seed, "Seed instead of the file's");
  auto* factor = app.add_option("--time-factor", session.time_factor, "Plant time per real time");
  auto* duration = app.add_option("--duration", arguments.duration_h,
                                  "Plant hours instead of the file's; 0: until stopped");
  app.add_flag("--start-on-heartbeat", session.start_on_heartbeat,
               "Start the plant time when the controller's heartbeat first changes");
  app.add_flag("--stay", session.stay, "Continue after the end until stopped");
  app.add_option("--truth", session.truth,
                 "Run file to write with the true displacement at the tool")
      ->type_name("FILE");
  auto* truth_period =
      app.add_option("--truth-period-s", arguments.truth_period_s,
                     "Plant time between its rows; default: the machine file's pitch_s");
  auto* replay =
      app.add_option("--replay", session.replay, "Run file to replay instead of the plant")
          ->type_name("FILE");
  auto* row_period = app.add_option("--row-period-ms", arguments.row_period_ms,
                                    "Replay: period of rows, real time; default: by time_s");
  auto* rows = app.add_option("--rows", arguments.rows, "Replay: rows A:B, B excluded");
  auto* row_log = app.add_option("--row-log", session.row_log,
                                 "Replay: CSV to write with each row and the CLOCK_MONOTONIC ns "
                                 "since which it is readable")
                      ->type_name("FILE");
  auto* settle = app.add_option("--settle-s", session.settle_s,
                                "Replay: duration of the last row (default 1)");
  app.add_option("--ports-file", session.ports_file, "File that also receives the ready line")
      ->type_name("FILE");
  app.add_option("--port", arguments.ports, "NAME=PORT of a bus or the controller; may be repeated")
      ->type_name("NAME=PORT")
      ->allow_extra_args(false);
  app.add_option("--path", arguments.paths, "NAME=PATH of a serial line's link; may be repeated")
      ->type_name("NAME=PATH")
      ->allow_extra_args(false);
  app.add_option("--tick-ms", arguments.tick_ms,
                 "Period of register updates, real time (default 10)")
      ->check(number_between(0.1, 10000.0));
  for (auto* option : {factor, truth_period, row_period}) option->check(positive);
  for (auto* option : {duration, settle}) option->check(not_negative);
  for (auto* option : {row_period, rows, row_log, settle}) option->needs(replay);
  for (auto* option : {duration, truth_period}) option->excludes(replay);
  row_period->excludes(factor);
  app.footer(footer);
}

}  // namespace thermocomp
