/// The daemon's configuration with its model: refusals name their cause; after loading, the
/// daemon's parts can be made and the estimator steps.
///
/// Input: the text of the configuration, a line "#### model", the text of the model file.
#include "config/daemon/daemon_config.hpp"

#include <chrono>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "common/fuzz.hpp"
#include "common/model_properties.hpp"
#include "drivers/controllers/kinds/make_controller.hpp"
#include "drivers/sensors/make_source.hpp"
#include "estimator/pipeline/estimator.hpp"

using namespace thermocomp;

namespace {

constexpr std::string_view model_border = "#### model\n";
constexpr const char* config_name = "/etc/thermocompd.toml";
constexpr const char* model_name = "/etc/model.toml";

void make_parts(const DaemonConfig& config) {
  for (const BusConfig& bus : config.buses) {
    FUZZ_REQUIRE(make_source(bus)->health().units.size() == outline_of(bus).units);
  }
  FUZZ_REQUIRE(make_controller(config.controller) != nullptr);
}

void step_some(const DaemonConfig& config) {
  Estimator estimator(config.estimator, config.model);
  Report report = estimator.make_report();
  std::vector<Reading> readings(config.estimator.sensors.size());
  ControllerState controller;
  controller.online = true;
  controller.written = controller.online;
  controller.link_epoch = 1;
  OffsetCommand command;
  nanoseconds now = std::chrono::hours(1);
  for (int cycle = 0; cycle < 20; ++cycle) {
    for (Reading& reading : readings) reading = {20.0 + cycle, now, Fault::none};
    controller.taken_at = now;
    for (std::size_t i = 0; i < config.estimator.axes.size(); ++i) {
      controller.applied_um[i] = command.offset_um[i];
    }
    for (std::size_t i = 0; i < config.estimator.signals.size(); ++i) controller.signals[i] = 0.0;
    if (cycle == 10) estimator.apply({CommandKind::reference, 0, 0.0});
    estimator.step(now, readings, controller, command);
    for (std::size_t i = 0; i < config.estimator.axes.size(); ++i) {
      const double bound_um = config.estimator.axes[i].limiter.offset_um_max;
      FUZZ_REQUIRE(std::abs(command.offset_um[i]) <= bound_um);
    }
    now += std::chrono::milliseconds(100);
  }
  estimator.report(report);
  std::vector<std::byte> state(estimator.state_size_bytes());
  estimator.save_state(state);
  estimator.load_state(state);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t at = text.find(model_border);
  const std::string config_text = text.substr(0, at);
  const std::string model_text =
      at == std::string::npos ? "" : text.substr(at + model_border.size());
  DaemonConfig config;
  try {
    config = parse_daemon_config(config_text, config_name, model_text, model_name);
  } catch (const ConfigurationError& error) {
    const fuzz::NamedText files[] = {{config_name, config_text}, {model_name, model_text}};
    fuzz::check_problems(error.problems(), files);
    return 0;
  }
  FUZZ_REQUIRE(config.text == config_text && config.model_text == model_text);
  FUZZ_REQUIRE(restart_needed(config, config).empty());
  fuzz::check_steps(config.model);
  make_parts(config);
  step_some(config);
  return 0;
}
