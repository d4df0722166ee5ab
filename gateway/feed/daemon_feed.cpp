#include "gateway/feed/daemon_feed.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <ctime>
#include <mutex>
#include <thread>
#include <utility>

#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "daemon/history/reading/history_reader.hpp"
#include "daemon/socket/status_client.hpp"
#include "daemon/threads/side_thread.hpp"
#include "gateway/feed/snapshot.hpp"
#include "status/status.hpp"

namespace thermocomp::gateway {
namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr double period_s = 0.5;
constexpr std::chrono::milliseconds silence_max(1500);
constexpr std::chrono::seconds events_every(5);
constexpr std::size_t events_max = 200;
constexpr double earlier_s = 7.0 * 86400.0;
constexpr std::chrono::seconds again_after(1);

double wall_s() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double steady_s() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

/// Status values that change with an event.
struct Happened {
  Mode mode{Mode::starting};
  std::uint32_t reasons{0};
  std::vector<std::string> sensors_bad;
  std::size_t ended{0};
  std::uint64_t last_ended{0};
  bool operator==(const Happened&) const = default;
};

Happened happened_in(const Status& status) {
  return {status.mode, status.reasons, status.sensors_bad, status.ended.size(),
          status.ended.empty() ? 0 : status.ended.front().number};
}

}  // namespace

struct DaemonFeed::Parts {
  explicit Parts(const GatewaySettings& settings_in) : settings(settings_in) {}

  void run();
  void follow();
  void take_sensors(StatusClient& client);
  void renew_slow_answers(StatusClient& client);
  void renew_events(StatusClient& client);
  void take_earlier_events(const Event& own);
  void publish();
  void be_away(const std::string& why);
  /// @return false if the gateway stops
  bool sleep(std::chrono::milliseconds time);

  const GatewaySettings& settings;
  std::vector<Listener> listeners;
  std::thread thread;
  std::atomic<bool> stops{false};
  std::mutex stop_mutex;
  std::condition_variable stop_changed;

  mutable std::mutex mutex;  ///< guards the next two
  SnapshotPointer newest{std::make_shared<Snapshot>()};
  Clock::time_point newest_at{Clock::now()};

  // Feed's thread only.
  Snapshot next;
  TrendWatch trends;
  bool has_status{false};
  std::string model_checksum;  ///< of `next.model`
  /// Events of earlier runs from the history, read on a thread because the disk may stall.
  std::vector<Event> earlier;
  double absent_s{not_a_number};                         ///< time without a daemon before this run
  std::shared_ptr<std::vector<RecordedEvent>> recorded;  ///< owned by the thread while it is busy
  bool is_run_recorded{false};  ///< the history contains this run, so `earlier` is complete
  SideThread history_thread{"history"};
  Clock::time_point events_at{};
  Happened happened;  ///< at the last request for events
};

void DaemonFeed::Parts::run() {
  next.since_s = wall_s();
  while (!stops) {
    try {
      follow();
    } catch (const std::exception& error) {
      be_away(error.what());
    }
    if (!sleep(again_after)) return;
  }
}

/// Returns only by exception, or when the gateway stops. @throws ClientError, RemoteError
void DaemonFeed::Parts::follow() {
  StatusClient client(settings.socket, silence_max);
  const json subscription = {{"methods", {"status", "sensors"}}, {"period_s", period_s}};
  static_cast<void>(client.call("subscribe", subscription, silence_max));
  while (!stops) {
    json notification = client.next(silence_max);
    const std::string method = notification.value("method", std::string());
    if (method == "status") {
      next.status = part_from<Status>(notification["params"]);
      has_status = true;
    }
    if (method == "sensors" && has_status) {  // ignored until the first status
      next.sensors = part_from<SensorsAnswer>(notification["params"]);
      take_sensors(client);
    }
  }
}

void DaemonFeed::Parts::take_sensors(StatusClient& client) {
  renew_slow_answers(client);
  for (const SensorStatus& sensor : next.sensors.sensors) {
    trends.add(sensor.name, steady_s(), sensor.smoothed_degC);
    next.trends[sensor.name] = trends.per_hour(sensor.name);
  }
  if (!next.is_here) {
    spdlog::info("the daemon answers at {}", settings.socket.string());
    next.since_s = wall_s();
  }
  next.is_here = true;
  next.why.clear();
  publish();
}

/// Requests the model if it changed, and events if the status indicates new ones, else every few
/// seconds (there may be a thousand).
void DaemonFeed::Parts::renew_slow_answers(StatusClient& client) {
  const std::string& checksum = next.status.model.checksum;
  if (!next.is_here || model_checksum != checksum) {
    model_checksum = checksum;
    next.model = std::make_shared<const json>(client.call("model", json::object(), silence_max));
    trends.forget();
    next.trends.clear();
    events_at = {};
  }
  if (!next.is_here) is_run_recorded = false;
  Happened now = happened_in(next.status);
  if (now == happened && Clock::now() - events_at < events_every) return;
  happened = std::move(now);
  events_at = Clock::now();
  renew_events(client);
}

void DaemonFeed::Parts::renew_events(StatusClient& client) {
  std::vector<Event> own =
      part_from<EventsAnswer>(client.call("events", json::object(), silence_max)).events;
  if (own.empty()) return;
  if (next.status.history.enabled && !is_run_recorded) take_earlier_events(own.front());
  if (own.front().number == 1) own.front().duration_s = absent_s;
  std::vector<Event> all = earlier;
  all.insert(all.end(), own.begin(), own.end());
  if (all.size() > events_max)
    all.erase(all.begin(), all.end() - static_cast<std::ptrdiff_t>(events_max));
  next.events = std::make_shared<const std::vector<Event>>(std::move(all));
}

/// @param own  oldest event of this run that the daemon has
void DaemonFeed::Parts::take_earlier_events(const Event& own) {
  constexpr std::chrono::milliseconds mostly_enough(200);
  if (!history_thread.is_busy()) {
    recorded = std::make_shared<std::vector<RecordedEvent>>();
    std::filesystem::path file = settings.history;
    if (file.empty()) file = next.status.history.file;
    const HistoryTime from{.seconds = {}, .wall_ns = std::llround(1e9 * (wall_s() - earlier_s))};
    history_thread.start([file, from, found = recorded] {
      try {
        *found = read_events(file, from);
      } catch (const std::exception&) {  // the charts report the cause
        found->clear();
      }
    });
  }
  if (!history_thread.wait(mostly_enough)) return;
  const auto first = std::find_if(recorded->begin(), recorded->end(), [&own](const Event& event) {
    return event.number == own.number && std::abs(event.wall_s - own.wall_s) < 0.001;
  });
  is_run_recorded = first != recorded->end();
  absent_s = is_run_recorded ? first->duration_s : not_a_number;
  earlier.assign(recorded->begin(), first);
}

void DaemonFeed::Parts::publish() {
  next.wall_s = wall_s();
  ++next.number;
  const auto made = std::make_shared<const Snapshot>(next);
  {
    const std::lock_guard lock(mutex);
    newest = made;
    newest_at = Clock::now();
  }
  for (const Listener& listener : listeners) listener(made);
}

void DaemonFeed::Parts::be_away(const std::string& why) {
  if (next.is_here || next.why.empty()) {
    if (next.is_here) next.since_s = wall_s();
    spdlog::warn("the daemon is away: {}", why);
  }
  next.is_here = false;
  next.why = why;
  publish();
}

bool DaemonFeed::Parts::sleep(std::chrono::milliseconds time) {
  std::unique_lock lock(stop_mutex);
  return !stop_changed.wait_for(lock, time, [this] { return stops.load(); });
}

DaemonFeed::DaemonFeed(const GatewaySettings& settings)
    : parts_(std::make_unique<Parts>(settings)) {}

DaemonFeed::~DaemonFeed() {
  stop();
}

void DaemonFeed::listen(Listener listener) {
  parts_->listeners.push_back(std::move(listener));
}

void DaemonFeed::start() {
  parts_->thread = std::thread([this] { parts_->run(); });
}

void DaemonFeed::stop() noexcept {
  {
    const std::lock_guard lock(parts_->stop_mutex);
    parts_->stops = true;
  }
  parts_->stop_changed.notify_all();
  if (parts_->thread.joinable()) parts_->thread.join();
}

SnapshotPointer DaemonFeed::newest() const {
  SnapshotPointer newest;
  {
    const std::lock_guard lock(parts_->mutex);
    newest = parts_->newest;
  }
  if (!newest->is_here || follows()) return newest;
  Snapshot away = *newest;
  away.is_here = false;
  away.why = "the gateway does not follow it any more";
  return std::make_shared<const Snapshot>(std::move(away));
}

bool DaemonFeed::follows() const {
  const std::lock_guard lock(parts_->mutex);
  return Clock::now() - parts_->newest_at < follows_within;
}

std::filesystem::path DaemonFeed::history_file() const {
  if (!parts_->settings.history.empty()) return parts_->settings.history;
  return newest()->status.history.file;
}

}  // namespace thermocomp::gateway
