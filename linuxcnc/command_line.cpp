// SPDX-License-Identifier: GPL-2.0-or-later
#include "linuxcnc/command_line.hpp"

#include <CLI/CLI.hpp>

namespace thermocomp_linuxcnc {
namespace {

/// CLI::Range accepts "nan".
CLI::Validator between(double low, double high) {
  return {[low, high](const std::string& text) -> std::string {
            double value = 0.0;
            const bool is_number = CLI::detail::lexical_cast(text, value);
            return is_number && value >= low && value <= high ? "" : "not within the bounds";
          },
          "FLOAT in [" + CLI::detail::to_string(low) + ", " + CLI::detail::to_string(high) + "]"};
}

void add_bridge_options(CLI::App& app, BridgeOptions& bridge, std::string& made_for) {
  app.add_option("--units", bridge.unit, "of the machine (LINEAR_UNITS): mm or inch; required");
  app.add_option("--made-for", made_for, "units for which the HAL file was made")
      ->capture_default_str();
  app.add_option("--name", bridge.name, "of the HAL component")->capture_default_str();
  app.add_option("--axes", bridge.axes, "letters of the axes that take an offset")
      ->capture_default_str()
      ->check([](const std::string& text) -> std::string {
        for (std::size_t i = 0; i < text.size(); ++i)
          if (std::string("xyzuvw").find(text[i]) == std::string::npos ||
              text.find(text[i], i + 1) != std::string::npos)
            return "axes are letters of xyzuvw, each once";
        return text.empty() ? "at least one axis" : "";
      });
  app.add_option("--socket", bridge.socket, "status socket of thermocompd")->capture_default_str();
  app.add_option("--period-s", bridge.period_s, "of the exchange with the daemon")
      ->capture_default_str()
      ->check(between(0.01, 0.5));
  app.add_option("--offset-mm-max", bridge.limits.offset_mm_max, "a larger offset is refused")
      ->capture_default_str()
      ->check(between(0.001, 1.0));
  app.add_option("--fresh-s", bridge.limits.fresh_s, "time for which an answer's offsets are fresh")
      ->capture_default_str()
      ->check(between(0.01, 60.0));
  app.add_option("--mismatch-mm", bridge.limits.mismatch_mm,
                 "allowed difference of requested and applied offset")
      ->capture_default_str()
      ->check(between(0.0001, 1.0));
  app.add_option("--mismatch-after-s", bridge.limits.mismatch_after_s,
                 "allowed duration of a larger difference")
      ->capture_default_str()
      ->check(between(0.01, 60.0));
}

struct HalTexts {
  std::string axes;
  std::vector<std::string> signals;
};

void add_hal_options(CLI::App& hal, Task& task, HalTexts& texts) {
  HalFileOptions& options = task.hal;
  const std::map<std::string, Way> ways{{"joint", Way::joint}, {"external", Way::external}};
  hal.add_option("--way", options.way,
                 "joint: between motion and drive; external: LinuxCNC's "
                 "external offsets")
      ->required()
      ->transform(CLI::CheckedTransformer(ways));
  hal.add_option("--units", options.unit, "LINEAR_UNITS of the machine's ini file: mm or inch")
      ->capture_default_str();
  hal.add_option("--axes", texts.axes, "axes and their joints, as in x=0,y=1,z=2")->required();
  hal.add_option("--name", options.name, "name of the bridge's component")->capture_default_str();
  hal.add_option("--offset-mm-max", options.offset_mm_max, "bound of an offset")
      ->capture_default_str();
  hal.add_option("--speed", options.speed_mm_per_s, "largest speed of an offset [mm/s]")
      ->capture_default_str();
  hal.add_option("--acceleration", options.acceleration_mm_per_s2,
                 "largest acceleration of an offset [mm/s2]")
      ->capture_default_str();
  hal.add_option("--command", options.command, "command that starts the bridge")
      ->capture_default_str();
  hal.add_option("--arguments", options.arguments,
                 "arguments of the bridge, as in \"--socket /tmp/s\"");
  hal.add_option("--thread", options.thread, "the servo thread")->capture_default_str();
  hal.add_option("--feedback-position", options.feedback_position,
                 "joint: position in the thread, after the drives are read")
      ->capture_default_str();
  hal.add_option("--output-position", options.output_position,
                 "joint: position in the thread, before the drives are written; -1: last")
      ->capture_default_str();
  hal.add_flag("--halui", options.program_running,
               "halui is loaded and shows whether a program runs");
  hal.add_option("--signal", texts.signals,
                 "PIN=SIGNAL: a pin of LinuxCNC that is already on a signal; may be repeated");
  hal.add_option("--rejoin", task.rejoin_as,
                 "print HAL commands with which a component of this name replaces a killed one");
}

std::map<std::string, std::string> read_signals(const std::vector<std::string>& texts) {
  std::map<std::string, std::string> signals;
  for (const std::string& text : texts) {
    const std::size_t equals = text.find('=');
    if (equals == 0 || equals == std::string::npos || equals + 1 == text.size())
      throw BadOption("--signal takes PIN=SIGNAL, not " + text);
    signals[text.substr(0, equals)] = text.substr(equals + 1);
  }
  return signals;
}

/// The limits in the HAL file are numbers in the machine's unit. @throws BadOption
void check_units(const std::string& machine, const std::string& made_for) {
  if (unit_mm(machine) != unit_mm(made_for))
    throw BadOption("the HAL file was made for a machine in " + made_for +
                    ", and LINEAR_UNITS are " + machine +
                    ": make it again with `thermocomp-linuxcnc hal --units " + machine + " ...`");
}

}  // namespace

std::vector<HalAxis> read_axes(const std::string& text) {
  std::vector<HalAxis> axes;
  std::size_t begin = 0;
  while (begin <= text.size()) {
    const std::size_t end = std::min(text.find(',', begin), text.size());
    const std::string part = text.substr(begin, end - begin);
    const bool good = part.size() >= 3 && part.size() <= 4 && part[1] == '=' &&
                      part.find_first_not_of("0123456789", 2) == std::string::npos;
    if (!good) throw BadOption("--axes takes LETTER=JOINT, as in x=0,z=2, not " + part);
    axes.push_back({part[0], std::stoi(part.substr(2))});
    begin = end + 1;
  }
  return axes;
}

std::optional<Task> read_command_line(int argc, const char* const* argv, int& status) {
  Task task;
  HalTexts texts;
  CLI::App app("Thermal offsets of thermocompd for LinuxCNC: a HAL component, started by loadusr");
  app.set_version_flag("--version", std::string("thermocomp-linuxcnc ") + THERMOCOMP_VERSION);
  std::string made_for = "mm";
  add_bridge_options(app, task.bridge, made_for);
  CLI::App* hal = app.add_subcommand("hal", "prints the HAL file for a machine");
  add_hal_options(*hal, task, texts);
  try {
    app.parse(argc, argv);
    task.print_hal = hal->parsed();
    if (task.print_hal)
      task.hal.axes = read_axes(texts.axes);
    else if (task.bridge.unit.empty())
      throw CLI::RequiredError("--units");
    else
      check_units(task.bridge.unit, made_for);
    task.hal.signals = read_signals(texts.signals);
  } catch (const CLI::ParseError& error) {
    status = app.exit(error) == 0 ? 0 : 2;
    return std::nullopt;
  }
  return task;
}

}  // namespace thermocomp_linuxcnc
