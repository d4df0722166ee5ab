#include "gateway/http/request_rules.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <utility>

#include <linux/sockios.h>
#include <sys/ioctl.h>
#include <sys/socket.h>

namespace thermocomp::gateway {
namespace {

constexpr std::size_t path_bytes_max = 256;
constexpr std::size_t query_bytes_max = 1024;
constexpr std::size_t host_bytes_max = 255;

char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

std::string lower(std::string_view text) {
  std::string made(text);
  for (char& c : made) c = lower(c);
  return made;
}

bool is_port(std::string_view text) {
  return !text.empty() && text.size() <= 5 &&
         std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

bool is_host_character(char c) {
  return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '.' || c == ':' ||
         c == '_';
}

/// Host and port of the origin; empty: not an HTTP origin.
std::string_view host_of_origin(std::string_view origin) {
  for (const std::string_view scheme : {"http://", "https://"})
    if (origin.starts_with(scheme)) return origin.substr(scheme.size());
  return {};
}

std::optional<double> finite_number(std::string_view text) {
  double value = 0.0;
  const char* end = text.data() + text.size();
  const auto [rest, code] = std::from_chars(text.data(), end, value);
  if (code != std::errc() || rest != end || !std::isfinite(value)) return std::nullopt;
  return value;
}

}  // namespace

std::optional<std::string> host_name(std::string_view host) {
  if (host.empty() || host.size() > host_bytes_max) return std::nullopt;
  std::string_view name = host;
  std::string_view rest;
  if (host.front() == '[') {
    const std::size_t end = host.find(']');
    if (end == std::string_view::npos) return std::nullopt;
    name = host.substr(1, end - 1);
    rest = host.substr(end + 1);
  } else if (const std::size_t colon = host.find(':'); colon != std::string_view::npos) {
    name = host.substr(0, colon);
    rest = host.substr(colon);
  }
  if (!rest.empty() && (rest.front() != ':' || !is_port(rest.substr(1)))) return std::nullopt;
  const std::string plain = lower(name);
  if (plain.empty() || !std::all_of(plain.begin(), plain.end(), is_host_character))
    return std::nullopt;
  return plain;
}

HostRules::HostRules(std::string address, std::vector<std::string> names)
    : allowed_(std::move(names)) {
  allowed_.push_back(std::move(address));
  for (const char* here : {"localhost", "127.0.0.1", "::1"}) allowed_.emplace_back(here);
  for (std::string& name : allowed_) name = lower(name);
}

bool HostRules::allows(std::string_view host) const {
  const std::optional<std::string> name = host_name(host);
  return name && std::find(allowed_.begin(), allowed_.end(), *name) != allowed_.end();
}

std::optional<Refusal> judge_request(const RequestFacts& request, const HostRules& hosts) {
  if (request.method != "GET" && request.method != "HEAD" && request.method != "POST")
    return Refusal{405, "the method must be GET, HEAD or POST"};
  if (request.path.size() > path_bytes_max || request.query_bytes > query_bytes_max)
    return Refusal{414, "the address is too long"};
  if (request.path.empty() || request.path.front() != '/')
    return Refusal{400, "the path must begin with /"};
  if (request.hosts_given != 1) return Refusal{400, "exactly one header Host is required"};
  // If a proxy uses another length than libmicrohttpd, the rest is parsed as another client's
  // request.
  if (request.lengths_given > 1) return Refusal{400, "the length of a body must be given once"};
  if (!hosts.allows(request.host))
    return Refusal{421, "unknown host name: add it to http.names of the configuration"};
  // In a browser, only pages of this gateway may send requests.
  if (!request.origin.empty() && lower(host_of_origin(request.origin)) != lower(request.host))
    return Refusal{403, "requested by a page of another site"};
  const bool is_elsewhere = request.fetch_site == "cross-site" || request.fetch_site == "same-site";
  // A link from another site to the page itself is allowed.
  if (is_elsewhere && (request.path != "/" || request.method == "POST"))
    return Refusal{403, "requested by a page of another site"};
  return std::nullopt;
}

std::optional<HistoryRequest> parse_history_request(std::string_view from, std::string_view to,
                                                    std::string_view points, double now_s,
                                                    std::string& why) {
  constexpr double shift_s = 8 * 3600.0;
  constexpr double latest_s = 4e9;
  HistoryRequest request{now_s - shift_s, now_s, 600};
  const auto read_time = [&](std::string_view name, std::string_view text, double& out) {
    if (text.empty()) return true;
    const std::optional<double> value = finite_number(text);
    if (value) out = *value < 0.0 ? now_s + *value : *value;
    if (value && out >= 0.0 && out <= latest_s) return true;
    why = std::string(name) + " must be seconds since 1970, or negative: before now";
    return false;
  };
  if (!read_time("from", from, request.from_s) || !read_time("to", to, request.to_s))
    return std::nullopt;
  if (!(request.to_s > request.from_s)) {
    why = "to must be later than from";
    return std::nullopt;
  }
  if (points.empty()) return request;
  constexpr double points_min = 2;
  constexpr double points_max = 5000;
  const std::optional<double> count = finite_number(points);
  if (!count || !(*count >= points_min && *count <= points_max) || std::floor(*count) != *count) {
    why = "points must be a whole number in [2, 5000]";
    return std::nullopt;
  }
  request.points = static_cast<std::size_t>(*count);
  return request;
}

namespace {

/// Unacknowledged bytes of a stream that is being read: some seconds of changes.
constexpr std::size_t under_way_bytes_max = 512;

/// Bytes sent and not yet acknowledged by the peer.
std::size_t untaken_bytes(int fd) {
  int bytes = 0;
  return ioctl(fd, SIOCOUTQ, &bytes) == 0 && bytes > 0 ? static_cast<std::size_t>(bytes) : 0;
}

}  // namespace

void SlowConnections::opened(int fd, Clock::time_point now) {
  is_at(fd, Stage::request, now);
}

void SlowConnections::is_at(int fd, Stage stage, Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  places_[fd] = {stage, now};
}

void SlowConnections::closed(int fd) {
  const std::lock_guard lock(mutex_);
  places_.erase(fd);
}

void SlowConnections::end_slow(Clock::time_point now) {
  const std::lock_guard lock(mutex_);
  const bool is_full = places_.size() >= places_max_;
  const auto request_lasts_max = is_full ? request_max_when_full : request_max;
  const auto answer_lasts_max = is_full ? answer_max_when_full : answer_max;
  for (auto& [fd, place] : places_) {
    const bool is_stream = place.stage == Stage::stream;
    if (is_stream && untaken_bytes(fd) <= under_way_bytes_max) place.since = now;
    const auto lasts = now - place.since;
    const bool is_slow = (place.stage == Stage::request && lasts > request_lasts_max) ||
                         (place.stage != Stage::request && lasts > answer_lasts_max) ||
                         (is_stream && untaken_bytes(fd) > untaken_bytes_max);
    if (is_slow) shutdown(fd, SHUT_RDWR);
  }
}

std::size_t SlowConnections::count() const {
  const std::lock_guard lock(mutex_);
  return places_.size();
}

}  // namespace thermocomp::gateway
