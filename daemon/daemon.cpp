#include "daemon/daemon.hpp"

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdlib>
#include <cstring>
#include <malloc.h>
#include <poll.h>
#include <thread>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <sys/signalfd.h>

#include "config/daemon_config.hpp"
#include "config/problems.hpp"
#include "daemon/bridge_desk.hpp"
#include "daemon/cycle/cycle.hpp"
#include "daemon/cycle/real_time_thread.hpp"
#include "daemon/event_log.hpp"
#include "daemon/log_setup.hpp"
#include "daemon/operator_desk.hpp"
#include "daemon/service_manager.hpp"
#include "daemon/state/state_file.hpp"
#include "daemon/status_json.hpp"
#include "drivers/controllers/make_controller.hpp"
#include "drivers/sensors/can_protocol_source.hpp"
#include "drivers/sensors/can_source.hpp"
#include "drivers/sensors/modbus_source.hpp"

namespace thermocomp {
namespace {

using Clock = std::chrono::steady_clock;
using namespace std::chrono_literals;

constexpr auto tick_period = 100ms;
constexpr auto health_period = 1s;
constexpr auto offsets_saved_every = 10s;
/// Longest wait for the cycle to take a command or a new configuration; at 1 Hz it needs up to 2 s.
constexpr auto cycle_answer_max = 5s;
constexpr std::uint64_t cycles_until_ready = 3;
/// Offsets at zero are sent, and read back, for so long before the links are closed.
constexpr auto zero_settles = 500ms;
constexpr auto stop_extended_by = 10s;
/// At 1 Hz it ends within a second.
constexpr auto cycle_ends_within = 3s;

Grid make_grid(const LoopConfig& loop) {
  const auto now = std::chrono::duration_cast<nanoseconds>(Clock::now().time_since_epoch());
  return {now, nanoseconds(std::llround(1e9 / loop.rate_hz))};
}

std::vector<std::unique_ptr<SensorSource>> make_sources(const DaemonConfig& config) {
  std::vector<std::unique_ptr<SensorSource>> sources;
  for (const ModbusBusConfig& bus : config.modbus_buses)
    sources.push_back(std::make_unique<ModbusSource>(bus));
  for (const CanBusConfig& bus : config.can_buses)
    sources.push_back(std::make_unique<CanSource>(bus));
  for (const CanopenBusConfig& bus : config.canopen_buses) sources.push_back(make_source(bus));
  for (const J1939BusConfig& bus : config.j1939_buses) sources.push_back(make_source(bus));
  return sources;
}

std::vector<SensorSource*> pointers(const std::vector<std::unique_ptr<SensorSource>>& sources) {
  std::vector<SensorSource*> list;
  list.reserve(sources.size());
  for (const auto& source : sources) list.push_back(source.get());
  return list;
}

int open_signals() {
  sigset_t set;
  sigemptyset(&set);
  for (const int signal : {SIGTERM, SIGINT, SIGHUP}) sigaddset(&set, signal);
  // Blocked before any thread is made: all of them inherit it, and main reads them from the file.
  pthread_sigmask(SIG_BLOCK, &set, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  return signalfd(-1, &set, SFD_CLOEXEC | SFD_NONBLOCK);
}

}  // namespace

struct Daemon::Parts {
  explicit Parts(const std::filesystem::path& config_file);

  void start();
  void wait_until_ready();
  void supervise();
  void ramp_to_zero();
  void stop() noexcept;

  void turn(bool& stopping);
  void tick();
  void look_at_health();
  void save_state(bool now);
  [[nodiscard]] bool at_zero();
  [[nodiscard]] PersistentState persistent_state();
  void take_signals(bool& stopping);
  void reload();
  void command(const Command& command);
  [[nodiscard]] StatusView view();
  [[nodiscard]] std::unique_ptr<CycleBrain> make_brain(const DaemonConfig& next);

  DaemonConfig config;
  int signals;
  ServiceManager service;
  EventLog events;
  std::vector<std::string> warnings;
  std::vector<std::unique_ptr<SensorSource>> sources;
  std::unique_ptr<ControllerLink> link;
  Grid grid;
  std::unique_ptr<HistoryWriter> history;
  std::unique_ptr<Cycle> cycle;
  std::unique_ptr<StatusServer> server;
  RealTimeThread thread;

  Clock::time_point started{Clock::now()};
  Clock::time_point next_tick{};
  Clock::time_point next_health{};
  Clock::time_point next_offsets_saved{};
  std::uint64_t cycles_seen{0};
  PersistentState saved;
  std::string save_error;
  std::vector<BusHealth> buses;
  ControllerHealth controller_health;
  bool real_time{false};
};

Daemon::Parts::Parts(const std::filesystem::path& config_file)
    : config(load_daemon_config(config_file)),
      signals(open_signals()),
      sources(make_sources(config)),
      link(make_controller(config.controller)),
      grid(make_grid(config.loop)) {
  set_log_level(config.log_level);
  spdlog::info("thermocompd {}: configuration {}, model {} (SHA-256 {})", THERMOCOMP_VERSION,
               config.file.string(), config.model_file.string(), config.model_checksum);
  if (config.history.enabled)
    history = std::make_unique<HistoryWriter>(config.history, grid, THERMOCOMP_VERSION);
  server = std::make_unique<StatusServer>(config.socket);
  auto brain = make_brain(config);
  PersistentState fallback;
  fallback.enabled = config.estimator.compensation.enabled_at_first_start;
  const LoadedState loaded = load_state_file(config.state_file, fallback);
  if (!loaded.warning.empty()) {
    spdlog::warn("{}", loaded.warning);
    warnings.push_back(loaded.warning);
  }
  brain->estimator.restore(loaded.state);
  saved = loaded.state;
  cycle = std::make_unique<Cycle>(grid, pointers(sources), *link, config.estimator.sensors.size(),
                                  std::move(brain));
  DeskActions actions{[this] { return view(); },
                      [this](const Command& asked) { command(asked); },
                      [this] { reload(); },
                      {}};
  if (auto* bridge = dynamic_cast<BridgeController*>(link.get()))
    actions.controller_state = [this, bridge](const nlohmann::json& params) {
      return answer_bridge(*bridge, std::get<BridgeControllerConfig>(config.controller),
                           cycle->report().mode, params);
    };
  add_operator_methods(*server, actions);
}

std::unique_ptr<CycleBrain> Daemon::Parts::make_brain(const DaemonConfig& next) {
  auto brain = std::make_unique<CycleBrain>(Estimator(next.estimator, next.model));
  if (history)
    brain->recorder =
        history->make_recorder({next.text, next.model_text, next.model_checksum}, brain->estimator);
  return brain;
}

void Daemon::Parts::start() {
  const auto warn = [this](const std::string& warning) {
    if (warning.empty()) return;
    if (config.loop.real_time == RealTimeRule::require)
      throw RealTimeError(warning + "; loop.real_time = \"require\" forbids to run like this");
    spdlog::warn("{}", warning);
    warnings.push_back(warning);
  };
  if (history) history->start();
  for (const auto& source : sources) source->start();
  link->start();
  warn(lock_memory());
  const std::string no_fifo =
      thread.start({config.loop.priority, config.loop.cpu}, [this] { cycle->run(); });
  real_time = no_fifo.empty();
  warn(no_fifo);
}

void Daemon::Parts::wait_until_ready() {
  const auto until = Clock::now() + cycle_answer_max + grid.period * cycles_until_ready;
  while (cycle->timing().cycles.load() < cycles_until_ready) {
    if (Clock::now() > until) throw RealTimeError("the cycle does not run");
    std::this_thread::sleep_for(1ms);
  }
  // What happened while threads and memory were being set up is not the cycle's record.
  cycle->clear_timing();
  look_at_health();
  service.ready(status_line(view()));
  spdlog::info("ready: {} Hz, {} sensors, {} axes, {}", config.loop.rate_hz,
               config.estimator.sensors.size(), config.estimator.axes.size(),
               real_time ? "real-time" : "ordinary schedule");
}

void Daemon::Parts::supervise() {
  bool stopping = false;
  while (!stopping) turn(stopping);
  if (config.estimator.compensation.on_stop == StopPolicy::ramp_to_zero) ramp_to_zero();
}

void Daemon::Parts::turn(bool& stopping) {
  pollfd files[] = {{signals, POLLIN, 0}, {server->fd(), POLLIN, 0}};
  // Rounded up: a rest of a millisecond must be slept, not spun through.
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(next_tick - Clock::now()).count();
  const int ready = poll(files, 2, static_cast<int>(std::clamp<std::int64_t>(left, 0, 100)));
  if (ready < 0 && errno != EINTR)
    throw std::runtime_error(std::string("poll: ") + std::strerror(errno));
  take_signals(stopping);
  server->handle(0ms);
  if (Clock::now() >= next_tick) tick();
}

void Daemon::Parts::ramp_to_zero() {
  const double longest_s = config.estimator.compensation.stop_ramp_s_max;
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(seconds_d(longest_s));
  service.stopping("taking the offsets to zero");
  if (!cycle->send({CommandKind::stop, 0, 0.0})) {
    spdlog::warn("too many commands wait for the cycle: the offsets stay");
    return;
  }
  auto moved = Clock::now();
  auto extended = Clock::time_point{};
  bool again = false;  // who asks twice does not want to wait
  while (!again && Clock::now() < end && Clock::now() - moved < zero_settles) {
    if (Clock::now() - extended > 1s) {
      service.extend_stop(stop_extended_by);
      extended = Clock::now();
    }
    turn(again);
    if (!at_zero()) moved = Clock::now();
  }
  if (at_zero())
    spdlog::info("the offsets are at zero");
  else
    spdlog::warn("not all offsets are at zero: {}",
                 again ? "asked to stop at once" : "stop_ramp_s_max is over");
}

bool Daemon::Parts::at_zero() {
  const Report& report = cycle->report();
  // Of what cannot be sent nothing is waited for.
  if (has_reason(report.reasons, Reason::controller_offline)) return true;
  const double tolerance_um = config.estimator.compensation.mismatch_um;
  return std::all_of(report.axes.begin(), report.axes.end(), [=](const AxisReport& axis) {
    // Negated: what is not read back (NaN) does not count.
    return !axis.driven || (axis.offset_um == 0.0 && !(std::abs(axis.applied_um) > tolerance_um));
  });
}

void Daemon::Parts::take_signals(bool& stopping) {
  signalfd_siginfo info{};
  while (read(signals, &info, sizeof info) == static_cast<ssize_t>(sizeof info)) {
    if (info.ssi_signo != static_cast<std::uint32_t>(SIGHUP)) {
      spdlog::info("stopping: {}", info.ssi_signo == SIGTERM ? "SIGTERM" : "SIGINT");
      stopping = true;
      continue;
    }
    try {
      reload();
    } catch (const std::exception& error) {
      spdlog::error("reload refused, the running configuration stays:\n{}", error.what());
    }
  }
}

void Daemon::Parts::tick() {
  next_tick = Clock::now() + tick_period;
  const std::uint64_t cycles = cycle->timing().cycles.load(std::memory_order_acquire);
  if (cycles != cycles_seen) service.alive();
  cycles_seen = cycles;
  events.note_report(cycle->report(), config.estimator);
  events.note_estimates(cycle->report(), config.estimator, config.model.temperature_columns());
  if (Clock::now() >= next_health) look_at_health();
  save_state(Clock::now() >= next_offsets_saved);
}

void Daemon::Parts::look_at_health() {
  next_health = Clock::now() + health_period;
  buses.clear();
  for (const auto& source : sources) buses.push_back(source->health());
  for (const BusHealth& bus : buses) events.note_bus(bus);
  controller_health = link->health();
  events.note_controller(controller_health);
  events.note_missed(cycle->timing().missed.load());
  events.note_failed_sleeps(cycle->timing().failed_sleeps.load());
  events.note_socket(server->statistics());
  service.status(status_line(view()));
}

static void add_axis_state(const std::string& name, const AxisReport& axis,
                           PersistentState& state) {
  state.offset_um[name] = axis.offset_um;
  if (std::isfinite(axis.held_um)) state.held_um[name] = axis.held_um;
  for (const auto& [key, value] : RunningCorrection::persistent(axis.correction))
    state.correction[std::string(name).append(".").append(key)] = value;
}

PersistentState Daemon::Parts::persistent_state() {
  const Report& report = cycle->report();
  PersistentState state;
  state.enabled = report.enabled;
  state.model_reference_degC = cycle->brain().estimator.model_reference_degC();
  const auto columns = config.model.temperature_columns();
  for (std::size_t i = 0; i < columns.size(); ++i) {
    const InputReport& input = report.inputs[i];
    if (std::isfinite(input.reference_degC))
      state.reference_degC[columns[i]] = input.reference_degC;
    if (input.good || input.estimated) state.temp_degC[columns[i]] = input.temp_degC;
  }
  const auto signal_columns = config.model.signal_columns();
  for (std::size_t i = 0; i < signal_columns.size(); ++i)
    if (std::isfinite(report.signals[i].reference))
      state.reference_signals[signal_columns[i]] = report.signals[i].reference;
  for (std::size_t i = 0; i < report.axes.size(); ++i)
    add_axis_state(config.estimator.axes[i].name, report.axes[i], state);
  return state;
}

void Daemon::Parts::save_state(bool now) {
  PersistentState state = persistent_state();
  const bool switched = state.enabled != saved.enabled ||
                        state.reference_degC != saved.reference_degC ||
                        state.reference_signals != saved.reference_signals ||
                        state.held_um != saved.held_um || state.correction != saved.correction;
  if (!switched && !(now && state.offset_um != saved.offset_um)) return;
  next_offsets_saved = Clock::now() + offsets_saved_every;
  const std::string error = save_state_file(config.state_file, state);
  if (!error.empty() && error != save_error) spdlog::error("{}", error);
  save_error = error;
  if (error.empty()) saved = std::move(state);
}

void Daemon::Parts::command(const Command& asked) {
  const std::uint64_t before = cycle->timing().cycles.load(std::memory_order_acquire);
  if (!cycle->send(asked)) throw RpcError(rpc::refused, "too many commands wait for the cycle");
  // Taken at the next step; the one after that is certain to have published what it did.
  const auto until = Clock::now() + cycle_answer_max;
  while (cycle->timing().cycles.load(std::memory_order_acquire) < before + 2) {
    if (Clock::now() > until) throw RpcError(rpc::internal_error, "the cycle does not answer");
    std::this_thread::sleep_for(1ms);
  }
  spdlog::info(
      "operator: {}{}", to_string(asked.kind),
      asked.kind == CommandKind::measured || asked.kind == CommandKind::prove
          ? fmt::format(" {} {} um", config.estimator.axes[asked.axis].name, asked.value_um)
          : "");
  // Called done only when it would survive a power cut.
  save_state(true);
  const bool is_kept = asked.kind == CommandKind::enable || asked.kind == CommandKind::disable ||
                       asked.kind == CommandKind::reference;
  if (is_kept && !save_error.empty())
    throw RpcError(rpc::internal_error,
                   "carried out, but not saved, so that a restart would undo it: " + save_error);
}

void Daemon::Parts::reload() {
  service.reloading();
  try {
    DaemonConfig next = load_daemon_config(config.file);
    const std::vector<std::string> fixed = restart_needed(config, next);
    if (!fixed.empty()) {
      std::string keys;
      for (const std::string& key : fixed) keys += (keys.empty() ? "" : ", ") + key;
      throw RpcError(rpc::refused, "a restart is needed for a change of: " + keys);
    }
    auto brain = make_brain(next);
    brain->estimator.plan_adoption(cycle->brain().estimator);
    cycle->hand_over(std::move(brain));
    const auto until = Clock::now() + cycle_answer_max;
    std::unique_ptr<CycleBrain> retired;
    while (!(retired = cycle->take_retired())) {
      if (Clock::now() > until) throw RpcError(rpc::internal_error, "the cycle does not answer");
      std::this_thread::sleep_for(1ms);
    }
    config = std::move(next);
    set_log_level(config.log_level);
    spdlog::info("reloaded: model {} (SHA-256 {})", config.model_file.string(),
                 config.model_checksum);
  } catch (...) {
    malloc_trim(0);  // what the refused files took; locked memory is never given back by itself
    service.ready(status_line(view()));
    throw;
  }
  service.ready(status_line(view()));
}

StatusView Daemon::Parts::view() {
  std::vector<std::string> all = warnings;
  if (!save_error.empty()) all.push_back(save_error);
  const HistoryStatistics statistics = history ? history->statistics() : HistoryStatistics{};
  if (history && !statistics.last_error.empty()) all.push_back(statistics.last_error);
  return {config,
          cycle->report(),
          cycle->controller(),
          cycle->timing(),
          buses,
          controller_health,
          statistics,
          std::move(all),
          std::chrono::duration<double>(Clock::now() - started).count(),
          real_time,
          server->statistics()};
}

void Daemon::Parts::stop() noexcept {
  service.stopping("the controller keeps the last offsets");
  cycle->stop();
  if (!thread.join_within(cycle_ends_within)) {
    // Nothing of it can be trusted, and it may stand in the midst of anything: what a kill would
    // leave is what is left, and the service manager need not wait for a time-out.
    spdlog::critical("the cycle hangs; ending without it");
    spdlog::shutdown();
    std::_Exit(EXIT_FAILURE);
  }
  link->stop();
  for (const auto& source : sources) source->stop();
  if (CycleRecorder* recorder = cycle->brain().recorder.get())
    recorder->finish(cycle->last_cycle(), cycle->last_offsets());
  try {
    save_state(true);
  } catch (const std::exception& error) {
    spdlog::error("state not saved: {}", error.what());
  }
  if (history) history->stop();
  close(signals);
}

Daemon::Daemon(const std::filesystem::path& config_file)
    : parts_(std::make_unique<Parts>(config_file)) {}
Daemon::~Daemon() = default;

void Daemon::run() {
  try {
    parts_->start();
    parts_->wait_until_ready();
    parts_->supervise();
  } catch (...) {
    parts_->stop();
    throw;
  }
  parts_->stop();
  spdlog::info("stopped; the controller keeps the last offsets");
}

}  // namespace thermocomp
