// thermocomp-gateway: publishes thermocompd's status to browsers, Prometheus, MQTT and MTConnect.
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <iostream>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/async.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include "daemon/socket/status_client.hpp"
#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/alarms/hook_runner.hpp"
#include "gateway/api/gateway_server.hpp"
#include "gateway/command_line.hpp"
#include "gateway/feed/daemon_feed.hpp"
#include "gateway/http/page_files.hpp"
#include "gateway/http/password_file.hpp"
#include "gateway/mqtt/mqtt_publisher.hpp"
#include "gateway/settings/gateway_settings.hpp"
#include "gateway/shdr/shdr_adapter.hpp"
#include "gateway/texts/shdr_text.hpp"
#include "report/command.hpp"
#include "status/status.hpp"

namespace thermocomp::gateway {
namespace {

sigset_t ending_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  return signals;
}

/// Ends the process after `time`, even if a name server, disk or broker does not answer. By then an
/// orderly shutdown is finished.
void end_within(std::chrono::seconds time) {
  std::thread([time] {
    std::this_thread::sleep_for(time);
    spdlog::warn("stopped after the timeout of an orderly stop");
    std::_Exit(0);
  }).detach();
}

class Gateway {
 public:
  explicit Gateway(const GatewaySettings& settings)
      : feed_(settings), alarms_(settings.alarm.raise_after_s, settings.alarm.clear_after_s) {
    if (settings.mqtt.enabled) mqtt_.emplace(settings);
    if (settings.shdr.enabled) shdr_.emplace(settings.shdr);
    if (!settings.alarm.command.empty()) hooks_.emplace(settings);
    if (settings.http.enabled) {
      files_.emplace(page_folder("gateway"), charts_folder(), settings.http.body);
      http_.emplace(settings, feed_, *files_, [this](GatewayFigures& figures) {
        if (mqtt_) mqtt_->add_figures(figures);
      });
    }
    feed_.listen([this](const SnapshotPointer& snapshot) { show(snapshot); });
    feed_.start();
  }
  ~Gateway() { feed_.stop(); }  // before its listeners
  Gateway(const Gateway&) = delete;
  Gateway& operator=(const Gateway&) = delete;

  /// One line with the ports, for the caller.
  [[nodiscard]] std::string ready_line() const {
    nlohmann::json ready = {{"ready", true}};
    if (http_) ready["http"] = http_->port();
    if (shdr_) ready["shdr"] = shdr_->port();
    return ready.dump();
  }
  [[nodiscard]] bool follows() const { return feed_.follows(); }
  /// Called every second.
  void tick() {
    if (http_) http_->end_slow_connections();
  }

 private:
  /// Called on the feed's thread.
  void show(const SnapshotPointer& snapshot) {
    if (http_) http_->show(snapshot);
    if (mqtt_) mqtt_->show(snapshot);
    if (shdr_) shdr_->show(snapshot);
    watch_alarms(*snapshot);
  }

  /// Durations use the monotonic clock; published times are wall clock.
  void watch_alarms(const Snapshot& snapshot) {
    const double now_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    const auto with_time_of_day = [&](Alarm alarm) {
      alarm.since_s += snapshot.wall_s - now_s;
      return alarm;
    };
    std::vector<AlarmChange> changes =
        alarms_.update(now_s, active_conditions(snapshot), is_judged(snapshot));
    if (changes.empty() && alarms_published_) return;
    std::vector<Alarm> active = alarms_.active();
    for (Alarm& alarm : active) alarm = with_time_of_day(alarm);
    if (mqtt_ && changes.empty()) mqtt_->show_alarms(active, nullptr, snapshot.wall_s);
    alarms_published_ = true;
    for (AlarmChange& change : changes) {
      change.alarm = with_time_of_day(change.alarm);
      spdlog::warn("alarm {} {}: {}", change.is_raised ? "raised" : "cleared",
                   change.alarm.condition.name, change.alarm.condition.text);
      if (mqtt_) mqtt_->show_alarms(active, &change, snapshot.wall_s);
      if (hooks_) hooks_->offer(change);
    }
  }

  DaemonFeed feed_;
  AlarmWatch alarms_;
  bool alarms_published_{false};  ///< alarms were published once, even if there were none
  std::optional<MqttPublisher> mqtt_;
  std::optional<ShdrAdapter> shdr_;
  std::optional<HookRunner> hooks_;
  std::optional<PageFiles> files_;
  std::optional<GatewayServer> http_;
};

/// Device file for the MTConnect agent, from the running daemon.
/// @throws ClientError if it does not answer
std::string ask_device_file(const GatewaySettings& settings) {
  StatusClient client(settings.socket);
  Snapshot snapshot;
  snapshot.is_here = true;
  snapshot.status = part_from<Status>(client.call("status", nlohmann::json::object()));
  snapshot.sensors = part_from<SensorsAnswer>(client.call("sensors", nlohmann::json::object()));
  snapshot.wall_s = static_cast<double>(std::time(nullptr));
  return device_file(snapshot, settings.machine);
}

/// Runs until a signal. @throws std::exception if a port or file cannot be used
void run_gateway(const GatewaySettings& settings) {
  const sigset_t signals = ending_signals();
  Gateway gateway(settings);
  std::printf("%s\n", gateway.ready_line().c_str());
  std::fflush(stdout);
  spdlog::info("ready: {}", gateway.ready_line());
  sd_notify(0, "READY=1");
  const timespec second{1, 0};
  for (;;) {
    if (sigtimedwait(&signals, nullptr, &second) > 0) break;
    gateway.tick();
    if (gateway.follows()) sd_notify(0, "WATCHDOG=1");
  }
  sd_notify(0, "STOPPING=1");
  spdlog::info("stopped on request");
  constexpr std::chrono::seconds end_max(5);
  end_within(end_max);
}

/// Logs to the journal under systemd, else to standard error, from a separate thread, so that a
/// pipe without a reader cannot stop the feed.
void set_up_log(const std::string& level) {
  constexpr std::size_t lines_max = 1024;
  const char* name = "thermocomp-gateway";
  spdlog::init_thread_pool(lines_max, 1);
  spdlog::sink_ptr sink;
  if (std::getenv("JOURNAL_STREAM") != nullptr)
    sink = std::make_shared<spdlog::sinks::systemd_sink_mt>(name);
  else
    sink = std::make_shared<spdlog::sinks::stderr_color_sink_mt>();
  spdlog::set_default_logger(std::make_shared<spdlog::async_logger>(
      name, sink, spdlog::thread_pool(), spdlog::async_overflow_policy::overrun_oldest));
  spdlog::set_level(spdlog::level::from_str(level));
}

int print_password_line(const std::string& user) {
  std::string password;
  std::getline(std::cin, password);
  std::printf("%s\n", password_line(user, password).c_str());
  return 0;
}

int run(const GatewayOptions& options) {
  if (!options.password_user.empty()) return print_password_line(options.password_user);
  const GatewaySettings settings = load_gateway_settings(options.config_file);
  if (options.device_file) {
    std::printf("%s", ask_device_file(settings).c_str());
    return 0;
  }
  // Blocked before the first thread starts, so that only sigtimedwait() receives them.
  const sigset_t signals = ending_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  set_up_log(settings.log_level);
  run_gateway(settings);
  return 0;
}

}  // namespace
}  // namespace thermocomp::gateway

int main(int argc, char** argv) {
  using namespace thermocomp;
  gateway::GatewayOptions options;
  return cli::run_program(
      argc, argv, "thermocomp-gateway",
      [&](CLI::App& app, cli::Action& action) {
        gateway::declare_gateway_command_line(app, options);
        action = [&] { return gateway::run(options); };
      },
      cli::exit_no);
}
