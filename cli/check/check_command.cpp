#include "cli/check/check_command.hpp"

#include <algorithm>
#include <cstdio>
#include <iostream>
#include <memory>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "cli/check/register_table.hpp"
#include "cli/check/travel_deviation.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/text/problems.hpp"
#include "drivers/sensors/bus_config.hpp"
#include "estimator/axis_spans.hpp"
#include "gateway/settings/gateway_settings.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {

namespace {

std::string counted(std::size_t count, const char* what) {
  return std::to_string(count) + " " + what + (count == 1 ? "" : "s");
}

std::string own_kind(const ControllerConfig& controller) {
  if (const auto* modbus = std::get_if<ModbusControllerConfig>(&controller)) {
    return modbus->name + " (" + std::string(kind_of(modbus->line)) + ")";
  }
  if (const auto* can = std::get_if<CanControllerConfig>(&controller)) {
    return can->name + " (can)";
  }
  if (const auto* bridge = std::get_if<BridgeControllerConfig>(&controller)) {
    return bridge->name + " (linuxcnc: its bridge calls the daemon)";
  }
  return std::get<DryRunControllerConfig>(controller).name + " (none)";
}

std::string controller_kind(const DaemonConfig& config) {
  return own_kind(config.controller) +
         (config.dry_run ? ", DRY RUN: nothing is written to it" : "");
}

template <class Names>
std::string list_names(const Names& items) {
  std::string result;
  for (const auto& item : items) result += (result.empty() ? "" : ", ") + item.name;
  return result;
}

/// "x (half of dia_um), y (2 nodes), z"
std::string list_axes(const DaemonConfig& config) {
  const std::vector<AxisConfig>& axes = config.estimator.axes;
  std::string result;
  for (const AxisSpan& span : axis_spans(axes)) {
    result += (result.empty() ? "" : ", ") + axis_name(axes[span.first]);
    if (const DiameterSpec* diameter = diameter_of(config.model, axes[span.first].output))
      result += " (" + half_of(*diameter) + ")";
    if (axes[span.first].node) result += " (" + counted(span.count, "node") + ")";
  }
  return result;
}

/// Sensors that the model gets nothing from; empty where there is none.
std::string unused_sensors_text(const EstimatorConfig& config) {
  std::string names;
  for (std::size_t i = 0; i < config.sensors.size(); ++i) {
    const bool is_used =
        std::any_of(config.blocks.begin(), config.blocks.end(),
                    [i](const BlockConfig& block) {
                      return std::find(block.sensors.begin(), block.sensors.end(), i) !=
                             block.sensors.end();
                    }) ||
        std::any_of(config.sensors.begin(), config.sensors.end(),
                    [i](const SensorConfig& other) { return other.reference_sensor == i; });
    if (!is_used) names += (names.empty() ? "" : ", ") + config.sensors[i].name;
  }
  if (names.empty()) return {};
  return "in no block: " + names + " (recorded, but nothing is computed from it)\n";
}

/// Whether sensors are watched that read what their neighbours contradict.
std::string watch_text(const DaemonConfig& config) {
  const SuspectedPolicy policy = config.estimator.compensation.suspected_sensors;
  if (policy == SuspectedPolicy::off)
    return "sensors that creep or jump: not watched, by suspected_sensors = \"off\"";
  if (config.model.covariance_K2.empty())
    return "sensors that creep or jump: NOT watched, since the model has no [covariance] "
           "(thermocomp covariance makes it)";
  return policy == SuspectedPolicy::warn ? "sensors that creep or jump: told"
                                         : "sensors that creep or jump: told, and not used";
}

/// What the model file says of how well it fits a machine.
std::string comparison_text(const ThermalModel& model) {
  if (!is_compared(model))
    return "compared: NEVER, as far as the model file says (no [made_from] with errors on rows "
           "left "
           "out): size and sign may be those of no machine";
  std::string text("compared: left on rows that it was not fitted to");
  for (const auto& [name, output] : model.made_from->outputs)
    text += ", " + name + " " + fixed(output.left_out_rms_um, 1) + " rms of " +
            fixed(output.no_model_rms_um, 1);
  return text;
}

std::string first_start_text(const DaemonConfig& config) {
  const bool is_enabled = config.estimator.compensation.enabled_at_first_start;
  if (is_enabled && config.dry_run)
    return "first start: switched on, in a dry run: nothing is written";
  if (is_enabled)
    return "first start: COMPENSATES AT ONCE (compensation.enabled_at_first_start = true)";
  return "first start: switched off until `thermocomp enable`";
}

void print_what_was_found(const DaemonConfig& config) {
  const EstimatorConfig& estimator = config.estimator;
  for (const BusConfig& bus : config.buses) {
    const BusOutline outline = outline_of(bus);
    std::cout << "bus " << name_of(bus) << " (" << outline.kind
              << (outline.interface.empty() ? "" : ", ")
              << outline.interface << "): " << counted(outline.units, outline.unit_called) << '\n';
  }
  std::cout << counted(estimator.sensors.size(), "sensor") << ": " << list_names(estimator.sensors)
            << '\n'
            << counted(estimator.blocks.size(), "block") << ": " << list_names(estimator.blocks)
            << '\n'
            << unused_sensors_text(estimator) << "axes: " << list_axes(config) << '\n'
            << "controller " << controller_kind(config) << ", "
            << counted(estimator.signals.size(), "signal") << '\n'
            << "model " << config.model_file.string() << ": "
            << counted(config.model.inputs.size(), "input") << ", "
            << counted(config.model.outputs.size(), "output") << ", "
            << counted(config.model.terms.size(), "extension term") << ", SHA-256 "
            << config.model_checksum << '\n'
            << travel_deviation_text(config) << comparison_text(config.model) << '\n'
            << watch_text(config) << '\n'
            << first_start_text(config) << '\n'
            << config.file.string() << ": OK\n";
}

std::string door_text(const gateway::HttpSettings& http) {
  if (!http.enabled) return "http: off";
  return "http: " + http.address + " port " + std::to_string(http.port) +
         (http.has_tls() ? ", TLS" : ", no TLS") +
         (http.passwords.empty() ? ", no passwords" : ", passwords");
}

void print_gateway(const gateway::GatewaySettings& settings) {
  const gateway::MqttSettings& mqtt = settings.mqtt;
  const gateway::ShdrSettings& shdr = settings.shdr;
  std::string commands = settings.commands.users.empty() ? "none" : "";
  for (const std::string& method : settings.commands.methods)
    commands += (commands.empty() ? "" : ", ") + method;
  std::cout << "gateway of machine " << settings.machine << ", daemon at "
            << settings.socket.string() << '\n'
            << door_text(settings.http) << '\n'
            << "commands: " << commands << '\n'
            << "mqtt: "
            << (mqtt.enabled ? mqtt.host + " port " + std::to_string(mqtt.port) +
                                   (mqtt.authority.empty() ? ", no TLS" : ", TLS")
                             : "off")
            << '\n'
            << "shdr: "
            << (shdr.enabled ? shdr.address + " port " + std::to_string(shdr.port) : "off") << '\n'
            << "alarm command: "
            << (settings.alarm.command.empty() ? "none" : settings.alarm.command.front()) << '\n'
            << settings.file.string() << ": OK\n";
}

struct CheckOptions {
  std::string file;
  bool registers{false};
};

int run_check(const CheckOptions& options) {
  const std::string& file = options.file;
  try {
    if (gateway::is_gateway_file(file)) {
      print_gateway(gateway::load_gateway_settings(file));
      return exit_success;
    }
    const DaemonConfig config = load_daemon_config(file);
    for (const std::string& remark : config.remarks)
      std::fprintf(stderr, "warning: %s\n", remark.c_str());
    if (options.registers)
      std::cout << register_table(config);
    else
      print_what_was_found(config);
  } catch (const ConfigurationError& error) {
    const std::size_t count = error.problems().size();
    std::fprintf(stderr, "%s\n", error.what());
    constexpr std::size_t told_max = 100;  // the line after them says how many more there are
    std::fprintf(stderr, "%s: %s\n", file.c_str(),
                 count > told_max ? "more than 100 problems" : counted(count, "problem").c_str());
    return exit_bad_use;
  }
  return exit_success;
}

}  // namespace

void add_check_command(CLI::App& app, Action& action) {
  CLI::App* sub = app.add_subcommand(
      "check", "a daemon's configuration with its model, or a gateway's: every problem at once");
  const auto options = std::make_shared<CheckOptions>();
  sub->add_option("CONFIG", options->file, "configuration of thermocompd or thermocomp-gateway")
      ->type_name("FILE")
      ->required();
  sub->add_flag("--registers", options->registers,
                "what the controller's side must provide: every register or bit, its unit, and who "
                "writes it");
  sub->callback([&action, options] { action = [options] { return run_check(*options); }; });
}

}  // namespace thermocomp::cli
