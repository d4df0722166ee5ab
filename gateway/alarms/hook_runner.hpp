/// Runs the site's command for each raised or cleared alarm: one at a time, with limits on its
/// duration and on commands per hour.
#pragma once

#include <memory>

#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

class HookRunner {
 public:
  explicit HookRunner(const GatewaySettings& settings);
  ~HookRunner();  ///< kills a running command
  HookRunner(const HookRunner&) = delete;
  HookRunner& operator=(const HookRunner&) = delete;

  /// Never blocks. Beyond the queue or hourly limit the command is dropped with a warning.
  void offer(const AlarmChange& change);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
