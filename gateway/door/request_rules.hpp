/// What a request may be, before anything is done for it, and how long it may take.
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
  std::string_view host;         ///< header Host; empty: none
  std::string_view origin;       ///< header Origin; empty: none
  std::string_view fetch_site;   ///< header Sec-Fetch-Site; empty: none
  std::size_t query_bytes{0};    ///< names and values together
  std::size_t hosts_given{0};    ///< how many headers Host there are
  std::size_t lengths_given{0};  ///< headers Content-Length and Transfer-Encoding together
};

struct Refusal {
  unsigned status{400};
  std::string text;
};

/// Which hosts a page of this gateway is reached by. A name that is not one of them is refused: a
/// page from elsewhere could otherwise have its own name resolved to this computer and read all.
class HostRules {
 public:
  /// @param names  besides `address`, localhost and the loopback addresses, any port
  HostRules(std::string address, std::vector<std::string> names);
  [[nodiscard]] bool allows(std::string_view host) const;

 private:
  std::vector<std::string> allowed_;
};

/// Host without its port and without the brackets of IPv6; none: it is malformed.
[[nodiscard]] std::optional<std::string> host_name(std::string_view host);

/// @return why the request is refused, if it is
[[nodiscard]] std::optional<Refusal> judge_request(const RequestFacts& request,
                                                   const HostRules& hosts);

struct HistoryRequest {
  double from_s{0.0};
  double to_s{0.0};
  std::size_t points{600};
};
/// `from` and `to` in seconds since 1970, or negative: seconds before now. Left out: the last eight
/// hours. `points` 2..5000.
/// @param from, to, points  as given; empty: left out
/// @param why  set when there is no result: one line
[[nodiscard]] std::optional<HistoryRequest> parse_history_request(std::string_view from,
                                                                  std::string_view to,
                                                                  std::string_view points,
                                                                  double now_s, std::string& why);

/// Connections that do not get on. libmicrohttpd ends one that is silent; who sends or takes a byte
/// now and then would keep a place for ever.
class SlowConnections {
 public:
  using Clock = std::chrono::steady_clock;
  static constexpr std::chrono::seconds request_max{15};  ///< until a request is whole
  static constexpr std::chrono::seconds answer_max{60};   ///< until its answer is taken
  /// The same while every place is taken: others wait for one.
  static constexpr std::chrono::seconds request_max_when_full{3};
  static constexpr std::chrono::seconds answer_max_when_full{10};
  /// Of a stream: what lies in the kernel because nobody takes it. Less, but more than what may be
  /// under way, has the time of an answer.
  static constexpr std::size_t untaken_bytes_max = std::size_t{64} * 1024;

  enum class Stage { request, answer, stream };

  explicit SlowConnections(std::size_t places) : places_max_(places) {}

  void opened(int fd, Clock::time_point now);
  void is_at(int fd, Stage stage, Clock::time_point now);
  void closed(int fd);
  /// Shuts down those that are over their time; the library then finds them closed.
  void end_slow(Clock::time_point now);
  [[nodiscard]] std::size_t count() const;

 private:
  struct Place {
    Stage stage{Stage::request};
    Clock::time_point since;
  };
  const std::size_t places_max_;
  mutable std::mutex mutex_;
  std::unordered_map<int, Place> places_;  ///< by socket
};

}  // namespace thermocomp::gateway
