#include <algorithm>
#include <chrono>
#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>

#include "config/text/printable_text.hpp"
#include "config/text/problems.hpp"
#include "daemon/methods/methods.hpp"
#include "daemon/status/reference_rules.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/learning/probings.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;

/// Finds an axis by its name; an axis with nodes also by the name of one of them.
/// @return the first of its entries
std::uint32_t axis_index(const StatusView& view, const json& params) {
  if (!params.contains("axis") || !params["axis"].is_string())
    throw RpcError(rpc::invalid_params, "params.axis must be the name of an axis");
  const auto name = params["axis"].get<std::string>();
  std::string known;
  const std::vector<AxisConfig>& axes = view.config.estimator.axes;
  for (const AxisSpan& span : axis_spans(axes)) {
    for (std::size_t i = span.first; i < span.end(); ++i)
      if (axes[i].name == name || axis_name(axes[i]) == name)
        return static_cast<std::uint32_t>(span.first);
    known += (known.empty() ? "" : ", ") + axis_name(axes[span.first]);
  }
  throw RpcError(rpc::invalid_params, "axis " + name + " does not exist; there is " + known);
}

double value_um(const json& params) {
  if (!params.contains("value_um") || !params["value_um"].is_number() ||
      !std::isfinite(params["value_um"].get<double>()))
    throw RpcError(rpc::invalid_params, "params.value_um must be a finite number");
  return params["value_um"].get<double>();
}

/// True if the flag is set for any node of the axis.
bool any_node(const StatusView& view, std::size_t axis, bool AxisReport::*is_so) {
  const AxisSpan span = span_of(view.config.estimator.axes, axis);
  for (std::size_t i = span.first; i < span.end(); ++i)
    if (view.report.axes[i].*is_so) return true;
  return false;
}

/// A value of the axis, interpolated at the slide's position if the axis has nodes.
template <class Figure>
double figure_at_position(const StatusView& view, std::size_t axis, Figure figure) {
  const AxisSpan span = span_of(view.config.estimator.axes, axis);
  if (span.count == 1) return figure(view.report.axes[axis]);
  std::vector<double> nodes;
  for (std::size_t i = span.first; i < span.end(); ++i)
    nodes.push_back(figure(view.report.axes[i]));
  const std::vector<std::string> signals = view.config.model.signal_columns();
  const auto signal =
      std::find(signals.begin(), signals.end(), view.config.estimator.axes[axis].node->position);
  const double position_mm =
      view.report.signals[static_cast<std::size_t>(signal - signals.begin())].value;
  return value_on_travel(std::span(view.config.estimator.axes).subspan(span.first, span.count),
                         nodes, position_mm);
}

void refuse_unless(bool holds, const std::string& why) {
  if (!holds) throw RpcError(rpc::refused, why);
}

RpcPending then(RpcPending pending, std::function<json()> result) {
  return [pending = std::move(pending), result = std::move(result)]() -> std::optional<json> {
    if (!pending()) return std::nullopt;
    return result();
  };
}

bool flag_in(const json& params, const char* key) {
  if (!params.contains(key)) return false;
  if (!params[key].is_boolean())
    throw RpcError(rpc::invalid_params, fmt::format("params.{} must be true or false", key));
  return params[key].get<bool>();
}

RpcPending take_reference(const DaemonActions& actions, const json& params) {
  const auto view = actions.view();
  const bool forced = flag_in(params, "force");
  const auto lost =
      fmt::to_string(fmt::join(lost_for_reference(view.config.model, view.report), "; "));
  refuse_unless(lost.empty(), "no reference can be taken: " + lost);
  const auto why = fmt::to_string(fmt::join(
      against_reference(view.config, view.report, view.controller_health, view.trend), "; "));
  refuse_unless(why.empty() || forced, "no reference is taken: " + why);
  return then(actions.command({CommandKind::reference, 0, 0.0}),
              [why, watched = watched_s(view.report, view.trend)] {
                return json{{"done", true}, {"watched_s", watched}, {"although", why}};
              });
}

/// Refuses a measured displacement that differs from the expected one by more than the axis' bound
/// plus three claimed standard deviations: a typing error, a wrong unit or a wrong axis.
/// @param expected_um  of the model; NaN (unknown) counts as 0
void require_possible(const StatusView& view, const Command& command, double expected_um) {
  const AxisSpan span = span_of(view.config.estimator.axes, command.axis);
  double allowed_um = 0.0;
  for (std::size_t i = span.first; i < span.end(); ++i) {
    const double sd_um = view.report.axes[i].claimed_sd_um;
    allowed_um = std::max(allowed_um, view.config.estimator.axes[i].limiter.offset_um_max +
                                          (std::isfinite(sd_um) ? 3.0 * sd_um : 0.0));
  }
  const double from_um = std::isfinite(expected_um) ? expected_um : 0.0;
  if (!(std::abs(command.value_um - from_um) <= allowed_um))
    throw RpcError(
        rpc::invalid_params,
        fmt::format(
            "value refused: {:g} um measured, {:.1f} um expected by the model; the axis' bound and "
            "three times the model's claimed error allow a difference of {:.1f} um. Check axis, "
            "sign and unit; if it is right, the axis needs a larger offset_um_max",
            command.value_um, from_um, allowed_um));
}

/// A number of the request; `otherwise` if the key is missing.
double number_in(const json& params, const char* key, double low, double high, double otherwise) {
  if (!params.contains(key)) return otherwise;
  const json& value = params[key];
  if (!value.is_number() || !(value.get<double>() >= low && value.get<double>() <= high))
    throw RpcError(rpc::invalid_params,
                   fmt::format("params.{} must be a number in [{:g}, {:g}]", key, low, high));
  return value.get<double>();
}

MeasuredSource source_in(const json& params) {
  if (!params.contains("source")) return MeasuredSource::probe;
  for (const auto source : {MeasuredSource::probe, MeasuredSource::part, MeasuredSource::wear})
    if (params["source"] == to_string(source)) return source;
  throw RpcError(rpc::invalid_params, "params.source must be probe, part or wear");
}

Command measured_command(const StatusView& view, const json& params) {
  // A part has further errors: clamping, the tool's edge, the gauge.
  constexpr double part_by_probe = 2.0;
  Command command{CommandKind::measured, axis_index(view, params), value_um(params)};
  command.source = source_in(params);
  const CorrectionConfig& correction = view.config.estimator.correction;
  const bool is_probe = command.source == MeasuredSource::probe;
  const double sd_um = number_in(params, "sd_um", 0.001, 1000.0,
                                 is_probe ? 0.0 : part_by_probe * correction.noise_um);
  command.sd_nm = static_cast<std::uint32_t>(std::lround(1e3 * sd_um));
  constexpr auto ago_s_max = static_cast<double>(
      std::chrono::seconds(Probings::past_pitch * (Probings::past_moments - 1)).count());
  command.ago_s =
      static_cast<std::uint32_t>(std::lround(number_in(params, "ago_s", 0.0, ago_s_max, 0.0)));
  refuse_unless((command.source != MeasuredSource::wear && command.ago_s == 0) ||
                    correction.measured == MeasuredMeaning::remaining,
                "a value measured on a part, or at an earlier time, needs [correction] measured = "
                "\"remaining\"");
  const double known_s = view.report.remembered_s;
  refuse_unless(command.ago_s <= known_s,
                fmt::format("the axis' state {:.0f} min ago is unknown: the daemon keeps the last "
                            "{:.0f} min since the start or the reference, and nothing with "
                            "[correction] form = \"off\"",
                            command.ago_s / 60.0, known_s / 60.0));
  return command;
}

/// Refuses a value that contradicts the model's claimed error until the operator confirms it.
void ask_back(const StatusView& view, const Command& command, double expected_um,
              const json& params) {
  const bool is_confirmed = flag_in(params, "confirm");
  const AxisReport& axis = view.report.axes[command.axis];
  // The larger of claimed error and RMS error of probings.
  const double claimed_um = std::isfinite(axis.probed_rms_um) && std::isfinite(axis.claimed_sd_um)
                                ? std::max(axis.probed_rms_um, axis.claimed_sd_um)
                                : axis.claimed_sd_um;
  const double own_um =
      command.sd_nm > 0 ? 1e-3 * command.sd_nm : view.config.estimator.correction.noise_um;
  const double sd_um = std::hypot(claimed_um, own_um);
  const EntryError entry_error = entry_error_of(command.value_um, expected_um, sd_um);
  if (entry_error == EntryError::none || is_confirmed) return;
  throw RpcError(
      rpc::refused,
      fmt::format("not confirmed, value refused: {:+g} um measured, {:+.1f} +-{:.1f} um (1 sd) "
                  "expected; {}. If it is correct, repeat it with --confirm",
                  command.value_um, expected_um, sd_um, text_of(entry_error)));
}

RpcPending note_measured(const DaemonActions& actions, const json& params) {
  const auto view = actions.view();
  const Command command = measured_command(view, params);
  const double displacement_um = figure_at_position(
      view, command.axis, [](const AxisReport& axis) { return axis.displacement_um; });
  const bool remains = view.config.estimator.correction.measured == MeasuredMeaning::remaining;
  refuse_unless(!remains || !has_reason(view.report.reasons, Reason::controller_offline),
                "the controller is away, so the offset in effect is unknown: measure once it is "
                "back");
  const double applied_um = figure_at_position(view, command.axis, [](const AxisReport& axis) {
    return std::isfinite(axis.applied_um) ? axis.applied_um : axis.offset_um;
  });
  const double effect_um = view.config.estimator.axes[command.axis].sign * applied_um;
  // Expected at the tool if the model is right: displacement less compensation by the offset.
  const double left_um = displacement_um + effect_um;
  const double expected_um = remains ? left_um : displacement_um;
  // A model of zeros expects nothing; without a correction nothing is learned from the value.
  if (has_gain(view.config.model) || view.config.estimator.correction.form != CorrectionForm::off) {
    require_possible(view, command, expected_um);
    ask_back(view, command, expected_um, params);
  }
  return then(actions.command(command), [command, displacement_um, remains, left_um] {
    return json{
        {"done", true},
        {"measured_um", command.value_um},
        {"meaning", remains ? "remaining" : "total"},
        {"source", to_string(command.source)},
        {"sd_um", command.sd_nm > 0 ? json(1e-3 * command.sd_nm) : json(nullptr)},
        {"predicted_um", std::isfinite(displacement_um) ? json(displacement_um) : json(nullptr)},
        {"predicted_remaining_um", std::isfinite(left_um) ? json(left_um) : json(nullptr)}};
  });
}

RpcPending prove(const DaemonActions& actions, const json& params) {
  const auto view = actions.view();
  const Command command{CommandKind::prove, axis_index(view, params), value_um(params)};
  refuse_unless(!view.config.dry_run,
                "a dry run writes nothing: no axis would move. Take dry_run out of [controller] "
                "and restart first");
  const double most_um = view.config.estimator.compensation.prove_um_max;
  refuse_unless(command.value_um != 0.0, "a proving move of 0 shows nothing");
  refuse_unless(
      std::abs(command.value_um) <= most_um,
      "a proving move is at most " + json(most_um).dump() + " um (compensation.prove_um_max)");
  const AxisReport& axis = view.report.axes[command.axis];
  refuse_unless(!axis.latched, "the axis is not driven: its mismatch is latched; release it first");
  refuse_unless(axis.driven && !has_reason(view.report.reasons, Reason::controller_offline),
                "the axis is not driven: the controller is offline or not in step");
  refuse_unless(!any_node(view, command.axis, &AxisReport::proving),
                "the axis is being proved already");
  refuse_unless(!has_reason(view.report.reasons, Reason::cutting),
                "not while the controller reports cutting");
  refuse_unless(!has_reason(view.report.reasons, Reason::controller_disabled),
                "not while the controller has switched the compensation off (disable_signal)");
  const double rate_um_per_s = view.config.estimator.axes[command.axis].limiter.rate_um_per_s_max;
  const double takes_s = 2.0 * std::abs(command.value_um) / rate_um_per_s +
                         view.config.estimator.compensation.prove_hold_s;
  return then(actions.command(command), [takes_s] {
    return json{{"done", true}, {"takes_s", takes_s}};
  });
}

RpcPending release(const DaemonActions& actions, const json& params) {
  const auto view = actions.view();
  const Command command{CommandKind::release, axis_index(view, params), 0.0};
  refuse_unless(any_node(view, command.axis, &AxisReport::latched) ||
                    any_node(view, command.axis, &AxisReport::start_unknown),
                "the axis has no latched mismatch and no unknown start");
  return actions.command(command);
}

/// Confirms an unconfirmed sensor value by the operator's decision.
RpcPending accept(const DaemonActions& actions, const json& params) {
  const auto view = actions.view();
  if (!params.contains("sensor") || !params["sensor"].is_string())
    throw RpcError(rpc::invalid_params, "params.sensor must be the name of a sensor");
  const auto name = params["sensor"].get<std::string>();
  const std::vector<SensorConfig>& sensors = view.config.estimator.sensors;
  const auto found = std::find_if(sensors.begin(), sensors.end(),
                                  [&](const SensorConfig& each) { return each.name == name; });
  if (found == sensors.end())
    throw RpcError(rpc::invalid_params, "sensor " + name + " does not exist");
  const auto index = static_cast<std::size_t>(found - sensors.begin());
  const SensorReport& sensor = view.report.sensors[index];
  refuse_unless(sensor.waiting, "sensor " + name + " has no value that waits to be confirmed");
  return then(actions.command({CommandKind::accept, static_cast<std::uint32_t>(index), 0.0}),
              [temp_degC = sensor.raw_degC, jump_K = sensor.jump_K] {
                return json{{"done", true},
                            {"temp_degC", std::isfinite(temp_degC) ? json(temp_degC) : json()},
                            {"jump_K", jump_K}};
              });
}

RpcPending reload(const DaemonActions& actions,
                  const std::optional<std::filesystem::path>& candidate = std::nullopt) {
  return [actions, pending = actions.reload(candidate)]() -> std::optional<json> {
    try {
      if (!pending()) return std::nullopt;
    } catch (const ConfigurationError& error) {
      throw RpcError(
          rpc::refused,
          std::string("nothing was taken, the running configuration stays:\n") + error.what());
    }
    return json{{"done", true}, {"checksum", actions.view().config.model_checksum}};
  };
}

/// The person behind a client that serves many. Recorded beside the client's own user, which alone
/// decides permissions.
std::string asked_for(const json& params) {
  constexpr std::size_t bytes_max = 64;
  const auto found = params.find("for");
  if (found == params.end()) return {};
  const std::string* name = found->get_ptr<const std::string*>();
  if (name == nullptr || name->size() > bytes_max || !is_printable(*name))
    throw RpcError(rpc::invalid_params, "params.for must be a printable name of at most 64 bytes");
  return *name;
}

RpcPending candidate(const DaemonActions& actions, const json& params) {
  const auto file = params.find("file");
  if (file == params.end() || !file->is_string())
    throw RpcError(rpc::invalid_params, "params.file must be given: a path, or empty for none");
  return reload(actions, std::filesystem::path(file->get<std::string>()));
}

}  // namespace

void add_operator_methods(StatusServer& server, const DaemonActions& actions) {
  const auto add = [&](const char* name, RpcSlowHandler handler,
                       AccessClass access = AccessClass::operate) {
    server.add_slow_method(name, access, [actions, handler](const json& params) {
      if (actions.asked_for) actions.asked_for(asked_for(params));
      return handler(params);
    });
  };
  const auto simple = [&](const char* name, CommandKind kind) {
    add(name, [actions, kind](const json&) { return actions.command({kind, 0, 0.0}); });
  };
  add("enable", [actions](const json&) {
    const auto view = actions.view();
    json answer{{"done", true}};
    if (view.config.dry_run) answer["dry_run"] = true;
    if (has_reason(view.report.reasons, Reason::controller_disabled))
      answer["controller_disabled"] = true;
    return then(actions.command({CommandKind::enable, 0, 0.0}), [answer] { return answer; });
  });
  simple("disable", CommandKind::disable);
  simple("cycle_end", CommandKind::cycle_end);
  add("reference", [actions](const json& params) { return take_reference(actions, params); });
  add("measured", [actions](const json& params) { return note_measured(actions, params); });
  add("prove", [actions](const json& params) { return prove(actions, params); });
  add("release", [actions](const json& params) { return release(actions, params); });
  add("accept", [actions](const json& params) { return accept(actions, params); });
  add(
      "reload", [actions](const json&) { return reload(actions); }, AccessClass::model);
  add(
      "candidate", [actions](const json& params) { return candidate(actions, params); },
      AccessClass::model);
  server.add_method("controller_state", AccessClass::bridge, [actions](const json& params) {
    refuse_unless(bool(actions.controller_state),
                  "controller kind does not accept controller_state");
    return actions.controller_state(params);
  });
}

}  // namespace thermocomp
