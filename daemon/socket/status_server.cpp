#include "daemon/socket/status_server.hpp"

#include <algorithm>
#include <array>
#include <cerrno>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <unistd.h>
#include <utility>
#include <vector>

#include <sys/epoll.h>
#include <sys/socket.h>
#include <sys/timerfd.h>

#include "daemon/socket/input_limits.hpp"
#include "daemon/socket/listening_socket.hpp"
#include "daemon/socket/rpc.hpp"

namespace thermocomp {
namespace {

using Clock = std::chrono::steady_clock;
using ClientId = std::uint64_t;
using Alarms = std::multimap<Clock::time_point, ClientId>;

// epoll data of descriptors that are not clients.
constexpr ClientId listener_id = 0;
constexpr ClientId timer_id = 1;
constexpr ClientId first_client_id = 2;

constexpr int accepted_a_turn = 64;
constexpr auto time_outs_checked_every = std::chrono::milliseconds(250);
constexpr auto answers_asked_every = std::chrono::milliseconds(1);

std::string seconds_text(Clock::duration duration) {
  return std::to_string(std::chrono::ceil<std::chrono::seconds>(duration).count()) + " s";
}

/// One connection: socket, buffers, rate limit and state.
struct ServedClient {
  /// Takes over the descriptor.
  ServedClient(int fd_in, const PeerAccess& access_in, const TokenBucket& tokens_in,
               Clock::time_point now);
  ~ServedClient();
  ServedClient(const ServedClient&) = delete;
  ServedClient& operator=(const ServedClient&) = delete;

  /// One read. May set input_ended or broken.
  void receive(Clock::time_point now);
  /// Sends what the socket accepts, keeps the rest. May set broken.
  void send(std::string_view text, Clock::time_point now);
  void flush(Clock::time_point now);
  [[nodiscard]] bool has_unsent() const noexcept { return sent < output.size(); }
  [[nodiscard]] std::size_t held_bytes() const noexcept {
    return input.capacity_bytes() + output.capacity();
  }
  /// No request, answer or subscription is pending.
  [[nodiscard]] bool is_idle() const noexcept {
    return !subscription && !queued && !has_unsent() && !later;
  }

  int fd;
  PeerAccess access;
  std::int64_t user{-1};  ///< from the kernel; -1: unknown
  TokenBucket tokens;
  LineBuffer input;
  std::string output;
  std::size_t sent{0};  ///< bytes of `output` already sent

  bool input_ended{false};  ///< the peer sends no more; answers may be pending
  bool hung_up{false};  ///< the peer does not read either; received requests are still carried out
  bool close_when_sent{false};
  bool broken{false};  ///< unusable
  bool ended{false};   ///< to be closed at the end of the turn
  bool queued{false};  ///< waits for its turn or its rate limit
  std::uint32_t watched{0};
  std::size_t counted_bytes{0};  ///< last held_bytes() added to the statistics

  std::function<bool(Answer&)> later;  ///< Answer::later of the request under way
  std::optional<Subscription> subscription;
  Clock::time_point notified_next{};
  std::uint64_t missed{0};  ///< notifications since the last one sent

  Clock::time_point last_request;  ///< or time of connection
  Clock::time_point line_begun;    ///< while input.is_partial()
  Clock::time_point last_taken;    ///< time when the peer last took bytes, or nothing was pending
};

ServedClient::ServedClient(int fd_in, const PeerAccess& access_in, const TokenBucket& tokens_in,
                           Clock::time_point now)
    : fd(fd_in),
      access(access_in),
      tokens(tokens_in),
      last_request(now),
      line_begun(now),
      last_taken(now) {}

ServedClient::~ServedClient() {
  close(fd);
}

void ServedClient::receive(Clock::time_point now) {
  std::array<char, std::size_t{16} * 1024> bytes{};
  const ssize_t count = recv(fd, bytes.data(), bytes.size(), MSG_DONTWAIT);
  if (count > 0) {
    if (!input.is_partial()) line_begun = now;
    input.add({bytes.data(), static_cast<std::size_t>(count)});
  } else if (count == 0 || (hung_up && errno != EINTR)) {
    input_ended = true;
  } else if (errno != EAGAIN && errno != EINTR) {
    broken = true;
  }
}

void ServedClient::send(std::string_view text, Clock::time_point now) {
  if (broken) return;
  if (!has_unsent()) last_taken = now;
  output.append(text);
  flush(now);
}

void ServedClient::flush(Clock::time_point now) {
  while (has_unsent()) {
    const ssize_t count =
        ::send(fd, output.data() + sent, output.size() - sent, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0 && errno != EAGAIN) broken = true;
    if (count < 0) return;
    sent += static_cast<std::size_t>(count);
    last_taken = now;
  }
  line_begun = now;  // the server had not read from this client before
  sent = 0;
  output.clear();
  if (output.capacity() > kept_bytes) output = std::string();
}

}  // namespace

struct StatusServer::Parts {
  SocketConfig config;
  SocketLimits limits;
  ListeningSocket listener;
  RpcDispatcher dispatcher;
  std::int64_t caller{-1};  ///< client of the present request
  int epoll_fd{-1};
  int timer_fd{-1};
  std::map<ClientId, ServedClient> clients;
  ClientId next_id{first_client_id};
  std::size_t strangers{0};
  TokenBucket all_tokens;
  std::deque<ClientId> ready;     ///< clients with a complete request, in turn
  std::vector<ClientId> waiting;  ///< clients with a delayed answer
  Alarms resting;                 ///< clients over their rate limit, until then
  Alarms subscribers;             ///< time of the next notification
  std::vector<ClientId> broken;
  AccessRules access;
  Clock::time_point time_outs_checked_next{};
  SocketStatistics statistics;

  Parts(const SocketConfig& config_in, const SocketLimits& limits_in);
  ~Parts() { close_own(); }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  void close_own() const noexcept {
    if (epoll_fd >= 0) close(epoll_fd);
    if (timer_fd >= 0) close(timer_fd);
  }
  [[nodiscard]] bool watch(int fd, ClientId id, std::uint32_t events, int operation) const noexcept;
  [[nodiscard]] ServedClient* find(ClientId id);

  void accept_some();
  void take(int fd, Clock::time_point now);
  void refuse(int fd, const std::string& why);
  [[nodiscard]] bool make_room(Clock::time_point now);
  void on_client(ClientId id, std::uint32_t events);
  void arrange(ClientId id, ServedClient& client);
  void serve(Clock::time_point turn_end);
  void answer_one(ClientId id, ServedClient& client);
  void give(ClientId id, ServedClient& client, Answer&& answer);
  void ask_waiting();
  void wake_rested(Clock::time_point now);
  void notify(Clock::time_point turn_end);
  void notify_client(ServedClient& client, std::map<std::string, std::string>& lines,
                     Clock::time_point now);
  void check_time_outs(Clock::time_point now);
  void cut_off(ClientId id, ServedClient& client, const std::string& why, int code = rpc::cut_off);
  void keep_memory_bounded();
  void end(ClientId id, ServedClient& client);
  void close_broken();
  void set_timer();
};

StatusServer::Parts::Parts(const SocketConfig& config_in, const SocketLimits& limits_in)
    : config(config_in),
      limits(limits_in),
      listener(config_in.path),
      dispatcher(config_in),
      all_tokens(limits.all_requests_per_s, limits.all_requests_burst),
      access(config_in) {
  limits.clients_max = places_for_descriptors(limits.clients_max);
  limits.operator_places = std::min(limits.operator_places, limits.clients_max / 4);
  epoll_fd = epoll_create1(EPOLL_CLOEXEC);
  timer_fd = timerfd_create(CLOCK_MONOTONIC, TFD_NONBLOCK | TFD_CLOEXEC);
  if (epoll_fd < 0 || timer_fd < 0 || !watch(listener.fd(), listener_id, EPOLLIN, EPOLL_CTL_ADD) ||
      !watch(timer_fd, timer_id, EPOLLIN, EPOLL_CTL_ADD)) {
    close_own();
    throw SocketError("status socket: epoll is not available");
  }
}

bool StatusServer::Parts::watch(int fd, ClientId id, std::uint32_t events,
                                int operation) const noexcept {
  epoll_event event{};
  event.events = events;
  event.data.u64 = id;
  return epoll_ctl(epoll_fd, operation, fd, &event) == 0;
}

ServedClient* StatusServer::Parts::find(ClientId id) {
  const auto found = clients.find(id);
  return found == clients.end() || found->second.broken ? nullptr : &found->second;
}

// ---- new connections

void StatusServer::Parts::accept_some() {
  const Clock::time_point now = Clock::now();
  for (int i = 0; i < accepted_a_turn; ++i) {
    const int fd = listener.accept_one();
    if (fd < 0) return;
    take(fd, now);
  }
}

void StatusServer::Parts::take(int fd, Clock::time_point now) {
  const std::optional<Peer> peer = peer_of(fd);
  const PeerAccess allowed = peer ? access.of(*peer, now) : PeerAccess{};
  if (!allowed.any() && strangers >= limits.strangers_max) {
    return refuse(fd, "only for members of " + config.read_group);
  }
  const std::size_t places = limits.clients_max - (allowed.operate ? 0 : limits.operator_places);
  if (clients.size() >= places && !make_room(now)) {
    return refuse(fd, "the daemon has " + std::to_string(clients.size()) +
                          " clients already; try again later");
  }
  const ClientId id = next_id++;
  if (!watch(fd, id, EPOLLIN, EPOLL_CTL_ADD)) return refuse(fd, "no resources left");
  ServedClient& client =
      clients
          .try_emplace(id, fd, allowed, TokenBucket(limits.requests_per_s, limits.requests_burst),
                       now)
          .first->second;
  client.watched = EPOLLIN;
  if (peer) client.user = peer->user;
  if (!allowed.any()) ++strangers;
  ++statistics.accepted;
}

void StatusServer::Parts::refuse(int fd, const std::string& why) {
  const std::string line = error_line(rpc::refused, why);
  // A new socket's buffer has room for a line; if not, closing suffices.
  static_cast<void>(::send(fd, line.data(), line.size(), MSG_NOSIGNAL | MSG_DONTWAIT));
  close(fd);
  ++statistics.refused;
}

/// Closes the longest idle client if its idle time exceeds the limit.
bool StatusServer::Parts::make_room(Clock::time_point now) {
  auto oldest = clients.end();
  for (auto each = clients.begin(); each != clients.end(); ++each) {
    if (!each->second.is_idle() || each->second.broken) continue;
    if (oldest == clients.end() || each->second.last_request < oldest->second.last_request) {
      oldest = each;
    }
  }
  if (oldest == clients.end() || now - oldest->second.last_request < limits.replaceable_after) {
    return false;
  }
  cut_off(oldest->first, oldest->second, "idle, and its place is needed");
  close_broken();
  return true;
}

// ---- requests

void StatusServer::Parts::on_client(ClientId id, std::uint32_t events) {
  ServedClient* client = find(id);
  if (client == nullptr) return;
  const Clock::time_point now = Clock::now();
  if ((events & (EPOLLHUP | EPOLLERR)) != 0) {
    // Removed, since epoll would report it repeatedly; received requests are still served.
    client->hung_up = true;
    epoll_ctl(epoll_fd, EPOLL_CTL_DEL, client->fd, nullptr);
  } else if ((events & EPOLLOUT) != 0) {
    client->flush(now);
  } else if ((events & EPOLLIN) != 0) {
    client->receive(now);
  }
  arrange(id, *client);
}

/// Decides which event of the client is awaited next, or closes it.
void StatusServer::Parts::arrange(ClientId id, ServedClient& client) {
  if (client.input.is_too_long() && !client.close_when_sent) {
    return cut_off(id, client,
                   "a line has at most " + std::to_string(LineBuffer::line_bytes_max) + " bytes",
                   rpc::invalid_request);
  }
  while (client.hung_up && !client.input_ended && !client.input.has_line() && !client.broken) {
    client.receive(Clock::now());
    if (client.input.is_too_long()) client.broken = true;
  }
  const std::size_t held = client.held_bytes();
  statistics.buffered_bytes += held - client.counted_bytes;
  client.counted_bytes = held;

  // A pending answer keeps a client open as long as it can read.
  if (client.broken || (client.has_unsent() ? client.hung_up : client.close_when_sent)) {
    return end(id, client);
  }
  std::uint32_t events = 0;
  if (client.has_unsent()) {
    events = EPOLLOUT;
  } else if (client.later) {
    // Neither read nor closed, since further requests follow the answer.
  } else if (client.input.has_line()) {
    if (!client.queued) ready.push_back(id);
    client.queued = true;
  } else if (client.input_ended) {
    if (!client.subscription || client.hung_up) return end(id, client);
  } else {
    events = EPOLLIN;
  }
  if (events == client.watched || client.hung_up) return;
  client.watched = events;
  if (!watch(client.fd, id, events, EPOLL_CTL_MOD)) end(id, client);
}

void StatusServer::Parts::serve(Clock::time_point turn_end) {
  // At least one request: a command may take longer than a turn.
  for (Clock::time_point now = Clock::now(); !ready.empty(); now = Clock::now()) {
    if (!all_tokens.try_take(now)) return;
    const ClientId id = ready.front();
    ready.pop_front();
    ServedClient* client = find(id);
    if (client == nullptr) {
      all_tokens.give_back();
    } else if (!client->tokens.try_take(now)) {
      all_tokens.give_back();
      resting.emplace(client->tokens.next(now), id);
      ++statistics.delayed;
    } else {
      client->queued = false;
      answer_one(id, *client);
    }
    if (Clock::now() >= turn_end) return;
  }
}

void StatusServer::Parts::answer_one(ClientId id, ServedClient& client) {
  std::string line;
  if (client.input.take(line) && !line.empty()) {
    ++statistics.requests;
    caller = client.user;
    Answer answer = dispatcher.answer(client.access, line);
    caller = -1;
    const auto later = std::move(answer.later);
    if (later && !later(answer)) {
      client.later = later;
      waiting.push_back(id);
    } else {
      give(id, client, std::move(answer));
    }
  }
  arrange(id, client);
}

void StatusServer::Parts::give(ClientId id, ServedClient& client, Answer&& answer) {
  const Clock::time_point now = Clock::now();
  client.last_request = now;
  client.line_begun = now;
  if (answer.is_error) ++statistics.errors;
  if (answer.subscription) {
    client.subscription = std::move(answer.subscription);
    client.notified_next = now;
    subscribers.emplace(now, id);
  }
  if (!client.access.any()) client.close_when_sent = true;
  client.send(answer.text, now);
}

void StatusServer::Parts::ask_waiting() {
  std::erase_if(waiting, [this](ClientId id) {
    ServedClient* client = find(id);
    if (client == nullptr) return true;
    Answer answer;
    if (!client->later(answer)) return false;
    client->later = nullptr;
    give(id, *client, std::move(answer));
    arrange(id, *client);
    return true;
  });
}

void StatusServer::Parts::wake_rested(Clock::time_point now) {
  while (!resting.empty() && resting.begin()->first <= now) {
    ready.push_back(resting.begin()->second);
    resting.erase(resting.begin());
  }
}

// ---- subscriptions

void StatusServer::Parts::notify(Clock::time_point turn_end) {
  std::map<std::string, std::string> lines;  // each method is called once for all subscribers
  while (!subscribers.empty()) {
    const Clock::time_point now = Clock::now();
    const auto [due, id] = *subscribers.begin();
    if (due > now || now >= turn_end) return;
    subscribers.erase(subscribers.begin());
    ServedClient* client = find(id);
    // The client has another due time: this entry is of an earlier subscription.
    if (client == nullptr || client->notified_next != due) continue;
    notify_client(*client, lines, now);
    client->notified_next = std::max(due + client->subscription->period, now);
    subscribers.emplace(client->notified_next, id);
    arrange(id, *client);
  }
}

void StatusServer::Parts::notify_client(ServedClient& client,
                                        std::map<std::string, std::string>& lines,
                                        Clock::time_point now) {
  if (client.has_unsent()) {
    ++client.missed;
    ++statistics.missed;
    return;
  }
  std::string text;
  if (client.missed > 0) text = missed_line(std::exchange(client.missed, 0));
  for (const std::string& name : client.subscription->methods) {
    auto line = lines.find(name);
    if (line == lines.end()) line = lines.emplace(name, dispatcher.notification(name)).first;
    text += line->second;
  }
  client.send(text, now);
}

// ---- limits

void StatusServer::Parts::check_time_outs(Clock::time_point now) {
  if (now < time_outs_checked_next) return;
  time_outs_checked_next = now + time_outs_checked_every;
  for (auto& [id, client] : clients) {
    if (client.broken) continue;
    if (client.has_unsent() && now - client.last_taken > limits.unread_max) {
      cut_off(id, client, "nothing was read for " + seconds_text(limits.unread_max));
    } else if (client.input.is_partial() && !client.queued && !client.has_unsent() &&
               !client.later && now - client.line_begun > limits.partial_line_max) {
      cut_off(id, client,
              "a request must be complete within " + seconds_text(limits.partial_line_max));
    } else if (!client.access.any() && now - client.last_request > limits.stranger_max) {
      cut_off(id, client, "only for members of " + config.read_group);
    } else if (client.is_idle() && now - client.last_request > limits.idle_max) {
      cut_off(id, client, "no request for " + seconds_text(limits.idle_max));
    }
  }
}

/// Sends the reason, if the peer still reads, and closes the client.
void StatusServer::Parts::cut_off(ClientId id, ServedClient& client, const std::string& why,
                                  int code) {
  ++statistics.cut_off;
  // No other line may be inserted into an answer.
  if (!client.has_unsent()) client.send(error_line(code, why), Clock::now());
  end(id, client);
}

void StatusServer::Parts::keep_memory_bounded() {
  while (statistics.buffered_bytes > limits.buffered_bytes_max) {
    const auto most =
        std::max_element(clients.begin(), clients.end(), [](const auto& a, const auto& b) {
          return a.second.counted_bytes < b.second.counted_bytes;
        });
    if (most == clients.end()) return;
    cut_off(most->first, most->second, "the clients together use too much memory");
    close_broken();
  }
}

void StatusServer::Parts::end(ClientId id, ServedClient& client) {
  client.broken = true;
  if (std::exchange(client.ended, true)) return;
  statistics.buffered_bytes -= std::exchange(client.counted_bytes, 0);
  broken.push_back(id);
}

void StatusServer::Parts::close_broken() {
  for (const ClientId id : broken) {
    const auto client = clients.find(id);
    if (client == clients.end()) continue;
    if (!client->second.access.any()) --strangers;
    clients.erase(client);
  }
  broken.clear();
}

void StatusServer::Parts::set_timer() {
  const Clock::time_point now = Clock::now();
  std::optional<Clock::time_point> next;
  const auto wake_at = [&](Clock::time_point when) { next = next ? std::min(*next, when) : when; };
  if (!ready.empty()) wake_at(all_tokens.next(now));
  if (!waiting.empty()) wake_at(now + answers_asked_every);
  if (!resting.empty()) wake_at(resting.begin()->first);
  if (!subscribers.empty()) wake_at(subscribers.begin()->first);
  if (!clients.empty()) wake_at(time_outs_checked_next);
  itimerspec when{};
  if (next) {
    // Absolute time; zero would disarm the timer.
    const std::int64_t at_ns = std::max<std::int64_t>(
        1, std::chrono::duration_cast<std::chrono::nanoseconds>(next->time_since_epoch()).count());
    when.it_value.tv_sec = at_ns / 1'000'000'000;
    when.it_value.tv_nsec = at_ns % 1'000'000'000;
  }
  timerfd_settime(timer_fd, TFD_TIMER_ABSTIME, &when, nullptr);
}

// ---- interface

StatusServer::StatusServer(const SocketConfig& config, const SocketLimits& limits)
    : parts_(std::make_unique<Parts>(config, limits)) {}
StatusServer::~StatusServer() = default;

void StatusServer::add_method(const std::string& name, AccessClass access, RpcHandler handler) {
  parts_->dispatcher.add_method(name, access, std::move(handler));
}

std::int64_t StatusServer::caller() const noexcept {
  return parts_->caller;
}

void StatusServer::add_slow_method(const std::string& name, AccessClass access,
                                   RpcSlowHandler handler) {
  parts_->dispatcher.add_slow_method(name, access, std::move(handler));
}

int StatusServer::fd() const noexcept {
  return parts_->epoll_fd;
}

void StatusServer::handle(std::chrono::milliseconds timeout) {
  Parts& parts = *parts_;
  std::array<epoll_event, 64> events{};
  const int count = epoll_wait(parts.epoll_fd, events.data(), static_cast<int>(events.size()),
                               static_cast<int>(timeout.count()));
  const Clock::time_point now = Clock::now();
  const Clock::time_point turn_end = now + parts.limits.turn_max;
  bool is_listener = false;
  for (int i = 0; i < count; ++i) {
    const epoll_event& event = events[static_cast<std::size_t>(i)];
    is_listener = is_listener || event.data.u64 == listener_id;
    if (event.data.u64 >= first_client_id) parts.on_client(event.data.u64, event.events);
  }
  parts.ask_waiting();
  parts.wake_rested(now);
  // Half of the turn each, so that requests and subscriptions do not starve each other.
  parts.notify(now + parts.limits.turn_max / 2);
  parts.serve(turn_end);
  parts.check_time_outs(now);
  parts.close_broken();
  parts.keep_memory_bounded();
  if (is_listener) parts.accept_some();
  parts.set_timer();
  parts.statistics.clients = parts.clients.size();
}

SocketStatistics StatusServer::statistics() const noexcept {
  return parts_->statistics;
}

}  // namespace thermocomp
