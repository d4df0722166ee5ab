#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>

#include "cli/check/register_table.hpp"
#include "cli/commands.hpp"
#include "config/daemon/daemon_config.hpp"
#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "config/text/units.hpp"
#include "drivers/sensors/bus_config.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/travel_curves.hpp"
#include "gateway/settings/gateway_settings.hpp"
#include "status/figures.hpp"

namespace thermocomp::cli {

namespace {

constexpr double rise_K = 10.0;
/// Evenly spaced samples, in addition to the kinks of piecewise linear curves.
constexpr std::size_t even_places = 201;

struct Deviation {
  double um{0.0};
  double at_mm{0.0};
  double range_um{0.0};  ///< of the model's curve over the travel
};

class Deviations {
 public:
  Deviations(const DaemonConfig& config, const AxisSpan& span)
      : nodes_(std::span(config.estimator.axes).subspan(span.first, span.count)),
        model_(config.model),
        columns_(config.model.temperature_columns()),
        signal_(node_places(config.estimator, config.model)[span.first].signal),
        signals_(config.model.signal_columns().size(), 0.0),
        outputs_um_(config.model.outputs.size()) {
    const auto& outputs = config.model.outputs;
    output_ = static_cast<std::size_t>(std::find(outputs.begin(), outputs.end(), nodes_[0].output) -
                                       outputs.begin());
    EstimatorConfig alone;
    alone.axes.assign(nodes_.begin(), nodes_.end());
    curves_.emplace(alone, config.model);
    at_mm_ =
        travel_samples_mm(config.model, nodes_[0].node->position, nodes_.front().node->position_mm,
                          nodes_.back().node->position_mm, even_places);
  }

  [[nodiscard]] const std::vector<std::string>& columns() const { return columns_; }

  /// @param column  the temperature that is rise_K warmer; columns().size(): all of them
  [[nodiscard]] Deviation of(std::size_t column) {
    DisplacementModel model(model_);
    const std::vector<double> reference_degC(columns_.size(), 20.0);
    std::vector<double> temps_degC = reference_degC;
    for (std::size_t i = 0; i < temps_degC.size(); ++i)
      if (i == column || column == columns_.size()) temps_degC[i] += rise_K;
    const auto at = [&](std::span<const double> signals, std::span<double> out_um) {
      model.step(nanoseconds{}, temps_degC, reference_degC, signals, out_um);
    };
    std::vector<double> node_um(nodes_.size());
    curves_->step(at, signals_, node_um);
    Deviation found;
    double low_um = node_um[0];
    double high_um = node_um[0];
    for (const double position_mm : at_mm_) {
      signals_[signal_] = position_mm;
      at(signals_, outputs_um_);
      const double curve_um = outputs_um_[output_];
      low_um = std::min(low_um, curve_um);
      high_um = std::max(high_um, curve_um);
      const double off_um = std::abs(curve_um - value_on_travel(nodes_, node_um, position_mm));
      if (off_um <= found.um) continue;
      found.um = off_um;
      found.at_mm = position_mm;
    }
    found.range_um = high_um - low_um;
    return found;
  }

 private:
  std::span<const AxisConfig> nodes_;
  const ThermalModel& model_;
  std::vector<std::string> columns_;
  std::size_t signal_;
  std::size_t output_{0};
  std::vector<double> signals_;
  std::vector<double> outputs_um_;
  std::optional<TravelCurves> curves_;
  std::vector<double> at_mm_;
};

std::string hundredths(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.2f", value);
  return text.data();
}

/// "2.50 um of 40.00 um"
std::string size_text(const Deviation& deviation, const std::string& unit) {
  std::string text = hundredths(deviation.um);
  text.append(" ").append(unit).append(" of ").append(hundredths(deviation.range_um));
  return text.append(" ").append(unit);
}

/// "a line over x_mm 0 to 800 mm"
std::string form_text(std::span<const AxisConfig> nodes) {
  const TravelNode& first = *nodes.front().node;
  std::string text("a line");
  if (first.form == TravelForm::table) {
    text = "a table of ";
    text.append(std::to_string(nodes.size())).append(" nodes");
  }
  text.append(" over ").append(first.position).append(" ");
  text.append(number_text(first.position_mm)).append(" to ");
  return text.append(number_text(nodes.back().node->position_mm)).append(" mm");
}

std::string span_text(const DaemonConfig& config, const AxisSpan& span) {
  const auto nodes = std::span(config.estimator.axes).subspan(span.first, span.count);
  const std::string unit(unit_of(nodes.front().output).symbol);
  Deviations deviations(config, span);
  const Deviation all = deviations.of(deviations.columns().size());
  Deviation worst;
  std::string column;
  for (std::size_t i = 0; i < deviations.columns().size(); ++i) {
    const Deviation alone = deviations.of(i);
    if (!column.empty() && alone.um <= worst.um) continue;
    worst = alone;
    column = deviations.columns()[i];
  }
  std::string text("axis ");
  text.append(axis_name(nodes.front())).append(": ").append(form_text(nodes));
  text.append("; largest deviation from the model's curve for 10 K: ");
  text.append(size_text(all, unit)).append(" (all temperatures)");
  if (deviations.columns().size() > 1) {
    text.append(", ").append(size_text(worst, unit)).append(" at ");
    text.append(number_text(worst.at_mm)).append(" mm (").append(column).append(" alone)");
  }
  return text.append("\n");
}

/// One line for each axis whose controller interpolates: the largest deviation of its line or table
/// from the model's curve when one temperature or all are 10 K warmer. Empty: none.
std::string travel_deviation_text(const DaemonConfig& config) {
  std::string text;
  for (const AxisSpan& span : axis_spans(config.estimator.axes))
    if (config.estimator.axes[span.first].node) text += span_text(config, span);
  return text;
}

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

/// Describes the supervision of sensors whose neighbours contradict them.
std::string watch_text(const DaemonConfig& config) {
  const SuspectedPolicy policy = config.estimator.compensation.suspected_sensors;
  if (policy == SuspectedPolicy::off)
    return "sensors that creep or jump: not watched, by suspected_sensors = \"off\"";
  if (config.model.covariance_K2.empty())
    return "sensors that creep or jump: NOT watched, since the model has no [covariance] "
           "(thermocomp covariance makes it)";
  return policy == SuspectedPolicy::warn ? "sensors that creep or jump: reported"
                                         : "sensors that creep or jump: reported, and not used";
}

/// States how well the model fits a machine, according to its file.
std::string comparison_text(const ThermalModel& model) {
  if (!is_compared(model))
    return "compared: NEVER, according to the model file (no [made_from] with errors on left-out "
           "rows): size and sign may be wrong";
  std::string text("compared: left on rows that it was not fitted to");
  for (const auto& [name, output] : model.made_from->outputs)
    text += ", " + name + " " + fixed(output.left_out_rms_um, 1) + " rms of " +
            fixed(output.no_model_rms_um, 1);
  return text;
}

/// The signals of the controller's switch and of cutting, a line each.
std::string switches_text(const CompensationConfig& config) {
  const auto text = [](const std::string& what, const std::string& signal, const char* key) {
    return what + ": " +
           (signal.empty() ? std::string("none (compensation.") + key + ")" : signal) + "\n";
  };
  return text("the controller's switch", config.disable_signal, "disable_signal") +
         text("signal of cutting", config.cutting_signal, "cutting_signal");
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
            << switches_text(estimator.compensation) << "model " << config.model_file.string()
            << ": " << counted(config.model.inputs.size(), "input") << ", "
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
  std::string allowed = settings.commands.users.empty() ? "none" : "";
  for (const std::string& method : settings.commands.methods)
    allowed += (allowed.empty() ? "" : ", ") + method;
  std::cout << "gateway of machine " << settings.machine << ", daemon at "
            << settings.socket.string() << '\n'
            << door_text(settings.http) << '\n'
            << "commands: " << allowed << '\n'
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
    constexpr std::size_t shown_max = 100;  // a further line gives the number left out
    std::fprintf(stderr, "%s: %s\n", file.c_str(),
                 count > shown_max ? "more than 100 problems" : counted(count, "problem").c_str());
    return exit_error;
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
  sub->add_flag(
      "--registers", options->registers,
      "lists what the controller must provide: every register or bit, its unit, and its writer");
  sub->callback([&action, options] { action = [options] { return run_check(*options); }; });
}

}  // namespace thermocomp::cli
