#include "daemon/status/status_view.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <iterator>
#include <utility>

#include <nlohmann/json.hpp>

#include "daemon/status/reference_rules.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"
#include "status/verdict.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;

double microseconds(nanoseconds time) {
  return 1e-3 * static_cast<double>(time.count());
}

json number(double value) {
  return std::isfinite(value) ? json(value) : json(nullptr);
}

std::string unit_of(const std::string& output) {
  return output.size() > 5 && output.ends_with("_urad") ? "urad" : "um";
}

double age_s(const StatusView& view, nanoseconds since) {
  return std::max(0.0, to_seconds(view.report.now - since));
}

std::string form_text(CorrectionForm form) {
  if (form == CorrectionForm::constant) return "constant";
  return form == CorrectionForm::two_phase ? "two_phase" : "recursive";
}

CorrectionStatus correction_of(const CorrectionConfig& config, const CorrectionReport& report) {
  CorrectionStatus status{.form = form_text(config.form),
                          .bias_um = report.bias_um,
                          .sd_um = report.sd_um,
                          .probing_wanted = report.probing_wanted,
                          .phase = report.phase,
                          .taken = report.taken,
                          .refused = report.refused};
  for (std::size_t g = 0; g < config.groups.size(); ++g) {
    GainStatus gain{config.groups[g], report.gain[g], report.gain_sd[g]};
    if (report.has_record) {
      gain.used = report.gain_used[g];
      gain.recorded = report.recorded[g];
      gain.recorded_sd = report.recorded_sd[g];
    }
    status.gains.push_back(std::move(gain));
  }
  return status;
}

/// True if the controller is absent: its last report is outdated.
bool is_absent(const StatusView& view) {
  return has_reason(view.report.reasons, Reason::controller_offline);
}

/// A dry run's own offset comes back to the estimator; what the controller applies is beside it.
double applied_um(const StatusView& view, std::size_t axis) {
  if (is_absent(view)) return not_a_number;
  if (!view.config.dry_run) return view.report.axes[axis].applied_um;
  return view.controller_health.shown_um ? (*view.controller_health.shown_um)[axis] : not_a_number;
}

AxisStatus axis_of(const StatusView& view, std::size_t index) {
  const AxisConfig& config = view.config.estimator.axes[index];
  const AxisReport& report = view.report.axes[index];
  AxisStatus axis{.name = config.name,
                  .unit = unit_of(config.output),
                  .displacement = report.displacement_um,
                  .target = report.target_um,
                  .offset = report.offset_um,
                  .offset_max = config.limiter.offset_um_max,
                  .applied = applied_um(view, index),
                  .measured = report.measured_um,
                  .synced = report.synced,
                  .driven = report.driven,
                  .disagrees = report.disagrees,
                  .at_bound = report.at_bound,
                  .proving = report.proving,
                  .offset_sd = report.offset_sd_um,
                  .offset_sd_max = view.config.estimator.compensation.offset_sd_um_max,
                  .start = std::string(to_string(report.start))};
  if (report.latched) {
    const Mismatch& latched = report.latched_mismatch;
    axis.latched = {latched.sent_um, latched.read_um, likely_text(latched), report.releasing};
  }
  if (config.node) {
    axis.axis = config.node->axis;
    axis.at_mm = config.node->position_mm;
  }
  if (std::isfinite(report.held_um)) axis.held = report.held_um;
  const CorrectionConfig& correction = view.config.estimator.correction;
  if (correction.form != CorrectionForm::off)
    axis.correction = correction_of(correction, report.correction);
  else if (report.last_probing.is_unexplained(correction.noise_um))
    axis.unexplained = {report.last_probing.without_offset_um, report.last_probing.model_um};
  return axis;
}

std::vector<AxisStatus> axes_of(const StatusView& view) {
  std::vector<AxisStatus> list;
  for (std::size_t i = 0; i < view.report.axes.size(); ++i) list.push_back(axis_of(view, i));
  return list;
}

/// The block that the model's temperature column is bound to.
std::string block_of(const StatusView& view, const std::string& column) {
  for (const BlockConfig& block : view.config.estimator.blocks)
    if (block.input == column) return block.name;
  return column;
}

double rate_K_per_h(const StatusView& view, std::size_t input) {
  if (view.trend == nullptr) return not_a_number;
  return view.trend->change(input, view.report.now, view.report.inputs[input].temp_degC)
      .rate_K_per_h;
}

std::vector<InputStatus> inputs_of(const StatusView& view) {
  std::vector<InputStatus> list;
  const auto columns = view.config.model.temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const InputReport& input = view.report.inputs[i];
    list.push_back({.name = columns[i],
                    .temp_degC = input.temp_degC,
                    .reference_degC = input.reference_degC,
                    .good = input.good,
                    .block = block_of(view, columns[i]),
                    .estimated = input.estimated,
                    .sd_K = input.sd_K,
                    .rate_K_per_h = rate_K_per_h(view, i)});
  }
  return list;
}

/// Error of a suspected sensor; nullopt: it agrees with its neighbours.
std::optional<SensorError> suspicion_of(const StatusView& view, const SensorReport& sensor) {
  if (!sensor.suspected) return std::nullopt;
  return SensorError{sensor.suspected_size_K,
                     view.wall_s - to_seconds(view.report.now - sensor.suspected_since),
                     sensor.weighed_down};
}

/// Jump of a sensor; nullopt: no change awaits confirmation.
std::optional<Jump> jump_of(const StatusView& view, const SensorReport& sensor) {
  if (!sensor.jumped) return std::nullopt;
  return Jump{sensor.jump_K, view.wall_s - to_seconds(view.report.now - sensor.jumped_at)};
}

/// The blocks that a sensor belongs to.
std::vector<std::string> blocks_of(const StatusView& view, std::size_t sensor) {
  std::vector<std::string> list;
  for (const BlockConfig& block : view.config.estimator.blocks)
    if (std::find(block.sensors.begin(), block.sensors.end(), sensor) != block.sensors.end())
      list.push_back(block.name);
  return list;
}

SensorStatus sensor_of(const StatusView& view, std::size_t index) {
  const SensorReport& sensor = view.report.sensors[index];
  // A sensor that jumped before a restart has no confirmed value in this run.
  const bool ever = sensor.taken_at > nanoseconds{};
  return {.name = view.config.estimator.sensors[index].name,
          .blocks = blocks_of(view, index),
          .raw_degC = sensor.raw_degC,
          .smoothed_degC = sensor.smoothed_degC,
          .fault = sensor.fault,
          .age_s = ever ? age_s(view, sensor.taken_at) : not_a_number,
          .clipped_in_a_row = sensor.clipped_in_a_row,
          .clipped = sensor.clipped,
          .rejected = sensor.rejected,
          .suspected = suspicion_of(view, sensor),
          .jump = jump_of(view, sensor)};
}

UnitStatus unit_of(const StatusView& view, const UnitHealth& unit) {
  UnitStatus status{.name = unit.name,
                    .answering = unit.answering,
                    .requests = unit.requests,
                    .answers = unit.answers,
                    .timeouts = unit.timeouts,
                    .exceptions = unit.exceptions,
                    .bad_frames = unit.bad_frames,
                    .round_trip_ms = unit.round_trip_ms,
                    .last_error = unit.last_error};
  nanoseconds newest{};
  for (std::size_t i = 0; i < view.config.estimator.sensors.size(); ++i) {
    if (view.config.estimator.sensors[i].module != unit.name) continue;
    status.sensors.push_back(view.config.estimator.sensors[i].name);
    newest = std::max(newest, view.report.sensors[i].taken_at);
    // A unit that sends by itself may do so rarely.
    const Fault fault = view.report.sensors[i].fault;
    if (unit.requests == 0 && unit.answers != 0)
      status.answering |= fault == Fault::none || fault == Fault::unconfirmed;
    for (std::string& block : blocks_of(view, i))
      if (std::find(status.blocks.begin(), status.blocks.end(), block) == status.blocks.end())
        status.blocks.push_back(std::move(block));
  }
  if (newest != nanoseconds{}) status.silent_s = age_s(view, newest);
  return status;
}

BusStatus bus_of(const StatusView& view, const BusHealth& bus) {
  BusStatus status{.name = bus.name,
                   .kind = bus.kind,
                   .connected = bus.connected,
                   .connects = bus.connects,
                   .last_error = bus.last_error};
  for (const UnitHealth& unit : bus.units) status.units.push_back(unit_of(view, unit));
  if (bus.state.empty()) return status;
  status.state = bus.state;
  status.state_s = age_s(view, bus.state_since);
  status.error_frames = bus.error_frames;
  status.bus_offs = bus.bus_offs;
  status.restarts = bus.restarts;
  status.dropped = bus.dropped;
  return status;
}

WriteStatus write_of(const StatusView& view) {
  const WriteHealth& write = view.controller_health.write;
  WriteStatus status{.refused = write.refused, .unanswered = write.unanswered, .late = write.late};
  if (write.function != 0) {
    status.function = static_cast<std::uint64_t>(write.function);
    status.address = static_cast<std::uint64_t>(write.address);
  }
  if (write.exception != 0) status.exception = static_cast<std::uint64_t>(write.exception);
  if (write.confirmed_at != nanoseconds{})
    status.last_confirmed_s = age_s(view, write.confirmed_at);
  return status;
}

/// Explanation of a slow link; empty if each report of the controller arrives in time.
std::string slow_link_text(const StatusView& view) {
  const double aged_s = to_seconds(view.controller_health.report_aged);
  const double stale_after_s = view.config.estimator.compensation.controller_stale_after_s;
  if (!(aged_s > stale_after_s)) return {};
  return fmt::format(
      "a round of reads and writes takes {:.1f} s, more than controller_stale_after_s = {}", aged_s,
      stale_after_s);
}

ControllerStatus controller_of(const StatusView& view) {
  const ControllerHealth& health = view.controller_health;
  ControllerStatus status{.name = health.name,
                          .kind = health.kind,
                          .connected = health.connected,
                          .online = !has_reason(view.report.reasons, Reason::controller_offline),
                          .connects = health.connects,
                          .writes = health.writes,
                          .write_errors = health.write_errors,
                          .reads = health.reads,
                          .read_errors = health.read_errors,
                          .last_error = health.last_error,
                          .write = write_of(view)};
  // While it is online, the text is one of Status::warnings.
  if (!status.online && status.last_error.empty()) status.last_error = slow_link_text(view);
  for (std::size_t i = 0; i < view.config.estimator.signals.size(); ++i)
    status.signals[view.config.estimator.signals[i]] =
        is_absent(view) ? not_a_number : view.controller.signals[i];
  if (health.shown_um) {
    status.shown.emplace();
    for (std::size_t i = 0; i < view.config.estimator.axes.size(); ++i)
      (*status.shown)[view.config.estimator.axes[i].name] = (*health.shown_um)[i];
  }
  if (health.state.empty()) return status;
  status.state = health.state;
  status.state_s = age_s(view, health.state_since);
  status.bus_offs = health.bus_offs;
  return status;
}

HistoryStatus history_of(const StatusView& view) {
  const HistoryStatistics& statistics = view.history;
  return {.enabled = view.config.history.enabled,
          .file = view.config.history.file.string(),
          .working = statistics.working,
          .size_MB = static_cast<double>(statistics.bytes) * 1e-6,
          .last_commit_age_s = statistics.last_commit_age_s,
          .lost_records = statistics.lost,
          .errors = statistics.errors,
          .deleted_segments = statistics.deleted,
          .files_replaced = statistics.replaced,
          .last_error = statistics.last_error};
}

SocketStatus socket_of(const SocketStatistics& statistics) {
  return {.clients = statistics.clients,
          .accepted = statistics.accepted,
          .refused = statistics.refused,
          .requests = statistics.requests,
          .errors = statistics.errors,
          .cut_off = statistics.cut_off,
          .delayed = statistics.delayed,
          .missed_notifications = statistics.missed,
          .buffered_bytes = statistics.buffered_bytes};
}

/// True if the reference equals that of the model file.
bool is_of_model_file(const StatusView& view) {
  const std::vector<double>& given = view.config.model.reference_degC;
  if (given.empty() || given.size() > view.report.inputs.size()) return false;
  for (std::size_t i = 0; i < given.size(); ++i)
    if (view.report.inputs[i].reference_degC != given[i]) return false;
  return true;
}

ReferenceStatus reference_of(const StatusView& view) {
  ReferenceStatus status;
  status.objections = lost_for_reference(view.config.model, view.report);
  std::ranges::move(against_reference(view.config, view.report, view.controller_health, view.trend),
                    std::back_inserter(status.objections));
  status.lost = view.reference_lost;
  const auto columns = view.config.model.temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i)
    status.temps_degC[columns[i]] = view.report.inputs[i].reference_degC;
  if (is_of_model_file(view)) {
    status.by = "model_file";
  } else if (view.reference.is_known()) {
    status.by = to_string(view.reference.origin);
    status.wall_s = view.reference.wall_s;
    status.changed = view.reference.changed;
  }
  return status;
}

/// A value of each axis, by axis name.
std::map<std::string, double> by_axis(const StatusView& view, double AxisReport::*figure) {
  std::map<std::string, double> figures;
  for (std::size_t i = 0; i < view.report.axes.size(); ++i)
    figures[view.config.estimator.axes[i].name] = view.report.axes[i].*figure;
  return figures;
}

bool moves(const DaemonConfig& config) {
  return has_gain(config.model) || config.estimator.correction.learns_bias();
}

std::vector<std::string> still_axes(const DaemonConfig& config) {
  std::vector<std::string> names;
  if (!has_gain(config.model) || config.estimator.correction.learns_bias()) return names;
  for (const AxisSpan& span : axis_spans(config.estimator.axes)) {
    const AxisConfig& axis = config.estimator.axes[span.first];
    if (!has_gain(config.model, axis.output)) names.push_back(axis_name(axis));
  }
  return names;
}

ModelStatus model_of(const StatusView& view) {
  const DomainReport& domain = view.report.domain;
  ModelStatus status{.file = view.config.model_file.string(),
                     .checksum = view.config.model_checksum,
                     .inputs = view.config.model.inputs.size(),
                     .outputs = view.config.model.outputs.size(),
                     .moves = moves(view.config),
                     .still = still_axes(view.config),
                     .compared = is_compared(view.config.model),
                     .claimed_sd_um = by_axis(view, &AxisReport::claimed_sd_um),
                     .probed_rms_um = by_axis(view, &AxisReport::probed_rms_um)};
  if (!domain.known) return status;
  status.outside = domain.outside;
  status.outside_share_24h = domain.outside_share_24h;
  return status;
}

/// The model file's data on its origin; null: none.
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

std::map<std::string, WarmStatus> warm_of(const StatusView& view) {
  std::map<std::string, WarmStatus> warm;
  if (view.warm_up == nullptr) return warm;
  const std::vector<RemainingDrift>& remaining = view.warm_up->remaining();
  const std::vector<AxisConfig>& axes = view.config.estimator.axes;
  for (std::size_t i = 0; i < std::min(axes.size(), remaining.size()); ++i)
    warm[axes[i].name] = {remaining[i].um, remaining[i].minutes};
  return warm;
}

std::optional<ProbeDueStatus> probe_due_of(const StatusView& view) {
  if (view.since_probing == nullptr) return std::nullopt;
  const CorrectionConfig& correction = view.config.estimator.correction;
  ProbeDueStatus due;
  for (std::size_t i = 0; i < view.report.axes.size(); ++i) {
    const AxisConfig& axis = view.config.estimator.axes[i];
    const double error_um =
        view.since_probing->error_um(i, view.report.axes[i], view.config.model, axis.output,
                                     correction.form != CorrectionForm::off);
    if (!std::isfinite(error_um)) continue;
    due.axes[axis.name] = error_um > correction.probe_sd_um;
    due.because_um = std::fmax(due.because_um, error_um);
  }
  return due.axes.empty() ? std::nullopt : std::optional(due);
}

/// A start may take so much longer than three times settle_s.
constexpr double start_grace_s = 10.0;

/// Sensors whose new values are not confirmed yet, by module.
std::vector<Confirmation> confirmations_of(const StatusView& view) {
  const std::vector<SensorReport>& reports = view.report.sensors;
  std::map<std::string, std::vector<std::size_t>> modules;
  for (std::size_t i = 0; i < reports.size(); ++i)
    if (reports[i].settles()) modules[view.config.estimator.sensors[i].module].push_back(i);
  std::vector<Confirmation> all;
  for (const auto& [module, sensors] : modules) {
    Confirmation values{.settle_s = 0.0};
    bool is_one_value = sensors.size() > 1 && !module.empty();
    for (const std::size_t i : sensors) {
      const SensorConfig& sensor = view.config.estimator.sensors[i];
      values.sensors.push_back(sensor.name);
      values.settle_s = std::max(values.settle_s, sensor.screening.settle_s);
      is_one_value = is_one_value && reports[i].raw_degC == reports[sensors.front()].raw_degC;
    }
    if (is_one_value) values.one_value_of = module;
    all.push_back(std::move(values));
  }
  return all;
}

}  // namespace

void add_status_methods(StatusServer& server, const std::function<StatusView()>& view) {
  const auto add = [&](const char* name, auto answer) {
    server.add_method(name, AccessClass::read,
                      [view, answer](const json&) { return answer(view()); });
  };
  add("status", [](const StatusView& now) { return json_of(status_of(now)); });
  add("sensors", [](const StatusView& now) { return json_of(sensors_of(now)); });
  add("offsets", [](const StatusView& now) { return json_of(offsets_of(now)); });
  add("timing", [](const StatusView& now) { return json_of(timing_of(now)); });
  add("model", [](const StatusView& now) { return model_json(now.config); });
}

std::optional<CandidateStatus> candidate_of(const DaemonConfig& config,
                                            const ModelContest::Score* contest) {
  const std::optional<CandidateModel>& named = config.candidate;
  if (!named || (named->problem.empty() && contest == nullptr)) return std::nullopt;
  CandidateStatus status{.file = named->file.string(), .problem = named->problem};
  if (contest == nullptr) return status;
  const ModelContest::Chances chances = ModelContest::chances(*contest);
  status.better_probability = chances.better;
  status.worse_probability = chances.worse;
  for (std::size_t i = 0; i < config.estimator.axes.size(); ++i) {
    const ModelContest::AxisScore& score = (*contest)[i];
    if (!(score.probings > 0)) continue;
    status.probings += static_cast<std::uint64_t>(score.probings);
    status.rms_um[config.estimator.axes[i].name] = {
        std::sqrt(score.model_um2 / score.probings),
        std::sqrt(score.candidate_um2 / score.probings)};
  }
  return status;
}

Status status_of(const StatusView& view) {
  Status status{
      .mode = view.report.mode,
      .dry_run = view.config.dry_run,
      .mode_since_s = std::min(to_seconds(view.report.now - view.report.mode_since), view.uptime_s),
      .compensating_s = view.compensating_s,
      .enabled = view.report.enabled,
      .reasons = view.report.reasons,
      .cycle_ends = view.report.cycle_ends,
      .version = THERMOCOMP_VERSION,
      .uptime_s = view.uptime_s,
      .cycle = timing_of(view),
      .model = model_of(view),
      .candidate = candidate_of(view.config, view.contest),
      .axes = axes_of(view),
      .probe_due = probe_due_of(view),
      .warm = warm_of(view),
      .inputs = inputs_of(view),
      .reference = reference_of(view),
      .modules_frozen = view.modules_frozen,
      .controller = controller_of(view),
      .history = history_of(view),
      .socket = socket_of(view.socket),
      .ended = view.ended,
      .warnings = view.warnings};
  if (const std::string slow = slow_link_text(view); status.controller.online && !slow.empty())
    status.warnings.push_back("controller " + status.controller.name + ": " + slow);
  for (std::size_t i = 0; i < view.report.sensors.size(); ++i) {
    const std::string& name = view.config.estimator.sensors[i].name;
    const SensorReport& sensor = view.report.sensors[i];
    if (sensor.fault != Fault::none && !sensor.settles()) status.sensors_bad.push_back(name);
    if (const auto jump = jump_of(view, view.report.sensors[i]))
      status.sensors_jumped.push_back({name, *jump});
    if (const auto suspicion = suspicion_of(view, view.report.sensors[i]))
      status.sensors_suspected.push_back({name, *suspicion});
  }
  for (const BusHealth& bus : view.buses) status.buses.push_back(bus_of(view, bus));
  if (has_reason(view.report.reasons, Reason::block_lost)) {
    status.confirming = confirmations_of(view);
    // Each start confirms all values; only one that lasts needs a reason.
    if (view.report.mode == Mode::starting)
      std::erase_if(status.confirming, [&](const Confirmation& each) {
        return status.mode_since_s < 3.0 * each.settle_s + start_grace_s;
      });
  }
  return status;
}

SensorsAnswer sensors_of(const StatusView& view) {
  SensorsAnswer answer{.inputs = inputs_of(view), .axes = axes_of(view)};
  for (std::size_t i = 0; i < view.report.sensors.size(); ++i)
    answer.sensors.push_back(sensor_of(view, i));
  return answer;
}

OffsetsAnswer offsets_of(const StatusView& view) {
  return {view.report.mode, view.config.dry_run, axes_of(view)};
}

CycleStatus timing_of(const StatusView& view) {
  const DurationHistogram& lateness = view.timing.lateness;
  const DurationHistogram& work = view.timing.work;
  return {.count = view.timing.cycles.load(),
          .missed = view.timing.missed.load(),
          .rate_hz = view.config.loop.rate_hz,
          .lateness_us_p50 = microseconds(lateness.percentile(0.5)),
          .lateness_us_p99 = microseconds(lateness.percentile(0.99)),
          .lateness_us_p999 = microseconds(lateness.percentile(0.999)),
          .lateness_us_max = microseconds(lateness.max()),
          .work_us_p50 = microseconds(work.percentile(0.5)),
          .work_us_p999 = microseconds(work.percentile(0.999)),
          .work_us_max = microseconds(work.max()),
          .real_time = view.real_time};
}

json model_json(const DaemonConfig& config) {
  json terms = json::array();
  for (const TermSpec& term : config.model.terms) {
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
  return {{"file", config.model_file.string()},
          {"checksum", config.model_checksum},
          {"inputs", config.model.inputs},
          {"outputs", config.model.outputs},
          {"matrix_um_per_K", config.model.matrix_um_per_K},
          {"terms", terms},
          {"made_from", made_from(config.model)}};
}

std::string status_line(const StatusView& view) {
  std::string line(view.config.dry_run ? "DRY RUN, nothing is written; " : "");
  line += code_text(view.report.mode, view.config.dry_run).name;
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
