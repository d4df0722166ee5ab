#include "daemon/socket/status_server.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <map>
#include <optional>
#include <unistd.h>
#include <utility>
#include <vector>

#include <nlohmann/json.hpp>
#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/timerfd.h>

#include "daemon/socket/listening_socket.hpp"
#include "daemon/socket/peer_access.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

constexpr double period_s_min = 0.1;
constexpr double period_s_max = 60.0;
constexpr std::size_t subscribed_methods_max = 16;

struct Subscription {
  std::vector<std::string> methods;
  Clock::duration period{};
  Clock::time_point due{};
};

struct Client {
  int fd{-1};
  PeerAccess access;
  std::string input;
  std::string output;
  std::size_t sent{0};      ///< bytes at the front of `output` that are gone already
  bool input_ended{false};  ///< the peer sends no more; answers may still be owed
  bool close_when_sent{false};
  bool broken{false};          ///< to be closed at the end of the round
  bool waits_for_room{false};  ///< epoll tells when it can be written to
  std::optional<Subscription> subscription;
};

struct Method {
  AccessClass access{AccessClass::read};
  RpcHandler handler;
};

/// NaN becomes null; bytes that are no UTF-8 (a device's answer in an error text) are replaced.
std::string to_line(const json& message) {
  return message.dump(-1, ' ', false, json::error_handler_t::replace) + "\n";
}

json error_message(const json& id, int code, const std::string& text) {
  return {{"jsonrpc", "2.0"}, {"id", id}, {"error", {{"code", code}, {"message", text}}}};
}

bool is_allowed(const PeerAccess& access, AccessClass needed) {
  switch (needed) {
    case AccessClass::read:
      return access.read;
    case AccessClass::operate:
      return access.operate;
    case AccessClass::bridge:
      return access.bridge;
  }
  return false;
}

/// A request that has the shape of one.
struct Request {
  json id;  ///< null where there is none
  bool is_notification{false};
  std::string method;
  json params = json::object();
};

/// @throws RpcError; `out.id` is set as soon as it is known
void parse_request(const std::string& line, Request& out) {
  const json message = json::parse(line, nullptr, false);
  if (message.is_discarded()) throw RpcError(rpc::parse_error, "this line is no JSON");
  if (message.is_array()) {
    throw RpcError(rpc::invalid_request, "batches are not supported: send one object a line");
  }
  if (!message.is_object()) throw RpcError(rpc::invalid_request, "a request must be an object");
  const auto id = message.find("id");
  out.is_notification = id == message.end();
  if (!out.is_notification) {
    if (!id->is_string() && !id->is_number() && !id->is_null()) {
      throw RpcError(rpc::invalid_request, "id must be a string, a number or null");
    }
    out.id = *id;
  }
  const auto version = message.find("jsonrpc");
  if (version == message.end() || *version != "2.0") {
    throw RpcError(rpc::invalid_request, "jsonrpc must be \"2.0\"");
  }
  const auto method = message.find("method");
  if (method == message.end() || !method->is_string()) {
    throw RpcError(rpc::invalid_request, "method must be a string");
  }
  out.method = method->get<std::string>();
  const auto params = message.find("params");
  if (params == message.end()) return;
  if (!params->is_object()) throw RpcError(rpc::invalid_params, "params must be an object");
  out.params = *params;
}

}  // namespace

struct StatusServer::Parts {
  SocketConfig config;
  ListeningSocket listener;
  int epoll_fd{-1};
  int timer_fd{-1};
  std::map<int, Client> clients;
  std::map<std::string, Method, std::less<>> methods;
  SocketStatistics statistics;

  explicit Parts(const SocketConfig& config_in) : config(config_in), listener(config_in.path) {
    epoll_fd = epoll_create1(EPOLL_CLOEXEC);
    timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
    if (epoll_fd < 0 || timer_fd < 0 || !watch(listener.fd(), EPOLLIN, EPOLL_CTL_ADD) ||
        !watch(timer_fd, EPOLLIN, EPOLL_CTL_ADD)) {
      close_own();
      throw SocketError("status socket: epoll is not available");
    }
  }
  ~Parts() {
    for (const auto& [fd, client] : clients) close(fd);
    close_own();
  }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  void close_own() const noexcept {
    if (epoll_fd >= 0) close(epoll_fd);
    if (timer_fd >= 0) close(timer_fd);
  }
  [[nodiscard]] bool watch(int fd, std::uint32_t events, int operation) const noexcept {
    epoll_event event{};
    event.events = events;
    event.data.fd = fd;
    return epoll_ctl(epoll_fd, operation, fd, &event) == 0;
  }

  void accept_all();
  void refuse(int fd);
  void on_client(Client& client, std::uint32_t events);
  void read_some(Client& client);
  void take_lines(Client& client);
  void answer(Client& client, const std::string& line);
  [[nodiscard]] json call(Client& client, const Request& request);
  [[nodiscard]] json subscribe(Client& client, const json& params);
  void send(Client& client, const std::string& text);
  void flush(Client& client);
  void rewatch(Client& client);
  void notify_due();
  void set_timer();
  void close_broken();
};

void StatusServer::Parts::accept_all() {
  for (int fd = listener.accept_one(); fd >= 0; fd = listener.accept_one()) {
    const std::optional<Peer> peer = peer_of(fd);
    if (clients.size() >= clients_max || !peer || !watch(fd, EPOLLIN, EPOLL_CTL_ADD)) {
      refuse(fd);
      continue;
    }
    Client client;
    client.fd = fd;
    client.access = access_of(*peer, geteuid(), config);
    clients.emplace(fd, std::move(client));
    ++statistics.accepted;
  }
}

void StatusServer::Parts::refuse(int fd) {
  const std::string line = to_line(error_message(
      nullptr, rpc::refused,
      "the daemon has " + std::to_string(clients_max) + " clients already; try again later"));
  // A fresh socket's buffer always has room for a line; if not, closing says enough.
  static_cast<void>(::send(fd, line.data(), line.size(), MSG_NOSIGNAL));
  close(fd);
  ++statistics.refused;
}

void StatusServer::Parts::on_client(Client& client, std::uint32_t events) {
  if ((events & EPOLLIN) != 0) read_some(client);
  if ((events & EPOLLOUT) != 0) flush(client);
  if ((events & EPOLLERR) != 0 || ((events & EPOLLHUP) != 0 && (events & EPOLLIN) == 0)) {
    client.broken = true;
  }
}

/// One read a round, so that a client that never stops sending does not keep the others waiting.
void StatusServer::Parts::read_some(Client& client) {
  std::array<char, std::size_t{16} * 1024> bytes{};
  const ssize_t count = recv(client.fd, bytes.data(), bytes.size(), 0);
  if (count > 0) {
    client.input.append(bytes.data(), static_cast<std::size_t>(count));
    take_lines(client);
  } else if (count == 0) {
    client.input_ended = true;
    if (client.output.empty() && !client.subscription) client.broken = true;
    rewatch(client);
  } else if (errno != EAGAIN && errno != EINTR) {
    client.broken = true;
  }
}

void StatusServer::Parts::take_lines(Client& client) {
  std::size_t begin = 0;
  while (!client.broken && !client.close_when_sent) {
    const std::size_t end = client.input.find('\n', begin);
    const std::size_t length = (end == std::string::npos ? client.input.size() : end) - begin;
    if (length > line_bytes_max) {
      ++statistics.dropped;
      ++statistics.errors;
      client.close_when_sent = true;
      send(client, to_line(error_message(
                       nullptr, rpc::invalid_request,
                       "a line has at most " + std::to_string(line_bytes_max) + " bytes")));
      break;
    }
    if (end == std::string::npos) break;
    std::string line = client.input.substr(begin, length);
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (!line.empty()) answer(client, line);
    begin = end + 1;
  }
  client.input.erase(0, begin);
}

void StatusServer::Parts::answer(Client& client, const std::string& line) {
  ++statistics.requests;
  Request request;
  json reply;
  bool is_parsed = false;
  try {
    parse_request(line, request);
    is_parsed = true;
    reply = {{"jsonrpc", "2.0"}, {"id", request.id}, {"result", call(client, request)}};
  } catch (const RpcError& error) {
    reply = error_message(request.id, error.code(), error.what());
  } catch (const json::exception& error) {
    reply = error_message(request.id, rpc::invalid_params, error.what());
  } catch (const std::exception& error) {
    reply = error_message(request.id, rpc::internal_error, error.what());
  }
  if (reply.contains("error")) ++statistics.errors;
  if (is_parsed && request.is_notification) return;  // as the protocol wants it
  send(client, to_line(reply));
}

json StatusServer::Parts::call(Client& client, const Request& request) {
  if (request.method == "subscribe") return subscribe(client, request.params);
  const auto method = methods.find(request.method);
  if (method == methods.end()) {
    throw RpcError(rpc::method_not_found, "there is no method of this name");
  }
  if (!is_allowed(client.access, method->second.access)) {
    const AccessClass needed = method->second.access;
    const std::string who = needed == AccessClass::read      ? "members of " + config.read_group
                            : needed == AccessClass::operate ? "members of " + config.operator_group
                                                             : "members of " + config.bridge_group;
    throw RpcError(rpc::not_permitted, request.method + ": only for root and " + who);
  }
  return method->second.handler(request.params);
}

json StatusServer::Parts::subscribe(Client& client, const json& params) {
  if (!client.access.read) {
    throw RpcError(rpc::not_permitted,
                   "subscribe: only for root and members of " + config.read_group);
  }
  for (const auto& [key, value] : params.items()) {
    if (key != "methods" && key != "period_s") {
      throw RpcError(rpc::invalid_params, "subscribe takes methods and period_s");
    }
  }
  const json period = params.value("period_s", json(1.0));
  const double period_s = period.is_number() ? period.get<double>() : not_a_number;
  if (!(period_s >= period_s_min && period_s <= period_s_max)) {
    throw RpcError(rpc::invalid_params, "period_s must be a number in [0.1, 60]");
  }
  const json names = params.value("methods", json::array({"status"}));
  if (!names.is_array() || names.empty() || names.size() > subscribed_methods_max) {
    throw RpcError(rpc::invalid_params, "methods must be a list of 1 to 16 names");
  }
  Subscription subscription;
  for (const json& name : names) {
    const auto method = name.is_string() ? methods.find(name.get<std::string>()) : methods.end();
    if (method == methods.end() || method->second.access != AccessClass::read) {
      throw RpcError(rpc::invalid_params, "methods may name reading methods only");
    }
    subscription.methods.push_back(method->first);
  }
  subscription.period =
      std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(period_s));
  subscription.due = Clock::now();
  json result = {{"methods", subscription.methods}, {"period_s", period_s}};
  client.subscription = std::move(subscription);
  set_timer();
  return result;
}

void StatusServer::Parts::send(Client& client, const std::string& text) {
  if (client.broken) return;
  if (client.output.size() - client.sent + text.size() > output_bytes_max) {
    ++statistics.dropped;
    client.broken = true;
    return;
  }
  client.output += text;
  flush(client);
}

void StatusServer::Parts::flush(Client& client) {
  while (client.sent < client.output.size()) {
    const ssize_t count = ::send(client.fd, client.output.data() + client.sent,
                                 client.output.size() - client.sent, MSG_NOSIGNAL);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) client.broken = true;
    if (count < 0) break;
    client.sent += static_cast<std::size_t>(count);
  }
  if (client.sent == client.output.size()) {
    client.output.clear();
    client.sent = 0;
    if (client.close_when_sent || (client.input_ended && !client.subscription)) {
      client.broken = true;
    }
  } else if (client.sent > output_bytes_max / 4) {
    client.output.erase(0, client.sent);
    client.sent = 0;
  }
  rewatch(client);
}

void StatusServer::Parts::rewatch(Client& client) {
  client.waits_for_room = !client.output.empty();
  const bool reads = !client.input_ended && !client.close_when_sent;
  const std::uint32_t events = (reads ? std::uint32_t{EPOLLIN} : 0u) |
                               (client.waits_for_room ? std::uint32_t{EPOLLOUT} : 0u);
  if (!watch(client.fd, events, EPOLL_CTL_MOD)) client.broken = true;
}

void StatusServer::Parts::notify_due() {
  const Clock::time_point now = Clock::now();
  std::map<std::string, std::string> lines;  // each method is asked once, however many subscribed
  for (auto& [fd, client] : clients) {
    if (!client.subscription || client.broken || client.subscription->due > now) continue;
    for (const std::string& name : client.subscription->methods) {
      auto line = lines.find(name);
      if (line == lines.end()) {
        json message = {{"jsonrpc", "2.0"}, {"method", name}};
        try {
          message["params"] = methods.at(name).handler(json::object());
        } catch (const std::exception& error) {
          message["params"] = {{"error", error.what()}};
        }
        line = lines.emplace(name, to_line(message)).first;
      }
      send(client, line->second);
    }
    Subscription& subscription = *client.subscription;
    subscription.due += subscription.period;
    if (subscription.due <= now) subscription.due = now + subscription.period;
  }
}

void StatusServer::Parts::set_timer() {
  std::optional<Clock::time_point> next;
  for (const auto& [fd, client] : clients) {
    if (!client.subscription) continue;
    next = next ? std::min(*next, client.subscription->due) : client.subscription->due;
  }
  itimerspec when{};
  if (next) {
    const auto wait = std::max<std::int64_t>(
        1, std::chrono::duration_cast<std::chrono::nanoseconds>(*next - Clock::now()).count());
    when.it_value.tv_sec = wait / 1'000'000'000;
    when.it_value.tv_nsec = wait % 1'000'000'000;
  }
  timerfd_settime(timer_fd, 0, &when, nullptr);
}

void StatusServer::Parts::close_broken() {
  for (auto client = clients.begin(); client != clients.end();) {
    if (client->second.broken) {
      close(client->first);
      client = clients.erase(client);
    } else {
      ++client;
    }
  }
  statistics.clients = clients.size();
}

StatusServer::StatusServer(const SocketConfig& config) : parts_(std::make_unique<Parts>(config)) {}
StatusServer::~StatusServer() = default;

void StatusServer::add_method(const std::string& name, AccessClass access, RpcHandler handler) {
  parts_->methods[name] = {access, std::move(handler)};
}

int StatusServer::fd() const noexcept {
  return parts_->epoll_fd;
}

void StatusServer::handle(std::chrono::milliseconds timeout) {
  std::array<epoll_event, 32> events{};
  const int count = epoll_wait(parts_->epoll_fd, events.data(), static_cast<int>(events.size()),
                               static_cast<int>(timeout.count()));
  bool is_timer = false;
  bool is_listener = false;
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    if (event.data.fd == parts_->timer_fd) {
      std::uint64_t expirations = 0;
      is_timer = read(parts_->timer_fd, &expirations, sizeof expirations) > 0;
    } else if (event.data.fd == parts_->listener.fd()) {
      is_listener = true;
    } else if (const auto client = parts_->clients.find(event.data.fd);
               client != parts_->clients.end()) {
      parts_->on_client(client->second, event.events);
    }
  }
  if (is_timer) {
    parts_->notify_due();
    parts_->set_timer();
  }
  // First what is over, then who is new: a descriptor's number is not used twice in one round.
  parts_->close_broken();
  if (is_listener) parts_->accept_all();
  parts_->statistics.clients = parts_->clients.size();
}

SocketStatistics StatusServer::statistics() const noexcept {
  return parts_->statistics;
}

}  // namespace thermocomp
