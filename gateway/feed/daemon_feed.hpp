/// Follows the daemon over its status socket on its own thread, and reconnects.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>

#include "gateway/feed/snapshot.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

/// Receives status and sensors twice a second, and events when there are new ones. After 1.5 s of
/// silence the daemon counts as away, with a snapshot every second.
class DaemonFeed {
 public:
  using Listener = std::function<void(const SnapshotPointer&)>;

  explicit DaemonFeed(const GatewaySettings& settings);
  ~DaemonFeed();
  DaemonFeed(const DaemonFeed&) = delete;
  DaemonFeed& operator=(const DaemonFeed&) = delete;

  /// Called on the feed's thread with each snapshot; must not throw or block. Add before start().
  void listen(Listener listener);
  void start();
  void stop() noexcept;

  /// The daemon counts as away if there was no snapshot for follows_within.
  [[nodiscard]] SnapshotPointer newest() const;
  /// False if the feed's thread hangs.
  [[nodiscard]] bool follows() const;
  static constexpr std::chrono::seconds follows_within{10};
  /// History file from the configuration, else from the daemon; empty: unknown.
  [[nodiscard]] std::filesystem::path history_file() const;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
