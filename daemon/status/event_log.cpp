#include "daemon/status/event_log.hpp"

#include <cmath>
#include <fmt/format.h>
#include <utility>

#include <spdlog/spdlog.h>

#include "config/text/units.hpp"
#include "status/codes.hpp"

namespace thermocomp {
namespace {

/// Number of consecutive clipped values that is logged: the temperature departs from its history.
constexpr std::uint32_t clipped_in_a_row_news = 5;

/// A value close to a limit crosses it by noise: such a reason ends after a minute without it.
nanoseconds hold_of(Reason reason) {
  const bool has_limit = reason == Reason::at_bound || reason == Reason::outside_domain;
  return has_limit ? std::chrono::minutes(1) : nanoseconds{};
}

std::string reason_names(std::uint32_t reasons) {
  std::vector<std::string> names;
  for (const Reason reason : members_of(reasons)) names.emplace_back(to_string(reason));
  return names.empty() ? "none" : fmt::format("{}", fmt::join(names, ", "));
}

}  // namespace

void EventLog::note_estimates(const Report& report, const EstimatorConfig& config,
                              const std::vector<std::string>& columns) {
  input_states_.resize(report.inputs.size());
  bool any = false;
  for (std::size_t i = 0; i < report.inputs.size(); ++i) {
    const InputReport& input = report.inputs[i];
    any = any || input.estimated;
    // Otherwise the sensors' faults are logged.
    const bool was_estimated = !input_states_[i].empty();
    std::string state = input.estimated ? "estimated" : !input.good && was_estimated ? "lost" : "";
    if (state == input_states_[i]) continue;
    const Subject subject{SubjectKind::input, columns[i]};
    if (!state.empty()) {
      note_fault({.subject = subject, .code = state});
    } else if (const double lasted_s = journal_.recovery(subject); lasted_s >= 0.0) {
      spdlog::info("input {}: measured again after {:.1f} s", subject.name, lasted_s);
    }
    input_states_[i] = std::move(state);
  }
  const bool uncertain = any && has_reason(report.reasons, Reason::block_lost);
  if (uncertain == uncertain_) return;
  uncertain_ = uncertain;
  for (std::size_t i = 0; i < report.axes.size(); ++i) {
    const Subject subject{SubjectKind::estimate, config.axes[i].name};
    const double sd_um_max = config.compensation.offset_sd_um_max;
    if (!uncertain) {
      if (const double lasted_s = journal_.recovery(subject); lasted_s >= 0.0)
        spdlog::info("{}: certain enough again after {:.1f} s", subject_text(subject), lasted_s);
    } else if (report.axes[i].offset_sd_um > sd_um_max) {
      note_fault({.subject = subject, .code = "uncertain", .value = sd_um_max});
    }
  }
}

void EventLog::note_fault(const Event& fault, std::string_view more) {
  Event noted = fault;
  noted.kind = EventKind::fault;
  if (journal_.fault(noted))
    spdlog::warn("{}: {}{}", subject_text(noted.subject), what_text(noted), more);
}

void EventLog::note_report(const Report& report, const EstimatorConfig& config, bool dry_run) {
  constexpr nanoseconds settles = std::chrono::seconds(5);
  if (settled_at_ == nanoseconds{}) settled_at_ = report.now + settles;
  // At a first start, compensation is disabled while readings are still missing.
  const auto off = static_cast<std::uint32_t>(Reason::operator_disabled) |
                   static_cast<std::uint32_t>(Reason::controller_disabled);
  const bool is_beginning = report.mode == Mode::starting ||
                            (report.mode == Mode::disabled && (report.reasons & ~off) != 0);
  if (first_ && is_beginning && report.now < settled_at_) return;
  note_ended_outages();
  note_sensors(report, config);
  note_mismatches(report, config);
  note_returns(report, config);
  note_mode(report, std::string(code_text(report.mode, dry_run).name));  // implied by the above
  first_ = false;
}

void EventLog::note_ended_outages() {
  for (const Event& event : journal_.settle())
    spdlog::info("{}: {}: over, lasted {:.1f} s", subject_text(event.subject), what_text(event),
                 event.duration_s);
}

void EventLog::note_mode(const Report& report, const std::string& mode) {
  const std::uint32_t before = std::exchange(reasons_, 0);
  bool may_return = false;
  for (std::size_t i = 0; i < reasons_count; ++i) {
    const auto bit = std::uint32_t{1} << i;
    const auto reason = static_cast<Reason>(bit);
    // Changes with every part, so it is shown in the status, not logged.
    if (reason == Reason::cutting) continue;
    const bool is_given = has_reason(report.reasons, reason);
    note_reason(reason, is_given);
    const Subject subject{SubjectKind::reason, std::string(to_string(reason))};
    if (is_given || journal_.lasts(subject)) reasons_ |= bit;
    may_return = may_return || (!is_given && journal_.comes_and_goes(subject));
  }
  // A mode with an intermittent reason is logged once the reason stays away.
  if (may_return && (reasons_ & ~before) == 0) return;
  if (first_ || report.mode != mode_ || reasons_ != before) {
    const bool good = report.mode == Mode::compensating && reasons_ == 0;
    spdlog::log(good ? spdlog::level::info : spdlog::level::warn, "mode {}, reasons: {}", mode,
                reason_names(reasons_));
  }
  journal_.mode(mode);
  mode_ = report.mode;
}

void EventLog::note_reason(Reason reason, bool is_given) {
  // Commanded by the operator, hence not a fault; command and mode are events.
  if (reason == Reason::operator_disabled) return;
  const Subject subject{SubjectKind::reason, std::string(to_string(reason))};
  if (is_given)
    journal_.fault({.subject = subject, .code = subject.name});
  else
    journal_.recovery(subject, hold_of(reason));
}

void EventLog::note_sensors(const Report& report, const EstimatorConfig& config) {
  faults_.resize(report.sensors.size(), Fault::none);
  good_degC_.resize(report.sensors.size(), not_a_number);
  clipping_.resize(report.sensors.size(), false);
  suspected_.resize(report.sensors.size(), false);
  for (std::size_t i = 0; i < report.sensors.size(); ++i) {
    const SensorReport& sensor = report.sensors[i];
    // A settling sensor's fault ends only once its value counts.
    if (sensor.fault != faults_[i] && !sensor.settles()) {
      const Subject subject{SubjectKind::sensor, config.sensors[i].name};
      if (sensor.fault != Fault::none) {
        note_fault({.subject = subject, .code = std::string(to_string(sensor.fault))});
      } else {
        // A change within the noise of a step is not reported.
        const double change_K = sensor.raw_degC - good_degC_[i];
        const bool is_news = std::abs(change_K) > config.sensors[i].screening.rate_allowance_K;
        const double lasted_s = journal_.recovery(subject, {}, is_news ? change_K : not_a_number);
        if (lasted_s >= 0.0)
          spdlog::info("sensor {}: good again after {:.1f} s", subject.name, lasted_s);
      }
      faults_[i] = sensor.fault;
    }
    if (sensor.fault == Fault::none) good_degC_[i] = sensor.raw_degC;
    note_suspicion(i, sensor, config.sensors[i].name);
    const bool clipping = sensor.clipped_in_a_row >= clipped_in_a_row_news;
    if (clipping && !clipping_[i])
      spdlog::warn("sensor {}: {} smoothed values in a row clipped", config.sensors[i].name,
                   sensor.clipped_in_a_row);
    clipping_[i] = clipping;
  }
}

void EventLog::note_suspicion(std::size_t index, const SensorReport& sensor,
                              const std::string& name) {
  if (sensor.suspected == suspected_[index]) return;
  suspected_[index] = sensor.suspected;
  const Subject subject{SubjectKind::suspected_sensor, name};
  if (sensor.suspected) {
    note_fault({.subject = subject, .code = "suspected", .value = sensor.suspected_size_K},
               sensor.weighed_down ? ", not used" : "");
  } else if (const double lasted_s = journal_.recovery(subject); lasted_s >= 0.0) {
    spdlog::info("sensor {}: no longer suspected, after {:.1f} s", name, lasted_s);
  }
}

void EventLog::note_mismatches(const Report& report, const EstimatorConfig& config) {
  latched_.resize(report.axes.size(), false);
  for (std::size_t i = 0; i < report.axes.size(); ++i) {
    const AxisReport& axis = report.axes[i];
    if (axis.latched == latched_[i]) continue;
    latched_[i] = axis.latched;
    const Mismatch& mismatch = axis.latched_mismatch;
    const Subject subject{SubjectKind::axis, config.axes[i].name};
    if (axis.latched) {
      journal_.fault(
          {.subject = subject, .code = "mismatch_latched", .detail = likely_text(mismatch)});
      spdlog::error(
          "axis {}: sent {:.3f} um, read back {:.3f} um: {}; not driven until the cause is removed "
          "and released (thermocomp release {})",
          config.axes[i].name, mismatch.sent_um, mismatch.read_um, likely_text(mismatch),
          config.axes[i].name);
    } else {
      journal_.recovery(subject);
      spdlog::info("axis {}: released, continues from {:.3f} um", config.axes[i].name,
                   axis.offset_um);
    }
  }
}

void EventLog::note_returns(const Report& report, const EstimatorConfig& config) {
  if (has_reason(report.reasons, Reason::controller_offline)) {
    away_ = true;
    return;
  }
  in_effect_um_.resize(report.axes.size(), not_a_number);
  for (std::size_t i = 0; i < report.axes.size(); ++i) {
    const double applied_um = report.axes[i].applied_um;
    const double before_um = std::exchange(in_effect_um_[i], applied_um);
    // An offset sent just before the link ended may have taken effect after it.
    constexpr double unwritten_s = 3.0;
    const double allowed_um =
        config.compensation.mismatch_um + unwritten_s * config.axes[i].limiter.rate_um_per_s_max;
    if (!away_ || !(std::abs(applied_um - before_um) > allowed_um)) continue;
    const std::string text = fmt::format(
        "axis {}: the controller returned with {:+.2f} {} in effect, {:+.2f} before",
        config.axes[i].name, applied_um, unit_of(config.axes[i].output).symbol, before_um);
    journal_.daemon("offset", text);
    spdlog::warn("{}", text);
  }
  away_ = false;
}

void EventLog::note_link(const Subject& subject, bool connected, const std::string& error) {
  const auto known = connected_.find(subject);
  if (known != connected_.end() && known->second == connected) return;
  connected_[subject] = connected;
  if (!connected)
    note_fault({.subject = subject,
                .code = "not_connected",
                .detail = error.empty() ? "not connected" : error});
  else if (const double lasted_s = journal_.recovery(subject); lasted_s >= 0.0)
    spdlog::info("{}: connected again after {:.1f} s", subject_text(subject), lasted_s);
  else if (!journal_.lasts(subject))
    spdlog::info("{}: connected", subject_text(subject));
}

// A lost connection is logged by note_link().
void EventLog::note_state(const Subject& subject, bool connected, const std::string& state) {
  if (state.empty() || !connected) return;
  std::string& known = states_.try_emplace(subject, "active").first->second;
  if (known == state) return;
  known = state;
  if (state != "active")
    note_fault({.subject = subject, .code = state});
  else if (const double lasted_s = journal_.recovery(subject); lasted_s >= 0.0)
    spdlog::info("{}: none again after {:.1f} s", subject_text(subject), lasted_s);
}

void EventLog::note_frozen(const std::map<std::string, double>& frozen_s) {
  std::erase_if(frozen_, [&](const std::string& module) {
    if (frozen_s.contains(module)) return false;
    if (const double lasted_s = journal_.recovery({SubjectKind::device, module}); lasted_s >= 0.0)
      spdlog::info("device {}: its values change again after {:.1f} s", module, lasted_s);
    return true;
  });
  for (const auto& [module, same_s] : frozen_s)
    if (frozen_.insert(module).second)
      note_fault({.subject = {SubjectKind::device, module},
                  .code = "frozen",
                  .detail = "the same values, up and down before: frozen?"});
}

void EventLog::note_bus(const BusHealth& bus) {
  note_link({SubjectKind::bus, bus.name}, bus.connected, bus.last_error);
  note_state({SubjectKind::bus_errors, bus.name}, bus.connected, bus.state);
  if (!bus.connected) return;
  for (const UnitHealth& unit : bus.units)
    if (unit.answering || !unit.last_error.empty())
      note_link({SubjectKind::device, unit.name}, unit.answering, unit.last_error);
}

void EventLog::note_controller(const ControllerHealth& controller) {
  note_link({SubjectKind::controller, controller.name}, controller.connected,
            controller.last_error);
  note_state({SubjectKind::controller_errors, controller.name}, controller.connected,
             controller.state);
  note_writes(controller);
}

/// Reports one event per outage, with the failed write and its error; a single failure is none.
void EventLog::note_writes(const ControllerHealth& controller) {
  const Subject subject{SubjectKind::controller_writes, controller.name};
  const WriteHealth& write = controller.write;
  const bool none_since = write.confirmed_at == write_.confirmed_at;
  if (!write.error.empty() && none_since && !unwritten_) {
    unwritten_ = true;
    note_fault({.subject = subject, .code = "not_written", .detail = write.error});
  } else if (write.error.empty() && unwritten_) {
    unwritten_ = false;
    spdlog::info("{}: confirmed again; {} refused, {} not answered since the start",
                 subject_text(subject), write.refused, write.unanswered);
    journal_.recovery(subject);
  }
  const std::uint64_t late = write.late - write_.late;
  if (2 * late > controller.reads - reads_ && late > 0 && !late_) {
    spdlog::warn("{}: late, reading and writing take longer than period_s", subject_text(subject));
    late_ = true;
  }
  if (late == 0 && controller.reads != reads_) late_ = false;
  write_ = write;
  reads_ = controller.reads;
}

void EventLog::note_history(const HistoryStatistics& history,
                            const std::vector<std::string>& messages) {
  const Subject subject{SubjectKind::history, ""};
  for (const std::string& what : messages) {
    spdlog::warn("history: {}", what);
    journal_.daemon("history", what);
  }
  if (history.working) {
    if (const double lasted_s = journal_.recovery(subject); lasted_s >= 0.0)
      spdlog::info("history: written again after {:.1f} s, {} records lost in it", lasted_s,
                   history.lost - lost_);
    lost_ = history.lost;
  } else if (!history.last_error.empty()) {
    note_fault({.subject = subject, .code = "not_written", .detail = history.last_error},
               "; compensation continues, retrying");
  }
}

void EventLog::note_missed(std::uint64_t missed) {
  if (missed > missed_) spdlog::warn("{} cycles missed", missed - missed_);
  missed_ = missed;
}

void EventLog::note_failed_sleeps(std::uint64_t failed) {
  if (failed > failed_sleeps_) {
    spdlog::error("clock_nanosleep failed {} times: the cycle waits by poll, a millisecond late",
                  failed - failed_sleeps_);
  }
  failed_sleeps_ = failed;
}

void EventLog::note_log(bool is_stalled) {
  const Subject subject{SubjectKind::log, ""};
  if (is_stalled)
    journal_.fault(
        {.subject = subject, .code = "not_taken", .detail = "it is not read, lines are lost"});
  else
    journal_.recovery(subject);
}

void EventLog::note_socket(const SocketStatistics& statistics) {
  const auto now = std::chrono::steady_clock::now();
  if (now < socket_next_) return;
  const std::uint64_t refused = statistics.refused - socket_.refused;
  const std::uint64_t cut_off = statistics.cut_off - socket_.cut_off;
  const std::uint64_t missed = statistics.missed - socket_.missed;
  if (refused + cut_off + missed == 0) return;
  spdlog::warn("status socket: {} clients refused, {} cut off, {} notifications missed; {} clients",
               refused, cut_off, missed, statistics.clients);
  socket_ = statistics;
  socket_next_ = now + std::chrono::minutes(1);
}

}  // namespace thermocomp
