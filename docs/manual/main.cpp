// thermocomp-manual EXAMPLES FOLDER: writes the manual pages and the completion of bash into
// FOLDER. A tool of the build; what it writes is installed, it is not.
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <sstream>
#include <stdexcept>

#include <CLI/CLI.hpp>

#include "cli/commands.hpp"
#include "config/daemon/daemon_config.hpp"
#include "daemon/command_line.hpp"
#include "docs/manual/pages.hpp"
#include "simulator/command_line.hpp"
#ifdef THERMOCOMP_WITH_GATEWAY
#include "gateway/command_line.hpp"
#endif
#ifdef THERMOCOMP_WITH_FLEET
#include "fleet/command_line.hpp"
#include "fleet/page/command_line.hpp"
#include "fleet/uplink/command_line.hpp"
#endif
#ifdef THERMOCOMP_WITH_MODELLING
#include "modelling/command_line.hpp"
#endif

namespace {

using namespace thermocomp;
using namespace thermocomp::manual;
namespace fs = std::filesystem;

const std::string config_path = "/etc/thermocomp/thermocompd.toml";
const std::string example_folder = "/usr/share/doc/thermocomp/examples/";

std::string content(const fs::path& file) {
  std::ifstream in(file);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw std::runtime_error("cannot read " + file.string());
  return text.str();
}

void write(const fs::path& file, const std::string& text) {
  std::ofstream out(file);
  out << text;
  out.close();
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

void write_program(const fs::path& folder, const CLI::App& app, const PageExtras& extras) {
  const std::string& name = app.get_name();
  write(folder / (name + "." + std::to_string(extras.section)), command_page(app, extras));
  write(folder / (name + ".bash"), bash_completion(app));
}

void write_command(const fs::path& folder) {
  CLI::App app;
  cli::GlobalOptions global{SocketConfig{}.path.string()};
  cli::Action action;
  cli::declare_command_line(app, global, action);
  PageExtras extras;
  extras.environment = {
      {"THERMOCOMP_SOCKET", "the daemon's status socket, instead of the default"}};
  extras.files = {{global.socket, "the daemon's status socket"},
                  {HistoryConfig{}.file.string(), "the daemon's history"}};
  extras.see_also = {"thermocompd(8)", "thermocompd.toml(5)", "thermocomp-run(5)",
                     "thermocomp-sim(1)", "thermocomp-modelling(1)"};
  write_program(folder, app, extras);
}

void write_daemon(const fs::path& folder) {
  CLI::App app;
  std::string config_file = config_path;
  declare_daemon_command_line(app, config_file);
  const DaemonConfig defaults;
  PageExtras extras;
  extras.section = 8;
  extras.files = {{config_path, "the configuration; the service does not start without it"},
                  {example_folder, "commented examples"},
                  {defaults.state_file.string(),
                   "reference state, operator's switch and last offsets; kept over restarts"},
                  {defaults.history.file.string(), "what was measured and sent (SQLite)"},
                  {defaults.socket.path.string(), "the status socket, for thermocomp(1)"}};
  extras.see_also = {"thermocomp(1)", "thermocompd.toml(5)", "systemctl(1)", "journalctl(1)"};
  write_program(folder, app, extras);
}

void write_simulator(const fs::path& folder) {
  CLI::App app;
  SimulatorArguments arguments;
  declare_simulator_command_line(app, arguments);
  PageExtras extras;
  extras.files = {{"/usr/share/doc/thermocomp-simulator/examples/machine.toml",
                   "a machine with every key of the file explained"}};
  extras.see_also = {"thermocomp(1)", "thermocompd(8)"};
  write_program(folder, app, extras);
}

#ifdef THERMOCOMP_WITH_MODELLING
void write_modelling(const fs::path& folder) {
  CLI::App app;
  std::function<int()> action;
  declare_modelling_command_line(app, action);
  PageExtras extras;
  extras.see_also = {"thermocomp(1)"};
  write_program(folder, app, extras);
}
#endif

#ifdef THERMOCOMP_WITH_GATEWAY
void write_gateway(const fs::path& examples, const fs::path& folder) {
  CLI::App app;
  gateway::GatewayOptions options;
  gateway::declare_gateway_command_line(app, options);
  PageExtras extras;
  extras.files = {
      {options.config_file, "the configuration; the service does not start without it"},
      {"/usr/share/thermocomp/monitoring", "alert rules for Prometheus, a dashboard for Grafana"}};
  extras.see_also = {"gateway.toml(5)", "thermocompd(8)", "thermocomp(1)"};
  write_program(folder, app, extras);
  FormatPage page;
  page.name = "gateway.toml";
  page.what = "configuration of thermocomp-gateway";
  page.text =
      "The file is TOML, and is read strictly; all problems are shown by\n"
      "\n"
      " thermocomp check " +
      options.config_file +
      "\n\n"
      "The commented example below is the reference; every key is shown with its default.\n";
  page.examples = {{"THE CONFIGURATION", content(examples / "gateway.toml")}};
  page.see_also = {"thermocomp-gateway(1)", "thermocomp(1)"};
  write(folder / "gateway.toml.5", format_page(page));
}
#endif

#ifdef THERMOCOMP_WITH_FLEET
void write_fleet_format(const fs::path& examples, const fs::path& folder, const std::string& name,
                        const std::string& program, const std::string& see) {
  FormatPage page;
  page.name = name;
  page.what = "configuration of " + program;
  page.text =
      "The file is TOML, and is read strictly.\n"
      "\n"
      "The commented example below is the reference; every key is shown with its default.\n";
  page.examples = {{"THE CONFIGURATION", content(examples / name)}};
  page.see_also = {see};
  write(folder / (name + ".5"), format_page(page));
}

void write_fleet(const fs::path& examples, const fs::path& folder) {
  CLI::App fleet_app;
  std::string store;
  cli::Action action;
  fleet::declare_fleet_command_line(fleet_app, store, action);
  PageExtras extras;
  extras.environment = {{"THERMOCOMP_FLEET_STORE", "connection, instead of --store"}};
  extras.see_also = {"thermocomp-uplink(1)", "thermocomp-modelling(1)", "psql(1)"};
  write_program(folder, fleet_app, extras);

  CLI::App uplink_app;
  fleet::UplinkOptions options;
  fleet::declare_uplink_command_line(uplink_app, options);
  extras = {};
  extras.files = {
      {options.config_file, "the configuration; the service does not start without it"}};
  extras.see_also = {"uplink.toml(5)", "thermocomp-fleet(1)", "thermocompd(8)"};
  write_program(folder, uplink_app, extras);

  CLI::App page_app;
  std::string page_file;
  fleet::declare_page_command_line(page_app, page_file);
  extras = {};
  extras.files = {{page_file, "the configuration; the service does not start without it"}};
  extras.see_also = {"fleet_page.toml(5)", "thermocomp-fleet(1)"};
  write_program(folder, page_app, extras);

  write_fleet_format(examples, folder, "uplink.toml", "thermocomp-uplink", "thermocomp-uplink(1)");
  write_fleet_format(examples, folder, "releases.toml", "thermocomp admit", "thermocomp(1)");
  write_fleet_format(examples, folder, "fleet_page.toml", "thermocomp-fleet-page",
                     "thermocomp-fleet-page(1)");
}
#endif

void write_formats(const fs::path& examples, const fs::path& folder) {
  FormatPage page;
  page.name = "thermocompd.toml";
  page.what = "configuration of thermocompd";
  page.text =
      "The file is TOML, and is read strictly: an unknown key, a wrong type, a missing key, a "
      "value\n"
      "out of range or a name that refers to nothing is an error, and all of them are shown by\n"
      "\n"
      " thermocomp check " +
      config_path +
      "\n\n"
      "Units are the end of a name. Register addresses count from 0, as on the wire. Paths are\n"
      "relative to the folder of the file. After a change \"thermocomp reload\" takes over model,\n"
      "blocks, screening, smoothing, limits and the rules of the compensation, without a jump of "
      "the\n"
      "axes, or reports that a restart is needed.\n"
      "\n"
      "The commented examples below are the reference; every key is shown with its default. They "
      "are\n"
      "installed in " +
      example_folder + ".\n";
  page.examples = {
      {"THE CONFIGURATION", content(examples / "small_machine.toml")},
      {"THE MODEL FILE", content(examples / "small_machine_model.toml")},
      {"SENSORS AND CONTROLLER ON A CAN BUS", content(examples / "can.toml")},
      {"SENSORS NAMED BY A DBC FILE", content(examples / "can_dbc.toml")},
  };
  page.see_also = {"thermocompd(8)", "thermocomp(1)"};
  write(folder / "thermocompd.toml.5", format_page(page));
}

void write_run_format(const fs::path& examples, const fs::path& folder) {
  FormatPage page;
  page.name = "thermocomp-run";
  page.what = "run file: measured or simulated data";
  page.text =
      "CSV in UTF-8 with commas, decimal points and one header row; lines that start with # are\n"
      "comments. One file is one run. time_s is required and increases; steps may differ. An "
      "empty\n"
      "field or nan is a missing value. The unit is the longest known end of a column's name:\n"
      "_degC and _K (temperatures), _um (displacement), _urad (tilt), _mm (position), _rpm,\n"
      "_mm_per_min, _A, _W, _V, _on (0 or 1), _percent; any other name is an operating signal "
      "without\n"
      "unit. FILE@T0:T1 on a command line selects the rows with T0 <= time_s < T1.\n"
      "\n"
      "\"thermocomp export\" writes this form from a daemon's history: the model's inputs as the\n"
      "daemon computed with them, signals, the displacement where it was probed, and for each "
      "axis\n"
      "_offset_um, _applied_um and _measured_um. Comments contain wall time, faults of sensors, "
      "commands\n"
      "and gaps. \"inspect\", \"fit\", \"predict\", \"diagnose\" and \"covariance\" take it as it "
      "is.\n"
      "\n"
      "Readers also accept other separators, decimal commas, dates and units in brackets. They\n"
      "print the interpretation on stderr. An ambiguity is an error that shows the line to add to\n"
      "a file of --columns.\n";
  page.examples = {{"A RUN FILE", content(examples / "run.csv")},
                   {"A FILE OF --COLUMNS", content(examples / "columns.toml")}};
  page.see_also = {"thermocomp(1)", "thermocomp-modelling(1)"};
  write(folder / "thermocomp-run.5", format_page(page));
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::fprintf(stderr, "usage: thermocomp-manual EXAMPLES FOLDER\n");
    return 2;
  }
  try {
    const fs::path folder = argv[2];
    fs::create_directories(folder);
    write_command(folder);
    write_daemon(folder);
    write_simulator(folder);
#ifdef THERMOCOMP_WITH_FLEET
    write_fleet(fs::path(argv[1]), folder);
#endif
#ifdef THERMOCOMP_WITH_MODELLING
    write_modelling(folder);
#endif
#ifdef THERMOCOMP_WITH_GATEWAY
    write_gateway(argv[1], folder);
#endif
    write_formats(argv[1], folder);
    write_run_format(argv[1], folder);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "thermocomp-manual: %s\n", error.what());
    return 1;
  }
  return 0;
}
