/// What a request may be, before anything is done for it. Pure: header values in, verdict out.
#pragma once

#include <cstddef>
#include <optional>
#include <string>
#include <string_view>
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

}  // namespace thermocomp::gateway
