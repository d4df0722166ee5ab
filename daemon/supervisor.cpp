#include "daemon/supervisor.hpp"

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstring>
#include <fmt/format.h>
#include <initializer_list>
#include <poll.h>
#include <stdexcept>
#include <thread>
#include <unistd.h>
#include <utility>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <sys/signalfd.h>

#include "daemon/cycle/real_time_thread.hpp"
#include "daemon/state/state_file.hpp"
#include "daemon/status/reference_rules.hpp"
#include "daemon/system/log_setup.hpp"
#include "status/figures.hpp"

namespace thermocomp {

SignalFile::SignalFile() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, signal);
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  fd_ = signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

SignalFile::~SignalFile() {
  close(fd_);
}

SignalFile::Asked SignalFile::drain() const noexcept {
  Asked asked;
  signalfd_siginfo info{};
  while (read(fd_, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) {
    if (info.ssi_signo == static_cast<std::uint32_t>(SIGHUP))
      asked.reload = true;
    else
      asked.stop = static_cast<int>(info.ssi_signo);
  }
  return asked;
}

namespace {

using namespace std::chrono_literals;

constexpr auto tick_period = 100ms;
constexpr auto health_period = 1s;
/// While a command or a reload is under way; the cycle needs 1 to 2 ms at 1 kHz.
constexpr auto busy_period = 1ms;
/// Longest time between two looks at the report, also while an operation is under way.
constexpr auto note_period_max = 1s;
constexpr auto ready_within = 5s;
constexpr std::uint64_t cycles_until_ready = 3;
/// Time for which zero offsets are sent and read back before the links are closed.
constexpr auto zero_settles = 500ms;
constexpr auto stop_extended_by = 10s;
/// Age and number limits of ended outages in the status.
constexpr auto recent = 600s;
constexpr std::size_t recent_max = 8;

}  // namespace

Supervisor::Supervisor(const Parts& parts)
    : parts_(parts), events_(parts.journal), reference_wall_s_(parts.keeper.reference().wall_s) {
  add_status_methods(parts_.server, [this] { return view(); });
  parts_.server.add_method("events", AccessClass::read, [this](const nlohmann::json&) {
    return json_of(EventsAnswer{{parts_.journal.events().begin(), parts_.journal.events().end()}});
  });
}

void Supervisor::add_warning(const std::string& warning) {
  spdlog::warn("{}", warning);
  warnings_.push_back(warning);
}

void Supervisor::wait_until_ready() {
  const auto period = std::chrono::duration<double>(1.0 / parts_.config.loop.rate_hz);
  const auto patience = ready_within + period * cycles_until_ready;
  const auto begun = Clock::now();
  while (parts_.cycle.timing().cycles.load() < cycles_until_ready) {
    if (Clock::now() - begun > patience) throw RealTimeError("the cycle does not run");
    std::this_thread::sleep_for(1ms);
  }
  // Start-up (threads, memory) must not count in the cycle's timing.
  parts_.cycle.clear_timing();
  look_at_health();
  parts_.service.ready(status_line(view()));
  if (parts_.config.dry_run)
    spdlog::warn("DRY RUN: everything is read and computed, nothing is written to the controller");
  spdlog::info("ready: {} Hz, {} sensors, {} axes, {}", parts_.config.loop.rate_hz,
               parts_.config.estimator.sensors.size(), parts_.config.estimator.axes.size(),
               real_time_ ? "real-time" : "ordinary schedule");
}

void Supervisor::run() {
  while (!turn()) {
  }
  const bool to_zero = parts_.config.estimator.compensation.on_stop == StopPolicy::ramp_to_zero;
  if (to_zero && !parts_.config.dry_run) ramp_to_zero();
}

bool Supervisor::turn() {
  pollfd files[] = {{parts_.signals.fd(), POLLIN, 0}, {parts_.server.fd(), POLLIN, 0}};
  // Rounded up: a remainder below 1 ms must not become a busy loop.
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(next_tick_ - Clock::now());
  const auto longest = parts_.operations.is_busy() ? busy_period : tick_period;
  const auto timeout = std::clamp<std::chrono::milliseconds>(left, 0ms, longest);
  const int ready = poll(files, 2, static_cast<int>(timeout.count()));
  if (ready < 0 && errno != EINTR)
    throw std::runtime_error(std::string("poll: ") + std::strerror(errno));
  const bool stopping = take_signals();
  parts_.operations.poll();
  // Changes before a command are reported before it, its effects after it.
  if (!parts_.operations.is_busy() || Clock::now() >= next_note_) note_report();
  parts_.server.handle(0ms);
  if (Clock::now() >= next_tick_) tick();
  return stopping;
}

bool Supervisor::take_signals() {
  const SignalFile::Asked asked = parts_.signals.drain();
  if (asked.stop != 0) {
    const std::string why = asked.stop == SIGTERM ? "SIGTERM" : "SIGINT";
    spdlog::info("stopping: {}", why);
    parts_.journal.daemon("stopping", why);
  }
  if (asked.reload && asked.stop == 0) parts_.operations.reload_by_signal();
  return asked.stop != 0;
}

/// A reference from the first values after a start requires an even machine. Judged once, when a
/// change can be distinguished from the resolution of a module.
void Supervisor::judge_reference(const Report& report) {
  constexpr std::chrono::seconds judged_after{120};
  const ReferenceRecord& record = parts_.keeper.reference();
  if (record.wall_s != reference_wall_s_) {
    const bool is_by_itself = record.origin == ReferenceOrigin::first_values;
    reference_wall_s_ = record.wall_s;
    reference_due_ = is_by_itself ? std::optional(Clock::now() + judged_after) : std::nullopt;
  }
  if (!reference_due_ || Clock::now() < *reference_due_) return;
  reference_due_.reset();
  const std::string changed = change_since_start(parts_.config.model, report, trend_);
  if (!changed.empty()) parts_.operations.doubt_reference(changed);
}

void Supervisor::note_report() {
  next_note_ = Clock::now() + note_period_max;
  events_.note_report(parts_.cycle.report(), parts_.config.estimator, parts_.config.dry_run);
  events_.note_estimates(parts_.cycle.report(), parts_.config.estimator,
                         parts_.config.model.temperature_columns());
  const Report& report = parts_.cycle.report();
  const bool all_driven = std::all_of(report.axes.begin(), report.axes.end(),
                                      [](const AxisReport& axis) { return axis.driven; });
  const bool moved =
      has_gain(parts_.config.model) || parts_.config.estimator.correction.learns_bias();
  if (report.mode != Mode::compensating || !all_driven || !moved) idle_until_ = Clock::now();
  if (trend_.is_due(report.now))
    trend_.note(report.now, parts_.config.model.temperature_columns(), report.inputs);
  judge_reference(report);
  frozen_modules_.note(report, parts_.config.estimator);
  events_.note_frozen(frozen_modules_.frozen_s());
  since_probing_.note(report.axes, parts_.config.model_checksum);
  if (!warm_up_.is_due(report.now)) return;
  std::vector<double> displacement_um;
  for (const AxisReport& axis : report.axes) displacement_um.push_back(axis.displacement_um);
  warm_up_.note(report.now, std::move(displacement_um),
                parts_.config.estimator.compensation.warm_um);
}

void Supervisor::tick() {
  next_tick_ = Clock::now() + tick_period;
  const std::uint64_t cycles = parts_.cycle.timing().cycles.load(std::memory_order_acquire);
  if (cycles != cycles_seen_) parts_.service.alive();
  cycles_seen_ = cycles;
  if (Clock::now() >= next_health_) look_at_health();
  parts_.operations.save_state(false);
}

void Supervisor::look_at_health() {
  next_health_ = Clock::now() + health_period;
  buses_.clear();
  for (const auto& source : parts_.sources) buses_.push_back(source->health());
  for (const BusHealth& bus : buses_) events_.note_bus(bus);
  controller_health_ = parts_.link.health();
  events_.note_controller(controller_health_);
  events_.note_missed(parts_.cycle.timing().missed.load());
  events_.note_failed_sleeps(parts_.cycle.timing().failed_sleeps.load());
  events_.note_socket(parts_.server.statistics());
  events_.note_log(log_statistics().is_stalled);
  note_history();
  for (NameLock& lock : parts_.locks) lock.drain();
  parts_.service.status(status_line(view()));
}

void Supervisor::note_history() {
  if (parts_.history != nullptr)
    events_.note_history(parts_.history->statistics(), parts_.history->take_messages());
}

void Supervisor::ramp_to_zero() {
  const double longest_s = parts_.config.estimator.compensation.stop_ramp_s_max;
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(seconds_d(longest_s));
  parts_.service.stopping("taking the offsets to zero");
  if (!parts_.operations.cycle().send({CommandKind::stop, 0, 0.0}, Clock::now())) {
    spdlog::warn("too many commands wait for the cycle: the offsets stay");
    return;
  }
  auto moved = Clock::now();
  auto extended = Clock::time_point{};
  bool again = false;  // a second signal skips the ramp
  while (!again && Clock::now() < end && Clock::now() - moved < zero_settles) {
    if (Clock::now() - extended > 1s) {
      parts_.service.extend_stop(stop_extended_by);
      extended = Clock::now();
    }
    again = turn();
    if (!at_zero()) moved = Clock::now();
  }
  if (at_zero())
    spdlog::info("the offsets are at zero");
  else
    spdlog::warn("not all offsets are at zero: {}",
                 again ? "immediate stop requested" : "stop_ramp_s_max is over");
}

bool Supervisor::at_zero() {
  const Report& report = parts_.cycle.report();
  // Without a controller no offset can be sent.
  if (has_reason(report.reasons, Reason::controller_offline)) return true;
  const double tolerance_um = parts_.config.estimator.compensation.mismatch_um;
  return std::all_of(report.axes.begin(), report.axes.end(), [=](const AxisReport& axis) {
    // Negated: a missing read-back (NaN) does not count.
    return !axis.driven || (axis.offset_um == 0.0 && !(std::abs(axis.applied_um) > tolerance_um));
  });
}

StatusView Supervisor::view() {
  std::vector<std::string> all = warnings_;
  if (parts_.keeper.is_reference_lost())
    all.emplace_back(
        "the machine's reference is lost, compensation stays off: when the machine is cold and "
        "even, give `thermocomp reference`, then `thermocomp enable`");
  if (!parts_.keeper.error().empty()) all.push_back(parts_.keeper.error());
  if (!parts_.operations.reload_problem().empty())
    all.push_back(parts_.operations.reload_problem());
  const std::vector<AxisReport>& axes = parts_.cycle.report().axes;
  for (std::size_t i = 0; i < axes.size() && !parts_.keeper.error().empty(); ++i)
    if (axes[i].waits_for_disk)
      all.push_back("axis " + parts_.config.estimator.axes[i].name +
                    " waits for the state file, which a restart needs for its offset");
  if (const LogStatistics log = log_statistics(); log.is_stalled)
    all.push_back(fmt::format("the log is not read: {} lines are lost", log.dropped));
  const HistoryStatistics statistics =
      parts_.history != nullptr ? parts_.history->statistics() : HistoryStatistics{};
  if (!statistics.last_error.empty()) all.push_back(statistics.last_error);
  std::vector<FrozenModule> frozen;
  for (const auto& [module, same_s] : frozen_modules_.frozen_s())
    frozen.push_back({module, same_s});
  StatusView view{parts_.config,
                  parts_.cycle.report(),
                  parts_.cycle.controller(),
                  parts_.cycle.timing(),
                  buses_,
                  controller_health_,
                  statistics,
                  std::move(all),
                  std::move(frozen),
                  std::chrono::duration<double>(Clock::now() - started_).count(),
                  real_time_,
                  parts_.server.statistics(),
                  parts_.journal.ended_within(recent, recent_max),
                  &trend_,
                  &warm_up_,
                  &since_probing_,
                  parts_.keeper.reference(),
                  parts_.keeper.is_reference_lost(),
                  wall_now_s(),
                  std::chrono::duration<double>(Clock::now() - idle_until_).count()};
  if (const auto& candidate = parts_.cycle.parts().candidate) view.contest = &candidate->score();
  return view;
}

}  // namespace thermocomp
