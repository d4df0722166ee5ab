/// thermocomp-sim: a simulated machine, its sensors and its controller on real buses.

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iostream>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "simulator/machine_file.hpp"
#include "simulator/session.hpp"

namespace {

using thermocomp::MachineConfig;
using thermocomp::SessionOptions;
using thermocomp::SimulatedBus;
using thermocomp::SimulatedBusKind;

constexpr const char* footer = R"(
When all buses are open one line of JSON is printed:
  {"ready":true,"ports":{"cabinet":40123},"paths":{"line":"/tmp/line"},"unavailable":{}}
At the end (duration reached, SIGINT or SIGTERM) the last line is
  error rms at the tool: uncompensated A um, compensated B um
The machine file is described by config/examples/machine.toml.
Exit status: 0 success, 2 bad use or bad input.)";

struct Arguments {
  std::string machine;
  std::optional<std::uint64_t> seed;
  std::optional<double> duration_h;
  std::optional<double> truth_period_s;
  double row_period_ms{0.0};
  double tick_ms{10.0};
  std::string rows;
  std::vector<std::string> ports;
  std::vector<std::string> paths;
  SessionOptions session;
};

/// CLI::Range lets "nan" pass.
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

void declare(CLI::App& app, Arguments& arguments) {
  const auto positive = number_between(1e-9, 1e9);
  const auto not_negative = number_between(0.0, 1e9);
  SessionOptions& session = arguments.session;
  app.add_option("machine", arguments.machine, "Machine file (TOML)")->required();
  app.add_option("--seed", arguments.seed, "Seed instead of the file's");
  auto* factor = app.add_option("--time-factor", session.time_factor,
                                "Plant time goes so much faster than real time");
  auto* duration = app.add_option("--duration", arguments.duration_h,
                                  "Plant hours instead of the file's; 0: until stopped");
  app.add_flag("--start-on-heartbeat", session.start_on_heartbeat,
               "Time stands at the beginning until the controller's heartbeat beats");
  app.add_flag("--stay", session.stay, "Go on after the end until stopped");
  app.add_option("--truth", session.truth, "Run file of what really happened at the tool");
  auto* truth_period = app.add_option("--truth-period-s", arguments.truth_period_s,
                                      "Plant time between its rows, instead of the file's pitch_s");
  auto* replay =
      app.add_option("--replay", session.replay, "Run file whose rows take the place of the plant");
  auto* row_period = app.add_option("--row-period-ms", arguments.row_period_ms,
                                    "Replay: one row each so often, real time; else by time_s");
  auto* rows = app.add_option("--rows", arguments.rows, "Replay: rows A:B, from A and before B");
  auto* row_log = app.add_option(
      "--row-log", session.row_log,
      "Replay: CSV of each row and the CLOCK_MONOTONIC ns at which it could be read");
  auto* settle = app.add_option("--settle-s", session.settle_s,
                                "Replay: the last row stands for so long (default 1)");
  app.add_option("--ports-file", session.ports_file, "The ready line goes there too");
  app.add_option("--port", arguments.ports, "NAME=PORT of a bus or the controller; several times")
      ->type_name("NAME=PORT")
      ->allow_extra_args(false);
  app.add_option("--path", arguments.paths, "NAME=PATH of a serial line's link; several times")
      ->type_name("NAME=PATH")
      ->allow_extra_args(false);
  app.add_option("--tick-ms", arguments.tick_ms,
                 "Registers are brought up to date so often, real time (default 10)")
      ->check(number_between(0.1, 10000.0));
  for (auto* option : {factor, truth_period, row_period}) option->check(positive);
  for (auto* option : {duration, settle}) option->check(not_negative);
  for (auto* option : {row_period, rows, row_log, settle}) option->needs(replay);
  for (auto* option : {duration, truth_period}) option->excludes(replay);
  row_period->excludes(factor);
  app.footer(footer);
}

template <class Number>
Number whole_number(const std::string& text, const std::string& option) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc{} || end != text.data() + text.size()) {
    throw std::runtime_error(option + ": \"" + text + "\" must be a whole number");
  }
  return value;
}

void read_rows(const std::string& text, SessionOptions& session) {
  const auto colon = text.find(':');
  if (colon == std::string::npos) throw std::runtime_error("--rows: must be A:B");
  const std::string first = text.substr(0, colon);
  const std::string last = text.substr(colon + 1);
  if (!first.empty()) session.row_begin = whole_number<std::size_t>(first, "--rows");
  if (!last.empty()) session.row_end = whole_number<std::size_t>(last, "--rows");
  if (session.row_begin >= session.row_end) {
    throw std::runtime_error("--rows: A must be below B in " + text);
  }
}

/// The bus that NAME of NAME=VALUE means; `value` gets the rest.
SimulatedBus& named_bus(MachineConfig& machine, const std::string& text, const std::string& option,
                        SimulatedBusKind kind, std::string& value) {
  const auto equals = text.find('=');
  if (equals == std::string::npos || equals + 1 == text.size()) {
    throw std::runtime_error(option + ": \"" + text + "\" must be NAME=VALUE");
  }
  const std::string name = text.substr(0, equals);
  value = text.substr(equals + 1);
  if (machine.controller && machine.controller->bus.name == name &&
      machine.controller->bus.kind == kind) {
    return machine.controller->bus;
  }
  for (SimulatedBus& bus : machine.buses) {
    if (bus.name == name && bus.kind == kind) return bus;
  }
  throw std::runtime_error(option + ": there is no such bus as \"" + name + "\"");
}

void apply(const Arguments& arguments, MachineConfig& machine, SessionOptions& session) {
  machine.seed = arguments.seed.value_or(machine.seed);
  machine.pitch_s = arguments.truth_period_s.value_or(machine.pitch_s);
  session.duration_s = arguments.duration_h ? *arguments.duration_h * 3600.0 : machine.duration_s;
  session.row_period_s = arguments.row_period_ms / 1000.0;
  session.tick_s = arguments.tick_ms / 1000.0;
  if (!arguments.rows.empty()) read_rows(arguments.rows, session);
  std::string value;
  for (const std::string& text : arguments.ports) {
    SimulatedBus& bus = named_bus(machine, text, "--port", SimulatedBusKind::modbus_tcp, value);
    bus.port = whole_number<std::uint16_t>(value, "--port");
  }
  for (const std::string& text : arguments.paths) {
    named_bus(machine, text, "--path", SimulatedBusKind::modbus_rtu, value).device = value;
  }
  const bool replay_option =
      !arguments.rows.empty() || arguments.row_period_ms > 0.0 || !session.row_log.empty();
  if (session.replay.empty() && replay_option) {
    throw std::runtime_error("--rows, --row-period-ms and --row-log need --replay");
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "A simulated machine that warms and bends, with thermocouples and a controller on "
      "real buses",
      "thermocomp-sim");
  Arguments arguments;
  declare(app, arguments);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    MachineConfig machine = thermocomp::load_machine(arguments.machine);
    apply(arguments, machine, arguments.session);
    thermocomp::run_session(machine, arguments.session);
  } catch (const std::exception& error) {
    std::cerr << "thermocomp-sim: " << error.what() << std::endl;
    return 2;
  }
  return 0;
}
