/// HTTP server with TLS, passwords, request limits and static files; used by gateway and fleet
/// page.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "gateway/http/answer_thread.hpp"
#include "gateway/http/event_streams.hpp"
#include "gateway/http/page_files.hpp"
#include "gateway/settings/gateway_settings.hpp"

namespace thermocomp::gateway {

inline constexpr const char* json_type = "application/json";

/// An accepted request. Its handler calls answer(), later() or stream() once; otherwise the
/// connection is closed.
class HttpExchange {
 public:
  virtual ~HttpExchange() = default;
  [[nodiscard]] virtual std::string_view path() const = 0;
  [[nodiscard]] virtual bool is_post() const = 0;
  [[nodiscard]] virtual std::string_view header(const char* name) const = 0;  ///< empty: absent
  [[nodiscard]] virtual std::string_view argument(const char* name) const = 0;
  [[nodiscard]] virtual const std::string& user() const = 0;  ///< empty: no password file
  [[nodiscard]] virtual const std::string& body() const = 0;
  virtual void answer(unsigned status, const char* type, std::string text) = 0;
  /// Answers with the JSON that `work` makes on the thread, which suspends the 10 s timeout.
  virtual void later(AnswerThread& answers, AnswerThread::Work work) = 0;
  virtual void stream(EventStreams& streams) = 0;
};

/// One thread of libmicrohttpd serves all connections. Limits: `connections_max` connections, 16 kB
/// of headers, 4 kB of body, 10 s without a byte, 15 s for a whole request.
class HttpServer {
 public:
  /// Handles every path except the page's files; called on the server's thread.
  using Handler = std::function<void(HttpExchange&)>;

  /// @throws std::runtime_error if it cannot listen, or cannot use certificate or key
  HttpServer(const HttpSettings& settings, const PageFiles& files, Handler handler);
  ~HttpServer();
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  /// Closes connections that exceed their time; called every second.
  void end_slow_connections();
  [[nodiscard]] std::uint16_t port() const noexcept;
  [[nodiscard]] std::uint64_t requests() const noexcept;
  [[nodiscard]] std::atomic<std::uint64_t>& refused() noexcept;

 private:
  class Exchange;
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace thermocomp::gateway
