#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <iostream>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <unistd.h>
#include <vector>

#include <CLI/CLI.hpp>
#include <system_error>

#include "cli/commands.hpp"
#include "cli/init/init_ask.hpp"
#include "cli/init/init_probe.hpp"
#include "cli/init/init_specs.hpp"
#include "cli/scan/scan_report.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/model/model_file.hpp"
#include "config/toml/toml_text.hpp"
#include "report/files.hpp"
#include "report/terminal.hpp"

namespace thermocomp::cli {
namespace {

namespace fs = std::filesystem;

struct InitOptions {
  std::string file{"/etc/thermocomp/thermocompd.toml"};
  std::vector<std::string> buses;
  std::vector<std::string> modules;
  std::string names;
  std::string controller;
  std::string offset;
  std::string applied;
  std::string valid_bits;
  std::string heartbeat;
  std::vector<std::string> signals;
  std::string axes;
  std::string model;
  double offset_um_max{5.0};
  bool dry_run{false};
  bool no_scan{false};
  bool force{false};
};

bool stdin_is_terminal() {
  return ::isatty(STDIN_FILENO) == 1;
}

/// Absolute folder of the files to be written.
fs::path folder_of(const std::string& file) {
  return fs::absolute(file).lexically_normal().parent_path();
}

void take_model(InitDraft& draft, const InitOptions& options, const fs::path& folder) {
  if (options.model.empty()) return;
  const ThermalModel model = load_model(options.model);
  draft.model_inputs = model.temperature_columns();
  draft.model_signals = model.signal_columns();
  draft.model_outputs = model.outputs;
  const fs::path path = fs::absolute(options.model).lexically_normal();
  draft.model_file = path.parent_path() == folder ? path.filename().string() : path.string();
  if (!options.axes.empty()) return;
  for (const std::string& output : model.outputs)
    draft.axes.push_back(output.substr(0, output.rfind('_')));
}

void take_places(InitController& controller, const InitOptions& options) {
  const auto take = [](const std::string& text, std::optional<InitPlace>& place) {
    if (text == "none") place.reset();
    if (!text.empty() && text != "none") place = parse_place(text);
  };
  if (!options.offset.empty()) controller.offset = parse_place(options.offset);
  take(options.applied, controller.applied);
  take(options.valid_bits, controller.valid_bits);
  take(options.heartbeat, controller.heartbeat);
}

InitDraft draft_of(const InitOptions& options, const fs::path& folder) {
  InitDraft draft;
  draft.offset_um_max = options.offset_um_max;
  for (const std::string& text : options.buses)
    draft.buses.push_back({"bus" + std::to_string(draft.buses.size() + 1), parse_link(text)});
  for (const std::string& text : options.modules) {
    InitModule module = parse_module(text);
    module.name = "module" + std::to_string(draft.modules.size() + 1);
    if (module.bus >= draft.buses.size())
      throw Failure(text + ": no bus " + std::to_string(module.bus + 1) + " (--bus)");
    draft.modules.push_back(std::move(module));
  }
  if (!options.controller.empty()) draft.controller = parse_controller(options.controller);
  take_places(draft.controller, options);
  for (const std::string& text : options.signals)
    draft.controller.signals.push_back(parse_signal(text));
  draft.controller.dry_run = options.dry_run;
  draft.axes = parse_axes(options.axes);
  take_model(draft, options, folder);
  // A configuration in /etc uses the package's folders.
  if (!folder.string().starts_with("/etc/")) draft.own_folder = folder.string();
  return draft;
}

void refuse_what_is_missing(const InitDraft& draft, const InitOptions& options) {
  std::string missing;
  if (draft.buses.empty()) missing += " --bus";
  if (draft.modules.empty()) missing += " --module";
  if (options.controller.empty()) missing += " --controller";
  if (draft.axes.empty()) missing += " --axes";
  if (!missing.empty())
    throw Failure("init: no terminal for questions, and these options are missing:" + missing);
}

/// Selects the channels of presets given without channels, by reading them.
void try_modules(InitDraft& draft, const InitOptions& options, const fs::path& folder) {
  for (InitModule& module : draft.modules) {
    const bool are_chosen = !module.channels.empty();
    if (are_chosen) continue;
    if (options.no_scan) refuse_unnamed_channels(module);
    const std::vector<std::string> lines = try_module(draft, module, folder);
    std::cout << module.name << ", unit " << module.unit << ", " << module.preset << ":\n";
    for (const std::string& line : lines) std::cout << "    " << line << '\n';
    if (module.channels.empty())
      throw Failure(
          "unit " + std::to_string(module.unit) + " (" + module.preset +
              "): no channel gives a temperature; name them to continue anyway, such as " +
              module.preset + ":1-4",
          exit_no);
  }
}

void name_sensors(InitDraft& draft, const std::string& names) {
  std::vector<InitChannel*> unnamed;
  for (InitModule& module : draft.modules)
    for (InitChannel& channel : module.channels)
      if (channel.sensor.empty()) {
        channel.sensor = sensor_name(draft, module, channel.number);
        unnamed.push_back(&channel);
      }
  if (names.empty()) return;
  const std::vector<std::string> given = parse_words(names);
  if (given.size() != unnamed.size()) {
    std::string sensors;
    for (const InitChannel* channel : unnamed) sensors += " " + channel->sensor;
    throw Failure("--names: " + std::to_string(given.size()) + " names for " +
                  std::to_string(unnamed.size()) + " sensors:" + sensors);
  }
  for (std::size_t i = 0; i < given.size(); ++i) unnamed[i]->sensor = given[i];
}

/// A bridge supplies its own signals; other controllers need a place for each.
void refuse_missing_signals(const InitDraft& draft) {
  const InitController& controller = draft.controller;
  const std::vector<std::string> missing = missing_signals(draft);
  if (missing.empty() || !(controller.is_modbus() || controller.kind == "dry_run")) return;
  throw Failure("the model needs " + missing.front() + " from the controller: " +
                (controller.is_modbus()
                     ? "--signal " + missing.front() + "=TABLE:ADDRESS[:TYPE[:SCALE]]"
                     : "give it by --controller (--dry-run writes nothing to it), or use a model "
                       "without signals"));
}

void refuse_missing_sensors(const InitDraft& draft) {
  std::set<std::string> inputs;
  for (const InitModule& module : draft.modules)
    for (const InitChannel& channel : module.channels) inputs.insert(input_name(channel.sensor));
  for (const std::string& input : draft.model_inputs)
    if (!inputs.contains(input))
      throw Failure("the model reads " + input + ": name a sensor " +
                    input.substr(0, input.rfind("_degC")) + " (--names)");
}

/// Keeps a copy of a file that this run overwrites: it may be edited by hand, or a fitted model.
void keep_old(const fs::path& path) {
  std::error_code failed;
  if (!fs::exists(path, failed)) return;
  const fs::path old = path.string() + ".old";
  fs::copy_file(path, old, fs::copy_options::overwrite_existing);
  std::cout << path.string() << ": the one before is " << old.filename().string() << " now\n";
}

void print_next_steps(const InitDraft& draft, const std::string& file) {
  const bool is_own = !draft.own_folder.empty();
  const std::string tool =
      is_own ? "thermocomp --socket " + draft.own_folder + "/status.sock" : "thermocomp";
  std::cout << "\nNext:\n"
            << "  thermocomp check " << file << "\n"
            << "  " << (is_own ? "thermocompd " + file : "systemctl start thermocompd") << "\n"
            << "  " << tool << " sensors     # warm each sensor by hand: its line must move\n";
  if (draft.controller.kind == "linuxcnc")
    std::cout
        << "  thermocomp-linuxcnc hal --help     # the lines for LinuxCNC (docs/linuxcnc.md)\n";
  const bool is_dry = draft.controller.dry_run && draft.controller.kind != "dry_run";
  const std::string_view model =
      draft.model_inputs.empty()
          ? "the model gives no displacement yet: record, measure, fit (docs/first_machine.md)\n"
          : "";
  if (is_dry)
    std::cout << model << "then, to let it move an axis:\n"
              << "  " << tool << " disable\n"
              << "  dry_run = false in " << file << ", restart it\n";
  if (draft.controller.kind != "dry_run")
    std::cout << "  " << tool << " prove " << draft.axes.front()
              << " 5   # with an indicator, every axis\n";
  if (!is_dry) std::cout << model;
  std::cout << "  " << tool
            << " reference   # with the model in place, cold and at an even temperature\n"
            << "  " << tool << " enable\n";
}

/// Reads the draft's places and prints the result; stops reading gaps if the controller refuses.
bool look(InitDraft& draft, const fs::path& folder) {
  ScanReport report = probe(draft, folder);
  if (report.controller && !report.controller->refused.empty()) {
    draft.controller.reads_gaps = false;
    report = probe(draft, folder);
  }
  std::cout << scan_text(report, stdout_is_terminal());
  return is_complete(report);
}

int run_init(const InitOptions& options) {
  const fs::path folder = folder_of(options.file);
  const fs::path model = folder / "model.toml";
  if (!options.force)
    for (const fs::path& each :
         {fs::path(options.file), options.model.empty() ? model : fs::path()})
      if (!each.empty() && fs::exists(each))
        throw Failure(each.string() + ": already exists; --force replaces it");
  const auto settle_modules = [&](InitDraft& draft) {
    try_modules(draft, options, folder);
    name_sensors(draft, options.names);
    refuse_missing_sensors(draft);
  };
  InitDraft given = draft_of(options, folder);
  InitDraft draft;
  Questions questions(std::cin, std::cout);
  const bool is_complete_draft = !given.buses.empty() && !given.modules.empty() &&
                                 !options.controller.empty() && !given.axes.empty();
  if (!is_complete_draft) {
    if (!stdin_is_terminal()) refuse_what_is_missing(given, options);
    questions.print("< goes back to the question before.");
  }
  const bool are_asked_for = given.modules.empty();
  if (!are_asked_for) settle_modules(given);  // from options: cannot be asked again
  MachineQueries eyes = eyes_of(folder);
  if (options.no_scan) eyes.find_units = nullptr;
  if (options.no_scan) eyes.try_module = nullptr;
  questions.interview([&] {
    draft = given;
    if (!is_complete_draft) ask_for_rest(draft, !options.controller.empty(), questions, eyes);
    refuse_missing_signals(draft);
    if (are_asked_for) settle_modules(draft);
    check_draft(draft, folder);
  });
  const bool is_all_there = options.no_scan || look(draft, folder);
  if (draft.model_inputs.empty()) {
    keep_old(model);
    cli::write_file(model.string(), first_model_text(draft));
  }
  keep_old(options.file);
  cli::write_file(options.file, configuration_text(draft));
  const DaemonConfig written = load_daemon_config(options.file);  // throws what `check` reports
  std::cout << options.file << ": written, OK; " << written.estimator.sensors.size() << " sensors";
  if (questions.count() > 0) std::cout << ", " << questions.count() << " questions";
  std::cout << '\n';
  if (!is_all_there)
    std::cout << "Not everything answers yet: see above, then thermocomp scan " << options.file
              << '\n';
  print_next_steps(draft, options.file);
  return is_all_there ? exit_success : exit_no;
}

}  // namespace

void add_init_command(CLI::App& app, Action& action) {
  CLI::App* sub =
      app.add_subcommand("init",
                         "writes a first configuration: asks for buses, modules, controller and "
                         "axes (or takes options), reads them like scan, and lists what is "
                         "missing; exit status 1: written, but not everything answers yet");
  const auto options = std::make_shared<InitOptions>();
  sub->add_option("FILE", options->file,
                  "the configuration; outside of /etc its state, history and socket are placed "
                  "next to it (default /etc/thermocomp/thermocompd.toml)")
      ->type_name("FILE");
  sub->add_option(
         "--bus", options->buses,
         std::string("a Modbus bus of modules: ") + link_forms + "; may be given several times")
      ->type_name("BUS");
  sub->add_option(
         "--module", options->modules,
         "UNIT=PRESET[/THERMOCOUPLE][@BASE][:CHANNELS], or without a preset "
         "UNIT=TABLE:TYPE:DEGC_A_COUNT:ADDRESSES[:OPEN_CIRCUIT_CODES]; BUS/UNIT=... on "
         "another bus than the first. Default of CHANNELS: all that have a temperature now")
      ->type_name("MODULE");
  sub->add_option("--names", options->names,
                  "comma-separated names of the sensors, in order of modules and channels")
      ->type_name("NAMES");
  sub->add_option("--controller", options->controller,
                  "a line as of a bus and [@UNIT], linuxcnc or none; registers as in "
                  "docs/controllers/plc.md")
      ->type_name("WHERE");
  sub->add_option("--offset", options->offset,
                  "place of the first axis' offset in the controller; the others follow it: "
                  "TABLE:ADDRESS:TYPE:UM_A_COUNT (default holding:0:int32:0.01)")
      ->type_name("PLACE");
  sub->add_option("--applied", options->applied,
                  "read-back of the applied offset, or none (default input:0:int32:0.01)")
      ->type_name("PLACE");
  sub->add_option("--valid-bits", options->valid_bits,
                  "valid bits, or none (default holding:10:uint16)")
      ->type_name("PLACE");
  sub->add_option("--heartbeat", options->heartbeat,
                  "heartbeat, or none (default holding:11:uint16)")
      ->type_name("PLACE");
  sub->add_option("--signal", options->signals,
                  "further values to read from the controller, NAME=TABLE:ADDRESS[:TYPE[:SCALE]]")
      ->type_name("SIGNAL");
  sub->add_option("--axes", options->axes, "comma-separated axes that get an offset")
      ->type_name("AXES");
  sub->add_option("--model", options->model,
                  "an existing model; default: write one that gives no displacement yet")
      ->type_name("FILE");
  sub->add_option("--offset-um-max", options->offset_um_max,
                  "bound of every axis (default 5, small for a start)")
      ->check(CLI::Range(0.001, 500.0));
  sub->add_flag("--dry-run", options->dry_run,
                "write dry_run = true: the daemon reads the controller and writes nothing to it");
  sub->add_flag("--no-scan", options->no_scan, "read no bus; channels must then be named");
  sub->add_flag("--force", options->force, "replace existing files; each is kept as FILE.old");
  sub->callback([&action, options] { action = [options] { return run_init(*options); }; });
}

}  // namespace thermocomp::cli
