#include <cstdio>
#include <iostream>
#include <memory>
#include <string>

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>

#include "cli/commands.hpp"
#include "cli/scan/scan_bus.hpp"
#include "cli/scan/scan_controller.hpp"
#include "cli/scan/scan_report.hpp"
#include "config/daemon/daemon_config.hpp"
#include "report/terminal.hpp"

namespace thermocomp::cli {
namespace {

struct ScanOptions {
  std::string file;
  std::string bus;  ///< empty: all buses
  bool as_json{false};
  double listen_s{3.0};
  bool read_only{false};
  UnitSearch search;
  std::string units{"1-32"};
};

/// "1-32" or "7".
void read_units(const std::string& text, UnitSearch& search) {
  int first = 0;
  int last = 0;
  char rest = 0;
  const int read = std::sscanf(text.c_str(), "%3d-%3d%c", &first, &last, &rest);
  if (read == 1 && text.find_first_not_of("0123456789") == std::string::npos) last = first;
  if ((read != 1 && read != 2) || !(first >= 1 && first <= last && last <= 247) ||
      (read == 1 && last != first)) {
    throw Failure("--units " + text + ": must be A-B with 1 <= A <= B <= 247");
  }
  search.first = first;
  search.last = last;
}

std::string controller_name(const DaemonConfig& config) {
  return std::visit([](const auto& each) { return each.name; }, config.controller);
}

ScanReport scan(const DaemonConfig& config, const ScanOptions& options) {
  const ScanSensors sensors = scan_sensors(config.estimator.sensors);
  const ScanTask task{options.listen_s, options.search,
                      [](const std::string& line) { std::fprintf(stderr, "%s\n", line.c_str()); }};
  const auto wanted = [&](const std::string& name) {
    return options.bus.empty() || options.bus == name;
  };
  ScanReport report{options.file, {}, {}};
  for (const BusConfig& bus : config.buses)
    if (wanted(name_of(bus)))
      report.buses.push_back(
          std::visit([&](const auto& each) { return scan_bus(each, sensors, task); }, bus));
  if (wanted(controller_name(config)))
    report.controller =
        scan_controller(config, options.listen_s, !options.read_only, task.progress);
  if (report.buses.empty() && !report.controller) {
    throw Failure(options.bus + ": no such bus in " + options.file + " that can be scanned");
  }
  return report;
}

int run_scan(ScanOptions options) {
  read_units(options.units, options.search);
  const DaemonConfig config = load_daemon_config(options.file);
  for (const std::string& remark : config.remarks)
    std::fprintf(stderr, "warning: %s\n", remark.c_str());
  ScanReport report = scan(config, options);
  note_fahrenheit(report);
  if (options.as_json) {
    std::cout << scan_json(report).dump(2) << '\n';
  } else {
    std::cout << scan_text(report, stdout_is_terminal());
  }
  return is_complete(report) ? exit_success : exit_no;
}

}  // namespace

void add_scan_command(CLI::App& app, Action& action) {
  CLI::App* sub = app.add_subcommand(
      "scan",
      "every channel and every register of the controller, live: bytes, value, fault and why");
  const auto options = std::make_shared<ScanOptions>();
  sub->add_option("CONFIG", options->file, "configuration of thermocompd")
      ->type_name("FILE")
      ->required();
  sub->add_flag("--json", options->as_json, "the result as JSON");
  sub->add_option("--bus", options->bus,
                  "only this bus of the configuration, or the controller of this name")
      ->type_name("NAME");
  sub->add_option("--listen", options->listen_s, "seconds to listen to a CAN bus for (default 3)")
      ->check(CLI::Range(0.1, 600.0));
  sub->add_flag("--read-only", options->read_only,
                "do not test writes. Default: the registers' present values are written back if "
                "every axis applies them already");
  sub->add_flag("--find", options->search.wanted,
                "also request units and CANopen nodes outside the configuration");
  sub->add_option("--units", options->units, "Modbus units for --find (default 1-32)")
      ->type_name("A-B");
  sub->callback([&action, options] { action = [options] { return run_scan(*options); }; });
}

}  // namespace thermocomp::cli
