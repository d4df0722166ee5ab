/// Command line of `thermocomp-sim`; `--help`, manual page and completion are generated from it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "simulator/session/session.hpp"

namespace CLI {  // NOLINT(readability-identifier-naming): the name is that of CLI11
class App;
}

namespace thermocomp {

struct SimulatorArguments {
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

/// @param arguments  must outlive the parsing
void declare_simulator_command_line(CLI::App& app, SimulatorArguments& arguments);

}  // namespace thermocomp
