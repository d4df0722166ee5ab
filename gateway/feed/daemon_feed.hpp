/// Follows the daemon over its status socket, on a thread of its own, and finds it again.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>

#include "gateway/feed/snapshot.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

/// Twice a second status and sensors, events when there are new ones; within 1.5 s of silence the
/// daemon counts as away. While it is away there is a snapshot every second that says so.
class DaemonFeed {
 public:
  using Listener = std::function<void(const SnapshotPointer&)>;

  explicit DaemonFeed(const GatewaySettings& settings);
  ~DaemonFeed();  ///< stops
  DaemonFeed(const DaemonFeed&) = delete;
  DaemonFeed& operator=(const DaemonFeed&) = delete;

  /// Called on the feed's thread with each new snapshot; must not throw or wait. Before start().
  void listen(Listener listener);
  void start();
  void stop() noexcept;

  [[nodiscard]] SnapshotPointer newest() const;
  /// The history file: the one that is configured, or that the daemon names; empty: not known.
  [[nodiscard]] std::filesystem::path history_file() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
