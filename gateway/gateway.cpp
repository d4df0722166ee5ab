#include "gateway/gateway.hpp"

#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>
#include <systemd/sd-daemon.h>

#include "daemon/socket/status_client.hpp"
#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/alarms/hook_runner.hpp"
#include "gateway/feed/daemon_feed.hpp"
#include "gateway/http/http_server.hpp"
#include "gateway/http/page_files.hpp"
#include "gateway/mqtt/mqtt_publisher.hpp"
#include "gateway/shdr/shdr_adapter.hpp"
#include "gateway/texts/shdr_text.hpp"
#include "status/status_json.hpp"

namespace thermocomp::gateway {
namespace {

sigset_t ending_signals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGTERM);
  sigaddset(&signals, SIGINT);
  return signals;
}

/// Whatever others do not answer (a name server, a disk, a broker), the process ends. What can be
/// closed in order is closed by then.
void end_within(std::chrono::seconds time) {
  std::thread([time] {
    std::this_thread::sleep_for(time);
    spdlog::warn("stopped without waiting any longer");
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
      files_.emplace(page_folder(), charts_folder(), settings.http.body);
      http_.emplace(settings, feed_, *files_, [this](GatewayFigures& figures) {
        if (mqtt_) mqtt_->add_figures(figures);
      });
    }
    feed_.listen([this](const SnapshotPointer& snapshot) { show(snapshot); });
    feed_.start();
  }
  ~Gateway() { feed_.stop(); }  // before those who listen
  Gateway(const Gateway&) = delete;
  Gateway& operator=(const Gateway&) = delete;

  /// A line for whoever started it: which ports it has.
  [[nodiscard]] std::string ready_line() const {
    nlohmann::json ready = {{"ready", true}};
    if (http_) ready["http"] = http_->port();
    if (shdr_) ready["shdr"] = shdr_->port();
    return ready.dump();
  }
  /// Each second.
  void tick() {
    if (http_) http_->end_slow_connections();
  }

 private:
  /// On the feed's thread.
  void show(const SnapshotPointer& snapshot) {
    if (http_) http_->show(snapshot);
    if (mqtt_) mqtt_->show(snapshot);
    if (shdr_) shdr_->show(snapshot);
    watch_alarms(*snapshot);
  }

  /// Judged by a clock that nobody sets; told with the time of day.
  void watch_alarms(const Snapshot& snapshot) {
    const double now_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
    const auto with_time_of_day = [&](Alarm alarm) {
      alarm.since_s += snapshot.wall_s - now_s;
      return alarm;
    };
    std::vector<AlarmChange> changes = alarms_.update(now_s, wrong_now(snapshot), snapshot.is_here);
    if (changes.empty() && alarms_told_) return;
    std::vector<Alarm> active = alarms_.active();
    for (Alarm& alarm : active) alarm = with_time_of_day(alarm);
    if (mqtt_ && changes.empty()) mqtt_->show_alarms(active, nullptr, snapshot.wall_s);
    alarms_told_ = true;
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
  bool alarms_told_{false};  ///< also that there are none
  std::optional<MqttPublisher> mqtt_;
  std::optional<ShdrAdapter> shdr_;
  std::optional<HookRunner> hooks_;
  std::optional<PageFiles> files_;
  std::optional<HttpServer> http_;
};

}  // namespace

std::string ask_device_file(const GatewaySettings& settings) {
  StatusClient client(settings.socket);
  Snapshot snapshot;
  snapshot.is_here = true;
  snapshot.status = part_from<Status>(client.call("status", nlohmann::json::object()));
  snapshot.sensors = part_from<SensorsAnswer>(client.call("sensors", nlohmann::json::object()));
  snapshot.wall_s = static_cast<double>(std::time(nullptr));
  return device_file(snapshot, settings.machine);
}

void run_gateway(const GatewaySettings& settings) {
  // Blocked before the first thread, so that only the wait below gets them.
  const sigset_t signals = ending_signals();
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
  Gateway gateway(settings);
  std::printf("%s\n", gateway.ready_line().c_str());
  std::fflush(stdout);
  spdlog::info("ready: {}", gateway.ready_line());
  sd_notify(0, "READY=1");
  const timespec second{1, 0};
  for (;;) {
    if (sigtimedwait(&signals, nullptr, &second) > 0) break;
    gateway.tick();
    sd_notify(0, "WATCHDOG=1");
  }
  sd_notify(0, "STOPPING=1");
  spdlog::info("stopped as asked");
  constexpr std::chrono::seconds end_max(5);
  end_within(end_max);
}

}  // namespace thermocomp::gateway
