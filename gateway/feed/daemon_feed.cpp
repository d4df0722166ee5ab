#include "gateway/feed/daemon_feed.hpp"

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

#include "cli/common/json_fields.hpp"
#include "daemon/socket/status_client.hpp"
#include "gateway/feed/trend_watch.hpp"

namespace thermocomp::gateway {
namespace {

using Clock = std::chrono::steady_clock;
using nlohmann::json;

constexpr double period_s = 0.5;
constexpr std::chrono::milliseconds silence_max(1500);
constexpr std::chrono::seconds events_every(5);
constexpr std::size_t events_max = 200;
constexpr std::chrono::seconds again_after(1);

double wall_s() {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  return static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec);
}

double steady_s() {
  return std::chrono::duration<double>(Clock::now().time_since_epoch()).count();
}

}  // namespace

struct DaemonFeed::Parts {
  explicit Parts(const GatewaySettings& settings_in) : settings(settings_in) {}

  void run();
  void follow();
  void take_sensors(StatusClient& client, json sensors);
  void renew_slow_answers(StatusClient& client);
  void publish();
  void be_away(const std::string& why);
  /// @return false when the gateway stops
  bool sleep(std::chrono::milliseconds time);

  const GatewaySettings& settings;
  std::vector<Listener> listeners;
  std::thread thread;
  std::atomic<bool> stops{false};
  std::mutex stop_mutex;
  std::condition_variable stop_changed;

  mutable std::mutex mutex;  ///< of newest and displacement
  SnapshotPointer newest{std::make_shared<Snapshot>()};
  DisplacementMemory displacement;

  // Only of the feed's thread.
  Snapshot next;
  TrendWatch trends;
  Clock::time_point events_at{};
  nlohmann::json happened;  ///< what of the status hints at events, when they were asked for last
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

/// Until the connection ends. @throws ClientError, RemoteError
void DaemonFeed::Parts::follow() {
  StatusClient client(settings.socket, silence_max);
  const json subscription = {{"methods", {"status", "sensors"}}, {"period_s", period_s}};
  static_cast<void>(client.call("subscribe", subscription, silence_max));
  while (!stops) {
    json told = client.next(silence_max);
    const std::string method = told.value("method", std::string());
    if (method == "status") next.status = std::move(told["params"]);
    if (method == "sensors") take_sensors(client, std::move(told["params"]));
  }
}

void DaemonFeed::Parts::take_sensors(StatusClient& client, json sensors) {
  if (!next.status.is_object()) return;  // the pair is not whole yet
  next.sensors = std::move(sensors);
  renew_slow_answers(client);
  for (const json& sensor : cli::list_of(next.sensors, "sensors")) {
    const std::string name = cli::text_of(sensor, "name");
    trends.add(name, steady_s(), cli::number_of(sensor, "smoothed_degC"));
    const double rate = trends.per_hour(name);
    next.trends[name] = std::isfinite(rate) ? json(rate) : json(nullptr);
  }
  if (!next.is_here) {
    spdlog::info("the daemon answers at {}", settings.socket.string());
    next.since_s = wall_s();
  }
  next.is_here = true;
  next.why.clear();
  publish();
}

/// The model when it is another one; events when something shows that there are new ones, and every
/// few seconds: there may be a thousand of them.
void DaemonFeed::Parts::renew_slow_answers(StatusClient& client) {
  const std::string checksum = cli::text_of(cli::object_of(next.status, "model"), "checksum");
  if (!next.is_here || cli::text_of(*next.model, "checksum") != checksum) {
    next.model = std::make_shared<const json>(client.call("model", json::object(), silence_max));
    trends.forget();
    next.trends = json::object();
    events_at = {};
  }
  json shown = {cli::text_of(next.status, "mode"), cli::list_of(next.status, "reasons"),
                cli::list_of(next.status, "sensors_bad"), cli::list_of(next.status, "ended")};
  if (shown == happened && Clock::now() - events_at < events_every) return;
  happened = std::move(shown);
  events_at = Clock::now();
  json told = client.call("events", json::object(), silence_max);
  const json& all = cli::list_of(told, "events");
  const auto first = all.size() > events_max ? all.size() - events_max : 0;
  json newest_of_them = json::array();
  for (std::size_t i = first; i < all.size(); ++i) newest_of_them.push_back(all[i]);
  next.events = std::make_shared<const json>(std::move(newest_of_them));
}

void DaemonFeed::Parts::publish() {
  next.wall_s = wall_s();
  ++next.number;
  const auto made = std::make_shared<const Snapshot>(next);
  {
    const std::lock_guard lock(mutex);
    newest = made;
    if (made->is_here) displacement.add(made->wall_s, made->status);
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
  const std::lock_guard lock(parts_->mutex);
  return parts_->newest;
}

std::vector<std::pair<std::string, std::vector<double>>> DaemonFeed::displacement(
    const std::vector<double>& times_s, double span_s) const {
  const std::lock_guard lock(parts_->mutex);
  std::vector<std::pair<std::string, std::vector<double>>> columns;
  const std::vector<std::string>& axes = parts_->displacement.axes();
  for (std::size_t i = 0; i < axes.size(); ++i)
    columns.emplace_back(axes[i] + "_displacement_um",
                         parts_->displacement.over(i, times_s, span_s));
  return columns;
}

std::filesystem::path DaemonFeed::history_file() const {
  if (!parts_->settings.history.empty()) return parts_->settings.history;
  const SnapshotPointer snapshot = newest();
  return cli::text_of(cli::object_of(snapshot->status, "history"), "file");
}

}  // namespace thermocomp::gateway
