/// Runs the command of a site for each alarm that is raised or cleared: one at a time, not more
/// than so many an hour, and ended when it takes too long.
#pragma once

#include <memory>

#include "gateway/alarms/alarm_watch.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

class HookRunner {
 public:
  explicit HookRunner(const GatewaySettings& settings);
  ~HookRunner();  ///< ends a command that runs
  HookRunner(const HookRunner&) = delete;
  HookRunner& operator=(const HookRunner&) = delete;

  /// Never waits. Beyond what may wait or run in an hour it is left out, and a warning logged.
  void offer(const AlarmChange& change);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
