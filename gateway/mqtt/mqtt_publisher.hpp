/// Publishes on an MQTT broker, from a thread of its own; waits for a broker that is away.
#pragma once

#include <memory>

#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/feed/snapshot.hpp"
#include "gateway/settings/gateway_settings.hpp"
#include "gateway/texts/metrics_text.hpp"

namespace thermocomp::gateway {

/// Everything is retained and of quality 1. A topic is published when its state has changed, at
/// most every `period_s`; with a connection, what waited in the buffer and then the last of every
/// topic. The last will, `{"state": "offline"}` on `.../status`, ends a state that nobody renews.
class MqttPublisher {
 public:
  /// @throws std::runtime_error when certificates or the password file cannot be used
  explicit MqttPublisher(const GatewaySettings& settings);
  ~MqttPublisher();  ///< says offline, where the broker is there
  MqttPublisher(const MqttPublisher&) = delete;
  MqttPublisher& operator=(const MqttPublisher&) = delete;

  /// None of these waits.
  void show(const SnapshotPointer& snapshot);
  void show_alarms(const std::vector<Alarm>& active, const AlarmChange* changed, double wall_s);
  void add_figures(GatewayFigures& figures) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
