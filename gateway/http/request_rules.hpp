/// Checks of a request before it is handled, and time limits of connections.
#pragma once

#include <chrono>
#include <cstddef>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <unordered_map>
#include <vector>

namespace thermocomp::gateway {

struct RequestFacts {
  std::string_view method;
  std::string_view path;         ///< without the query, percent-decoded
  std::string_view host;         ///< header Host; empty: absent
  std::string_view origin;       ///< header Origin; empty: absent
  std::string_view fetch_site;   ///< header Sec-Fetch-Site; empty: absent
  std::size_t query_bytes{0};    ///< total of names and values
  std::size_t hosts_given{0};    ///< number of Host headers
  std::size_t lengths_given{0};  ///< number of Content-Length and Transfer-Encoding headers
};

struct Refusal {
  unsigned status{400};
  std::string text;
};

/// Host names of this gateway. Others are refused: a page from elsewhere could otherwise resolve
/// its own name to this computer and read everything (DNS rebinding).
class HostRules {
 public:
  /// @param names  allowed besides `address`, localhost and the loopback addresses; any port
  HostRules(std::string address, std::vector<std::string> names);
  [[nodiscard]] bool allows(std::string_view host) const;

 private:
  std::vector<std::string> allowed_;
};

/// Host without port and IPv6 brackets; nullopt: malformed.
[[nodiscard]] std::optional<std::string> host_name(std::string_view host);

/// @return reason for refusing the request; nullopt: accepted
[[nodiscard]] std::optional<Refusal> judge_request(const RequestFacts& request,
                                                   const HostRules& hosts);

struct HistoryRequest {
  double from_s{0.0};
  double to_s{0.0};
  std::size_t points{600};
};
/// @param from, to  seconds since 1970, or negative: before now; empty: the last 8 h
/// @param points  2..5000; empty: 600
/// @param why  reason in one line if there is no result
[[nodiscard]] std::optional<HistoryRequest> parse_history_request(std::string_view from,
                                                                  std::string_view to,
                                                                  std::string_view points,
                                                                  double now_s, std::string& why);

/// Closes slow connections. libmicrohttpd closes a silent one; a peer that sends or takes a byte
/// now and then would otherwise keep its place for ever.
class SlowConnections {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds request_max{15};  ///< for a whole request
  static constexpr std::chrono::seconds answer_max{60};   ///< for the peer to take the answer
  /// The same while all places are taken.
  static constexpr std::chrono::seconds request_max_when_full{3};
  static constexpr std::chrono::seconds answer_max_when_full{10};
  /// Bytes of a stream that the peer has not taken. Above this limit it is closed at once; between
  /// the usual amount in transit and this limit, after the time of an answer.
  static constexpr std::size_t untaken_bytes_max = std::size_t{64} * 1024;

  enum class Stage { request, answer, stream };

  explicit SlowConnections(std::size_t places) : places_max_(places) {}

  void opened(int fd, Clock::time_point now);
  void is_at(int fd, Stage stage, Clock::time_point now);
  void closed(int fd);
  /// Shuts their sockets down; libmicrohttpd then closes the connections.
  void end_slow(Clock::time_point now);
  [[nodiscard]] std::size_t count() const;

 private:
  struct Place {
    Stage stage{Stage::request};
    Clock::time_point since;
  };
  const std::size_t places_max_;
  mutable std::mutex mutex_;
  std::unordered_map<int, Place> places_;  ///< by file descriptor
};

}  // namespace thermocomp::gateway
