/// Publishes to an MQTT broker on its own thread; reconnects if the broker is away.
#pragma once

#include <memory>

#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/feed/snapshot.hpp"
#include "gateway/settings/gateway_settings.hpp"
#include "gateway/texts/metrics_text.hpp"

namespace thermocomp::gateway {

/// All messages are retained, QoS 1. A topic is published when its state changes, at most every
/// `period_s`; after connecting, the buffered messages and then the last state of each topic. The
/// last will, `{"state": "offline"}` on `.../status`, marks retained states as stale.
class MqttPublisher {
 public:
  /// @throws std::runtime_error if certificates or the password file cannot be used
  explicit MqttPublisher(const GatewaySettings& settings);
  ~MqttPublisher();  ///< publishes offline if connected
  MqttPublisher(const MqttPublisher&) = delete;
  MqttPublisher& operator=(const MqttPublisher&) = delete;

  /// These functions do not block.
  void show(const SnapshotPointer& snapshot);
  void show_alarms(const std::vector<Alarm>& active, const AlarmChange* changed, double wall_s);
  void add_figures(GatewayFigures& figures) const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
