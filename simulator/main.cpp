/// thermocomp-sim: a simulated machine with sensors and controller on real buses.

#include <charconv>
#include <cstdint>
#include <cstdio>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "report/command.hpp"
#include "simulator/command_line.hpp"
#include "simulator/files/machine_file.hpp"
#include "simulator/session/session.hpp"

namespace {

using thermocomp::MachineConfig;
using thermocomp::SessionOptions;
using thermocomp::SimulatedBus;
using thermocomp::SimulatedBusKind;
using thermocomp::SimulatorArguments;

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

/// The bus named in NAME=VALUE; sets `value` to VALUE.
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
  throw std::runtime_error(option + ": no bus is named \"" + name + "\"");
}

void apply(const SimulatorArguments& arguments, MachineConfig& machine, SessionOptions& session) {
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
  using namespace thermocomp;
  SimulatorArguments arguments;
  return cli::run_program(argc, argv, "thermocomp-sim", [&](CLI::App& app, cli::Action& action) {
    declare_simulator_command_line(app, arguments);
    action = [&] {
      MachineConfig machine = load_machine(arguments.machine);
      apply(arguments, machine, arguments.session);
      run_session(machine, arguments.session);
      return cli::exit_success;
    };
  });
}
