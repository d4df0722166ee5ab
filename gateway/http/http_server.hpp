/// The gateway's door for browsers, Prometheus and programs: page, /metrics, /api.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "gateway/door/page_files.hpp"
#include "gateway/feed/daemon_feed.hpp"
#include "gateway/settings/gateway_settings.hpp"
#include "gateway/texts/metrics_text.hpp"

namespace thermocomp::gateway {

class HttpServer {
 public:
  /// Fills in, for /metrics and the page, what other parts of the gateway know. Called on the
  /// server's thread and by show().
  using AddFigures = std::function<void(GatewayFigures&)>;

  /// @throws std::runtime_error when it cannot listen, or certificate or key cannot be used
  HttpServer(const GatewaySettings& settings, DaemonFeed& feed, const PageFiles& files,
             AddFigures add_figures);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  void show(const SnapshotPointer& snapshot);  ///< to all pages
  /// Ends connections that do not get on; called each second.
  void end_slow_connections();
  [[nodiscard]] std::uint16_t port() const noexcept;

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
