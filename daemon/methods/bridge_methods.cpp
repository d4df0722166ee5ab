#include <cmath>

#include <nlohmann/json.hpp>

#include "daemon/methods/methods.hpp"
#include "daemon/socket/rpc.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;

/// Plausibility limit: no position, speed or offset of a machine is larger.
constexpr double magnitude_max = 1e9;

[[noreturn]] void invalid(const std::string& why) {
  throw RpcError(rpc::invalid_params, why);
}

double number_or_null(const json& value, const std::string& name) {
  if (value.is_null()) return not_a_number;
  const double number = value.is_number() ? value.get<double>() : not_a_number;
  // Negated: NaN is refused too.
  if (!(std::abs(number) <= magnitude_max))
    invalid(name + " must be null or a number within +-1e9");
  return number;
}

const json& table(const json& params, const char* key) {
  const auto found = params.find(key);
  if (found == params.end() || !found->is_object())
    invalid(std::string("params.").append(key).append(" must be an object"));
  return *found;
}

BridgeReport read_report(const BridgeControllerConfig& config, const json& params) {
  for (const auto& [key, value] : params.items())
    if (key != "session" && key != "taking" && key != "applied_um" && key != "signals")
      invalid("controller_state takes session, taking, applied_um and signals");
  BridgeReport report;
  const json session = params.value("session", json());
  if (!session.is_number_integer() || session <= 0)
    invalid("params.session must be a whole number from 1");
  report.session = session.get<std::uint64_t>();
  const json taking = params.value("taking", json());
  if (!taking.is_boolean()) invalid("params.taking must be true or false");
  report.taking = taking.get<bool>();
  const json& applied = table(params, "applied_um");
  for (const auto& [name, value] : applied.items()) number_or_null(value, "applied_um." + name);
  for (std::size_t i = 0; i < config.axes.size(); ++i) {
    const auto axis = applied.find(config.axes[i]);
    if (axis == applied.end()) invalid("the bridge does not report axis " + config.axes[i]);
    report.applied_um[i] = number_or_null(*axis, config.axes[i]);
  }
  const json& signals = table(params, "signals");
  for (const auto& [name, value] : signals.items()) number_or_null(value, "signals." + name);
  for (std::size_t i = 0; i < config.signals.size(); ++i) {
    const auto signal = signals.find(config.signals[i]);
    if (signal == signals.end()) invalid("the bridge does not report " + config.signals[i]);
    report.signals[i] = number_or_null(*signal, config.signals[i]);
  }
  return report;
}

}  // namespace

json answer_bridge(BridgeController& bridge, const BridgeControllerConfig& config,
                   std::string_view mode, const json& params) {
  BridgeReport report;
  try {
    report = read_report(config, params);
  } catch (const RpcError& error) {
    bridge.refuse(error.what());
    throw;
  }
  const std::optional<BridgeAnswer> answer = bridge.report(report);
  if (!answer) throw RpcError(rpc::refused, "another bridge is reporting");
  json offsets = json::object();
  for (std::size_t i = 0; i < config.axes.size(); ++i)
    offsets[config.axes[i]] = answer->valid[i] ? json(answer->offset_um[i]) : json(nullptr);
  return {{"epoch", answer->link_epoch},
          {"anew", answer->anew},
          {"mode", mode},
          {"offsets_um", offsets}};
}

}  // namespace thermocomp
