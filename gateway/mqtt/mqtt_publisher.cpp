#include "gateway/mqtt/mqtt_publisher.hpp"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <map>
#include <mosquitto.h>
#include <mutex>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <netdb.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include "config/toml/toml_reader.hpp"
#include "gateway/texts/mqtt_texts.hpp"

namespace thermocomp::gateway {
namespace {

using Clock = std::chrono::steady_clock;
using std::chrono::milliseconds;

constexpr int keepalive_s = 10;
constexpr int quality = 1;
constexpr int unacknowledged_max = 20;
constexpr double status_every_s = 30.0;
constexpr milliseconds again_after_min(1000);
constexpr milliseconds again_after_max(30000);

/// libmosquitto has no text for a keepalive timeout.
std::string text_of(int code) {
  return code == MOSQ_ERR_KEEPALIVE ? "no answer in time" : mosquitto_strerror(code);
}

void require(int code, const std::string& what) {
  if (code != MOSQ_ERR_SUCCESS) throw std::runtime_error(what + ": " + mosquitto_strerror(code));
}

const char* or_null(const std::string& text) {
  return text.empty() ? nullptr : text.c_str();
}

std::string first_line(const std::filesystem::path& file) {
  const std::string text = read_text_file(file);
  return text.substr(0, text.find_first_of("\r\n"));
}

/// @return the address families of `host`, the preferred one last; AF_UNSPEC: no address was found
std::vector<int> families_of(const std::string& host) {
  addrinfo wanted{};
  wanted.ai_socktype = SOCK_STREAM;
  addrinfo* found = nullptr;
  if (::getaddrinfo(host.c_str(), nullptr, &wanted, &found) != 0) return {AF_UNSPEC};
  std::vector<int> families;
  for (const addrinfo* at = found; at != nullptr; at = at->ai_next)
    if (std::ranges::find(families, at->ai_family) == families.end())
      families.insert(families.begin(), at->ai_family);
  ::freeaddrinfo(found);
  return families;
}

/// Of a name's addresses libmosquitto tries only the first; bound to a family, the first of that
/// family.
const char* any_address(int family) {
  if (family == AF_UNSPEC) return nullptr;
  return family == AF_INET6 ? "::" : "0.0.0.0";
}

}  // namespace

/// One thread makes all calls of libmosquitto; others only access the buffer.
struct MqttPublisher::Parts {
  explicit Parts(const GatewaySettings& settings_in);
  ~Parts();

  void set_up();
  void run();
  void send_waiting();
  void publish_offline();
  void note_short_connection();
  void retire(const std::vector<TopicState>& present, const Snapshot& snapshot);
  void sleep(milliseconds time) const;

  const GatewaySettings& settings;
  mosquitto* client{nullptr};
  std::thread thread;
  std::atomic<bool> stops{false};
  std::atomic<bool> is_connected{false};

  mutable std::mutex mutex;  ///< guards the next four
  MessageBuffer buffer;
  std::map<std::string, nlohmann::json> last_state;  ///< last state, by topic
  double published_at_s{0.0};
  double status_at_s{0.0};

  // Publisher's thread only.
  int unacknowledged{0};
  milliseconds again_after{again_after_min};
  std::string last_problem;
  Clock::time_point connected_at;
  int short_connections{0};  ///< in succession
};

MqttPublisher::Parts::Parts(const GatewaySettings& settings_in)
    : settings(settings_in), buffer(settings_in.mqtt.buffer_messages) {
  mosquitto_lib_init();
  client = mosquitto_new(settings.mqtt.client_id.c_str(), true, this);
  if (client == nullptr) throw std::runtime_error("mqtt: no memory");
  try {
    set_up();
  } catch (...) {
    mosquitto_destroy(client);
    mosquitto_lib_cleanup();
    throw;
  }
}

MqttPublisher::Parts::~Parts() {
  stops = true;
  if (thread.joinable()) thread.join();
  mosquitto_destroy(client);
  mosquitto_lib_cleanup();
}

void MqttPublisher::Parts::set_up() {
  const MqttSettings& mqtt = settings.mqtt;
  if (!mqtt.user.empty()) {
    const std::string password = mqtt.password_file.empty() ? "" : first_line(mqtt.password_file);
    require(mosquitto_username_pw_set(client, mqtt.user.c_str(), or_null(password)), "mqtt.user");
  }
  if (!mqtt.authority.empty()) {
    const std::string certificate = mqtt.certificate.string();
    const std::string key = mqtt.key.string();
    require(mosquitto_tls_set(client, mqtt.authority.c_str(), nullptr, or_null(certificate),
                              or_null(key), nullptr),
            "mqtt.authority");
  }
  const std::string will = offline_payload();
  require(mosquitto_will_set(client, topic_of(settings.machine, "status").c_str(),
                             static_cast<int>(will.size()), will.data(), quality, true),
          "mqtt: last will");
  mosquitto_connect_callback_set(client, [](mosquitto*, void* self, int code) {
    Parts& parts = *static_cast<Parts*>(self);
    if (code != 0) {
      parts.last_problem = mosquitto_connack_string(code);
      return;
    }
    spdlog::info("mqtt: connected to {}", parts.settings.mqtt.host);
    parts.again_after = again_after_min;
    parts.is_connected = true;
    parts.connected_at = Clock::now();
    const std::lock_guard lock(parts.mutex);
    parts.buffer.repeat_newest();
  });
  mosquitto_publish_callback_set(
      client, [](mosquitto*, void* self, int) { --static_cast<Parts*>(self)->unacknowledged; });
}

void MqttPublisher::Parts::sleep(milliseconds time) const {
  constexpr milliseconds step(50);
  const auto end = Clock::now() + time;
  while (!stops && Clock::now() < end) std::this_thread::sleep_for(step);
}

void MqttPublisher::Parts::run() {
  constexpr int wait_ms = 100;
  std::vector<int> untried;
  // Connecting waits in mosquitto_loop(), with its timeout; these calls wait only for the name
  // server.
  const auto connect = [&] {
    if (untried.empty()) untried = families_of(settings.mqtt.host);
    return mosquitto_connect_bind_async(client, settings.mqtt.host.c_str(), settings.mqtt.port,
                                        keepalive_s, any_address(untried.back()));
  };
  int code = connect();
  while (!stops) {
    if (code == MOSQ_ERR_SUCCESS) code = mosquitto_loop(client, wait_ms, 1);
    if (code == MOSQ_ERR_SUCCESS) {
      if (is_connected) send_waiting();
      continue;
    }
    const std::string problem =
        last_problem.empty() ? text_of(code) : std::exchange(last_problem, "");
    const bool was_connected = is_connected.exchange(false);
    if (!was_connected) untried.pop_back();
    if (!was_connected && !untried.empty()) {
      code = connect();
      continue;
    }
    if (was_connected || again_after == again_after_min)
      spdlog::warn("mqtt: {} port {}: {}", settings.mqtt.host, settings.mqtt.port, problem);
    if (was_connected) note_short_connection();
    sleep(again_after);
    again_after = std::min(2 * again_after, again_after_max);
    if (!stops) code = connect();
  }
  if (is_connected) publish_offline();
}

/// A broker closes a connection when another one with its client_id begins.
void MqttPublisher::Parts::note_short_connection() {
  constexpr std::chrono::seconds short_max(10);
  constexpr int count_max = 3;
  short_connections = Clock::now() - connected_at < short_max ? short_connections + 1 : 0;
  if (short_connections == count_max)
    spdlog::warn(
        "mqtt: closed within {} s of connecting, {} times: does another program use "
        "client_id = \"{}\"?",
        short_max.count(), count_max, settings.mqtt.client_id);
}

/// Keeps at most `unacknowledged_max` messages in libmosquitto, which resends them after a lost
/// connection.
void MqttPublisher::Parts::send_waiting() {
  while (unacknowledged < unacknowledged_max) {
    std::unique_lock lock(mutex);
    const std::optional<Message> message = buffer.take();
    lock.unlock();
    if (!message) return;
    const int code = mosquitto_publish(client, nullptr, message->topic.c_str(),
                                       static_cast<int>(message->payload.size()),
                                       message->payload.data(), quality, true);
    if (code == MOSQ_ERR_SUCCESS || code == MOSQ_ERR_NO_CONN) ++unacknowledged;
    if (code != MOSQ_ERR_SUCCESS) return;
  }
}

void MqttPublisher::Parts::publish_offline() {
  const std::string offline = offline_payload();
  const std::string topic = topic_of(settings.machine, "status");
  ++unacknowledged;
  mosquitto_publish(client, nullptr, topic.c_str(), static_cast<int>(offline.size()),
                    offline.data(), quality, true);
  constexpr int wait_ms = 50;
  const auto end = Clock::now() + std::chrono::seconds(1);
  while (unacknowledged > 0 && Clock::now() < end)
    if (mosquitto_loop(client, wait_ms, 1) != MOSQ_ERR_SUCCESS) return;
  mosquitto_disconnect(client);
  mosquitto_loop(client, wait_ms, 1);
}

MqttPublisher::MqttPublisher(const GatewaySettings& settings)
    : parts_(std::make_unique<Parts>(settings)) {
  parts_->thread = std::thread([this] { parts_->run(); });
}
MqttPublisher::~MqttPublisher() = default;

/// A broker keeps the newest message of each topic: sensors and axes become unknown while the
/// daemon is away, and the topic of a removed one is cleared.
void MqttPublisher::Parts::retire(const std::vector<TopicState>& present,
                                  const Snapshot& snapshot) {
  static const nlohmann::json unknown = {{"known", false}};
  const auto is_present = [&](const std::string& topic) {
    return std::any_of(present.begin(), present.end(),
                       [&](const TopicState& each) { return each.topic == topic; });
  };
  for (auto last = last_state.begin(); last != last_state.end();) {
    auto& [topic, state] = *last;
    const bool is_gone = snapshot.is_here && !is_present(topic);
    if (is_gone) {
      buffer.push({topic, ""});  // clears it at the broker
    } else if (!is_present(topic) && state != unknown) {
      buffer.push({topic, payload_of(unknown, snapshot.wall_s)});
      state = unknown;
    }
    last = is_gone ? last_state.erase(last) : std::next(last);
  }
}

void MqttPublisher::show(const SnapshotPointer& snapshot) {
  std::vector<TopicState> states = topic_states(*snapshot, parts_->settings.machine);
  const std::lock_guard lock(parts_->mutex);
  parts_->retire(states, *snapshot);
  constexpr double early_s = 0.1;  // tolerance of the snapshots' period
  const double passed_s = snapshot->wall_s - parts_->published_at_s;
  const bool is_due = !(passed_s >= 0.0 && passed_s < parts_->settings.mqtt.period_s - early_s);
  if (is_due) parts_->published_at_s = snapshot->wall_s;
  for (std::size_t i = 0; i < states.size(); ++i) {
    // The status (first) is sent at once, the others once per period.
    if (i > 0 && !is_due) return;
    nlohmann::json& last_state = parts_->last_state[states[i].topic];
    // A broker may keep the newest status for any time, so its time must show its age.
    const double status_age_s = snapshot->wall_s - parts_->status_at_s;
    const bool repeats = i == 0 && parts_->is_connected &&
                         !(status_age_s >= 0.0 && status_age_s < status_every_s - early_s);
    if (last_state == states[i].state && !repeats) continue;
    if (i == 0) parts_->status_at_s = snapshot->wall_s;
    parts_->buffer.push({states[i].topic, payload_of(states[i].state, snapshot->wall_s)});
    last_state = std::move(states[i].state);
  }
}

void MqttPublisher::show_alarms(const std::vector<Alarm>& active, const AlarmChange* changed,
                                double wall_s) {
  const std::lock_guard lock(parts_->mutex);
  parts_->buffer.push({topic_of(parts_->settings.machine, "alarm"),
                       payload_of(alarm_state(active, changed), wall_s)});
}

void MqttPublisher::add_figures(GatewayFigures& figures) const {
  figures.mqtt_enabled = true;
  figures.mqtt_connected = parts_->is_connected;
  const std::lock_guard lock(parts_->mutex);
  figures.mqtt_dropped = parts_->buffer.dropped();
}

}  // namespace thermocomp::gateway
