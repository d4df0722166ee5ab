/// Page, /metrics and /api of the gateway, for browsers, Prometheus and programs.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "gateway/feed/daemon_feed.hpp"
#include "gateway/http/page_files.hpp"
#include "gateway/settings/gateway_settings.hpp"
#include "gateway/texts/metrics_text.hpp"

namespace thermocomp::gateway {

class GatewayServer {
 public:
  /// Adds figures of other parts of the gateway for /metrics and the page. Called on the server's
  /// thread and by show().
  using AddFigures = std::function<void(GatewayFigures&)>;

  /// @throws std::runtime_error if it cannot listen, or cannot use certificate or key
  GatewayServer(const GatewaySettings& settings, DaemonFeed& feed, const PageFiles& files,
                AddFigures add_figures);
  ~GatewayServer();
  GatewayServer(const GatewayServer&) = delete;
  GatewayServer& operator=(const GatewayServer&) = delete;

  void show(const SnapshotPointer& snapshot);  ///< sends to all pages
  /// Closes connections that exceed their time; called every second.
  void end_slow_connections();
  [[nodiscard]] std::uint16_t port() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
