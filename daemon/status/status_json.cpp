#include "daemon/status/status_json.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include <nlohmann/json.hpp>

namespace thermocomp {
namespace {

using nlohmann::json;

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

double seconds(nanoseconds time) {
  return 1e-9 * static_cast<double>(time.count());
}
double microseconds(nanoseconds time) {
  return 1e-3 * static_cast<double>(time.count());
}

std::string unit_of(const std::string& output) {
  return output.size() > 5 && output.ends_with("_urad") ? "urad" : "um";
}

json reasons(const Report& report) {
  json names = json::array();
  for (std::size_t i = 0; i < reasons_count; ++i) {
    const auto reason = static_cast<Reason>(1u << i);
    if (has_reason(report.reasons, reason)) names.push_back(to_string(reason));
  }
  return names;
}

json correction(const StatusView& view, const CorrectionReport& report) {
  const CorrectionConfig& config = view.config.estimator.correction;
  json gains = json::array();
  for (std::size_t g = 0; g < config.groups.size(); ++g) {
    gains.push_back({{"inputs", config.groups[g]},
                     {"gain", number(report.gain[g])},
                     {"sd", number(report.gain_sd[g])}});
    if (!report.has_record) continue;
    gains.back()["used"] = number(report.gain_used[g]);
    gains.back()["recorded"] = number(report.recorded[g]);
    gains.back()["recorded_sd"] = number(report.recorded_sd[g]);
  }
  return {{"form", config.form == CorrectionForm::two_phase ? "two_phase" : "recursive"},
          {"gains", gains},
          {"bias_um", number(report.bias_um)},
          {"sd_um", number(report.sd_um)},
          {"probing_wanted", report.probing_wanted},
          {"phase", report.phase},
          {"taken", report.taken},
          {"refused", report.refused}};
}

/// What an operator has to look into before a release; null where there is nothing.
json mismatch(const AxisReport& axis) {
  if (!axis.latched) return nullptr;
  const Mismatch& latched = axis.latched_mismatch;
  return {{"sent_um", number(latched.sent_um)},
          {"read_um", number(latched.read_um)},
          {"likely", likely_text(latched)},
          {"releasing", axis.releasing}};
}

json axes(const StatusView& view) {
  json list = json::array();
  for (std::size_t i = 0; i < view.report.axes.size(); ++i) {
    const AxisReport& axis = view.report.axes[i];
    const AxisConfig& config = view.config.estimator.axes[i];
    list.push_back({{"name", config.name},
                    {"unit", unit_of(config.output)},
                    {"displacement", number(axis.displacement_um)},
                    {"target", number(axis.target_um)},
                    {"offset", number(axis.offset_um)},
                    {"applied", number(axis.applied_um)},
                    {"measured", number(axis.measured_um)},
                    {"synced", axis.synced},
                    {"driven", axis.driven},
                    {"disagrees", axis.mismatch},
                    {"mismatch", mismatch(axis)},
                    {"at_bound", axis.at_bound},
                    {"proving", axis.proving},
                    {"offset_sd", number(axis.offset_sd_um)},
                    {"offset_sd_max", view.config.estimator.compensation.offset_sd_um_max}});
    if (config.node) {
      list.back()["axis"] = config.node->axis;
      list.back()["at_mm"] = config.node->position_mm;
    }
    if (std::isfinite(axis.held_um)) list.back()["held"] = axis.held_um;
    if (view.config.estimator.correction.form != CorrectionForm::off)
      list.back()["correction"] = correction(view, axis.correction);
  }
  return list;
}

/// The block that the model's temperature column is bound to.
std::string block_of(const StatusView& view, const std::string& column) {
  for (const BlockConfig& block : view.config.estimator.blocks)
    if (block.input == column) return block.name;
  return column;
}

json rate_K_per_h(const StatusView& view, std::size_t i) {
  if (view.trend == nullptr) return nullptr;
  return number(
      view.trend->change(i, view.report.now, view.report.inputs[i].temp_degC).rate_K_per_h);
}

json inputs(const StatusView& view) {
  json list = json::array();
  const auto columns = view.config.model.temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const InputReport& input = view.report.inputs[i];
    list.push_back({{"name", columns[i]},
                    {"temp_degC", number(input.temp_degC)},
                    {"reference_degC", number(input.reference_degC)},
                    {"good", input.good},
                    {"block", block_of(view, columns[i])},
                    {"estimated", input.estimated},
                    {"sd_K", number(input.sd_K)},
                    {"rate_K_per_h", rate_K_per_h(view, i)}});
  }
  return list;
}

json age_s(const StatusView& view, nanoseconds since) {
  return number(std::max(0.0, seconds(view.report.now - since)));
}

/// What a sensor lies by, as its neighbours have it; null: nobody contradicts it.
json suspected(const StatusView& view, const SensorReport& sensor) {
  if (!sensor.suspected) return nullptr;
  return {{"size_K", number(sensor.suspected_size_K)},
          {"since", number(view.wall_s - seconds(view.report.now - sensor.suspected_since))},
          {"weighed_down", sensor.weighed_down}};
}

/// The unconfirmed change of a sensor; null: none.
json jump(const StatusView& view, const SensorReport& sensor) {
  if (!sensor.jumped) return nullptr;
  return {{"size_K", number(sensor.jump_K)},
          {"since", number(view.wall_s - seconds(view.report.now - sensor.jumped_at))}};
}

json sensors_suspected(const StatusView& view) {
  json list = json::array();
  for (std::size_t i = 0; i < view.report.sensors.size(); ++i) {
    json told = suspected(view, view.report.sensors[i]);
    if (told.is_null()) continue;
    told["name"] = view.config.estimator.sensors[i].name;
    list.push_back(std::move(told));
  }
  return list;
}

json buses(const StatusView& view) {
  json list = json::array();
  for (const BusHealth& bus : view.buses) {
    json units = json::array();
    for (const UnitHealth& unit : bus.units)
      units.push_back({{"name", unit.name},
                       {"answering", unit.answering},
                       {"requests", unit.requests},
                       {"answers", unit.answers},
                       {"timeouts", unit.timeouts},
                       {"exceptions", unit.exceptions},
                       {"bad_frames", unit.bad_frames},
                       {"round_trip_ms", number(unit.round_trip_ms)},
                       {"last_error", unit.last_error}});
    list.push_back({{"name", bus.name},
                    {"kind", bus.kind},
                    {"connected", bus.connected},
                    {"connects", bus.connects},
                    {"last_error", bus.last_error},
                    {"units", units}});
    if (bus.state.empty()) continue;
    list.back().update({{"state", bus.state},
                        {"state_s", age_s(view, bus.state_since)},
                        {"error_frames", bus.error_frames},
                        {"bus_offs", bus.bus_offs},
                        {"restarts", bus.restarts},
                        {"dropped", bus.dropped}});
  }
  return list;
}

/// Which write fails and how; function, address and exception are null while none does, or where
/// the bus has no such thing.
json writes(const StatusView& view) {
  const WriteHealth& write = view.controller_health.write;
  const auto given = [](bool is_given, int value) {
    return is_given ? json(value) : json(nullptr);
  };
  const bool is_modbus = write.function != 0;
  return {{"refused", write.refused},
          {"unanswered", write.unanswered},
          {"late", write.late},
          {"function", given(is_modbus, write.function)},
          {"address", given(is_modbus, write.address)},
          {"exception", given(write.exception != 0, write.exception)},
          {"last_confirmed_s",
           write.confirmed_at == nanoseconds{} ? json(nullptr) : age_s(view, write.confirmed_at)}};
}

json controller(const StatusView& view) {
  json signals = json::object();
  for (std::size_t i = 0; i < view.config.estimator.signals.size(); ++i)
    signals[view.config.estimator.signals[i]] = number(view.controller.signals[i]);
  const ControllerHealth& health = view.controller_health;
  json told = {{"name", health.name},
               {"kind", health.kind},
               {"connected", health.connected},
               {"online", !has_reason(view.report.reasons, Reason::controller_offline)},
               {"connects", health.connects},
               {"writes", health.writes},
               {"write_errors", health.write_errors},
               {"write", writes(view)},
               {"reads", health.reads},
               {"read_errors", health.read_errors},
               {"last_error", health.last_error},
               {"signals", signals}};
  if (health.shown_um) {
    json& shown = told["shown"] = json::object();
    for (std::size_t i = 0; i < view.config.estimator.axes.size(); ++i)
      shown[view.config.estimator.axes[i].name] = number((*health.shown_um)[i]);
  }
  if (!health.state.empty())
    told.update({{"state", health.state},
                 {"state_s", age_s(view, health.state_since)},
                 {"bus_offs", health.bus_offs}});
  return told;
}

json history(const StatusView& view) {
  const HistoryStatistics& statistics = view.history;
  return {{"enabled", view.config.history.enabled},
          {"file", view.config.history.file.string()},
          {"working", statistics.working},
          {"size_MB", static_cast<double>(statistics.bytes) * 1e-6},
          {"last_commit_age_s", number(statistics.last_commit_age_s)},
          {"lost_records", statistics.lost},
          {"errors", statistics.errors},
          {"deleted_segments", statistics.deleted},
          {"files_replaced", statistics.replaced},
          {"last_error", statistics.last_error}};
}

json socket(const SocketStatistics& statistics) {
  return {{"clients", statistics.clients},
          {"accepted", statistics.accepted},
          {"refused", statistics.refused},
          {"requests", statistics.requests},
          {"errors", statistics.errors},
          {"cut_off", statistics.cut_off},
          {"delayed", statistics.delayed},
          {"missed_notifications", statistics.missed},
          {"buffered_bytes", statistics.buffered_bytes}};
}

json event_json(const Event& event) {
  return {{"number", event.number},
          {"wall_s", 1e-9 * static_cast<double>(event.wall_ns)},
          {"kind", event.kind},
          {"subject", event.subject},
          {"what", event.what},
          {"duration_s", number(event.duration_s)},
          {"user", event.user < 0 ? json(nullptr) : json(event.user)}};
}

json ended(const StatusView& view) {
  json list = json::array();
  for (const Event& event : view.ended) list.push_back(event_json(event));
  return list;
}

/// Whether the reference is that of the model file, number for number.
bool is_of_model_file(const StatusView& view) {
  const std::vector<double>& given = view.config.model.reference_degC;
  if (given.empty() || given.size() > view.report.inputs.size()) return false;
  for (std::size_t i = 0; i < given.size(); ++i)
    if (view.report.inputs[i].reference_degC != given[i]) return false;
  return true;
}

json reference(const StatusView& view) {
  const bool of_file = is_of_model_file(view);
  const bool is_known = !of_file && view.reference.is_known();
  json temps = json::object();
  const auto columns = view.config.model.temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i)
    temps[columns[i]] = number(view.report.inputs[i].reference_degC);
  json told = {{"by", nullptr},
               {"wall_s", is_known ? number(view.reference.wall_s) : json(nullptr)},
               {"lost", view.reference_lost},
               {"temps_degC", std::move(temps)}};
  if (of_file)
    told["by"] = "model_file";
  else if (is_known)
    told["by"] = to_string(view.reference.origin);
  return told;
}

/// A figure of each axis by its name; null: not known.
json of_axes(const StatusView& view, double AxisReport::*figure) {
  json told = json::object();
  for (std::size_t i = 0; i < view.report.axes.size(); ++i)
    told[view.config.estimator.axes[i].name] = number(view.report.axes[i].*figure);
  return told;
}

/// The blocks that a sensor belongs to.
json blocks_of(const StatusView& view, std::size_t sensor) {
  json list = json::array();
  for (const BlockConfig& block : view.config.estimator.blocks)
    if (std::find(block.sensors.begin(), block.sensors.end(), sensor) != block.sensors.end())
      list.push_back(block.name);
  return list;
}

/// What the model file says it was made from; null: nothing.
json made_from(const ThermalModel& model) {
  if (!model.made_from) return nullptr;
  json outputs = json::object();
  for (const auto& [name, output] : model.made_from->outputs)
    outputs[name] = {{"left_out_rms_um", number(output.left_out_rms_um)},
                     {"no_model_rms_um", number(output.no_model_rms_um)}};
  return {{"runs", model.made_from->runs},
          {"hours", number(model.made_from->hours)},
          {"rows", number(model.made_from->rows)},
          {"outputs", std::move(outputs)}};
}

}  // namespace

json events_json(const std::deque<Event>& events) {
  json list = json::array();
  for (const Event& event : events) list.push_back(event_json(event));
  return {{"events", list}};
}

std::string_view mode_name(Mode mode, bool dry_run) noexcept {
  return dry_run && mode == Mode::compensating ? "dry_run" : to_string(mode);
}

json status_json(const StatusView& view) {
  const DomainReport& domain = view.report.domain;
  json bad = json::array();
  for (std::size_t i = 0; i < view.report.sensors.size(); ++i)
    if (view.report.sensors[i].fault != Fault::none)
      bad.push_back(view.config.estimator.sensors[i].name);
  return {{"mode", mode_name(view.report.mode, view.config.dry_run)},
          {"dry_run", view.config.dry_run},
          {"mode_since_s",
           number(std::min(seconds(view.report.now - view.report.mode_since), view.uptime_s))},
          {"compensating_s", number(view.compensating_s)},
          {"enabled", view.report.enabled},
          {"reasons", reasons(view.report)},
          {"cycle_ends", view.report.cycle_ends},
          {"version", THERMOCOMP_VERSION},
          {"uptime_s", number(view.uptime_s)},
          {"cycle", timing_json(view)},
          {"model",
           {{"file", view.config.model_file.string()},
            {"checksum", view.config.model_checksum},
            {"inputs", view.config.model.inputs.size()},
            {"outputs", view.config.model.outputs.size()},
            {"compared", is_compared(view.config.model)},
            {"outside", domain.known ? json(domain.outside) : json(nullptr)},
            {"outside_share_24h", domain.known ? number(domain.outside_share_24h) : json(nullptr)},
            {"claimed_sd_um", of_axes(view, &AxisReport::claimed_sd_um)},
            {"probed_rms_um", of_axes(view, &AxisReport::probed_rms_um)}}},
          {"axes", axes(view)},
          {"inputs", inputs(view)},
          {"reference", reference(view)},
          {"sensors_bad", bad},
          {"sensors_suspected", sensors_suspected(view)},
          {"buses", buses(view)},
          {"controller", controller(view)},
          {"history", history(view)},
          {"socket", socket(view.socket)},
          {"ended", ended(view)},
          {"warnings", view.warnings}};
}

json sensors_json(const StatusView& view) {
  json list = json::array();
  for (std::size_t i = 0; i < view.report.sensors.size(); ++i) {
    const SensorReport& sensor = view.report.sensors[i];
    const bool ever = sensor.taken_at != nanoseconds{};
    list.push_back(
        {{"name", view.config.estimator.sensors[i].name},
         {"blocks", blocks_of(view, i)},
         {"raw_degC", number(sensor.raw_degC)},
         {"smoothed_degC", number(sensor.smoothed_degC)},
         {"fault", to_string(sensor.fault)},
         {"age_s",
          ever ? number(std::max(0.0, seconds(view.report.now - sensor.taken_at))) : json(nullptr)},
         {"clipped_in_a_row", sensor.clipped_in_a_row},
         {"clipped", sensor.clipped},
         {"rejected", sensor.rejected},
         {"suspected", suspected(view, sensor)},
         {"jump", jump(view, sensor)}});
  }
  return {{"sensors", list}, {"inputs", inputs(view)}, {"axes", axes(view)}};
}

json offsets_json(const StatusView& view) {
  return {{"mode", mode_name(view.report.mode, view.config.dry_run)},
          {"dry_run", view.config.dry_run},
          {"axes", axes(view)}};
}

json timing_json(const StatusView& view) {
  const DurationHistogram& lateness = view.timing.lateness;
  const DurationHistogram& work = view.timing.work;
  return {{"count", view.timing.cycles.load()},
          {"missed", view.timing.missed.load()},
          {"rate_hz", view.config.loop.rate_hz},
          {"lateness_us_p50", microseconds(lateness.percentile(0.5))},
          {"lateness_us_p99", microseconds(lateness.percentile(0.99))},
          {"lateness_us_p999", microseconds(lateness.percentile(0.999))},
          {"lateness_us_max", microseconds(lateness.max())},
          {"work_us_p50", microseconds(work.percentile(0.5))},
          {"work_us_p999", microseconds(work.percentile(0.999))},
          {"work_us_max", microseconds(work.max())},
          {"real_time", view.real_time}};
}

json model_json(const StatusView& view) {
  json terms = json::array();
  for (const TermSpec& term : view.config.model.terms) {
    if (term.is_bank()) {
      terms.push_back({{"kind", term.kind},
                       {"subjects", term.bank.subjects},
                       {"powers", term.bank.powers},
                       {"tau_s", term.bank.taus_s},
                       {"gain_um_per_unit", term.bank.gain_um_per_unit}});
      continue;
    }
    terms.push_back({{"kind", term.kind},
                     {"subject", term.subject},
                     {"shared", term.shared},
                     {"per_output", term.per_output}});
  }
  return {{"file", view.config.model_file.string()},
          {"checksum", view.config.model_checksum},
          {"inputs", view.config.model.inputs},
          {"outputs", view.config.model.outputs},
          {"matrix_um_per_K", view.config.model.matrix_um_per_K},
          {"terms", terms},
          {"made_from", made_from(view.config.model)}};
}

std::string status_line(const StatusView& view) {
  std::string line(view.config.dry_run ? "DRY RUN, nothing is written; " : "");
  line += mode_name(view.report.mode, view.config.dry_run);
  for (std::size_t i = 0; i < view.report.axes.size(); ++i) {
    char text[64];
    const AxisConfig& axis = view.config.estimator.axes[i];
    std::snprintf(text, sizeof text, "%s %s %+.1f %s", i == 0 ? ":" : ",", axis.name.c_str(),
                  view.report.axes[i].offset_um, unit_of(axis.output).c_str());
    line += text;
  }
  return line;
}

}  // namespace thermocomp
