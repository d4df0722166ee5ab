#include "gateway/shdr/shdr_adapter.hpp"

#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <list>
#include <mutex>
#include <poll.h>
#include <stdexcept>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/socket.h>

#include "gateway/texts/shdr_text.hpp"

namespace thermocomp::gateway {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::size_t line_bytes_max = 256;
constexpr std::size_t unread_bytes_max = std::size_t{256} * 1024;

[[noreturn]] void fail(const std::string& what) {
  throw std::runtime_error("shdr: " + what + ": " + std::strerror(errno));
}

int listening_socket(const ShdrSettings& settings, std::uint16_t& port) {
  sockaddr_storage address{};
  auto* four = reinterpret_cast<sockaddr_in*>(&address);
  auto* six = reinterpret_cast<sockaddr_in6*>(&address);
  const bool is_four = inet_pton(AF_INET, settings.address.c_str(), &four->sin_addr) == 1;
  if (!is_four) inet_pton(AF_INET6, settings.address.c_str(), &six->sin6_addr);
  address.ss_family = is_four ? AF_INET : AF_INET6;
  (is_four ? four->sin_port : six->sin6_port) = htons(settings.port);
  socklen_t size = is_four ? sizeof *four : sizeof *six;
  const int fd = socket(address.ss_family, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) fail("socket");
  const int yes = 1;
  setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &yes, sizeof yes);
  if (bind(fd, reinterpret_cast<sockaddr*>(&address), size) != 0 || listen(fd, 8) != 0) {
    const int code = errno;
    close(fd);
    errno = code;
    fail("cannot listen on " + settings.address + " port " + std::to_string(settings.port));
  }
  getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  port = ntohs(is_four ? four->sin_port : six->sin6_port);
  return fd;
}

struct Agent {
  int fd{-1};
  std::string in;
  std::string out;
  bool is_lost{false};
  Clock::time_point received_at{Clock::now()};
};

}  // namespace

struct ShdrAdapter::Parts {
  explicit Parts(const ShdrSettings& settings_in);
  ~Parts();

  void run();
  void take_agent();
  [[nodiscard]] bool drop_silent();
  void take_snapshot();
  void read_from(Agent& agent) const;
  static void write_to(Agent& agent);
  void drop_lost();

  const ShdrSettings settings;
  std::uint16_t port{0};
  int listener{-1};
  int wake{-1};
  std::thread thread;

  std::mutex mutex;  ///< guards the next two
  SnapshotPointer newest;
  bool stops{false};

  // Adapter's thread only.
  std::list<Agent> agents;
  ShdrStates sent;
  double sent_wall_s{0.0};
};

ShdrAdapter::Parts::Parts(const ShdrSettings& settings_in) : settings(settings_in) {
  listener = listening_socket(settings, port);
  wake = eventfd(0, EFD_NONBLOCK | EFD_CLOEXEC);
  if (wake < 0) fail("eventfd");
}

ShdrAdapter::Parts::~Parts() {
  for (const Agent& agent : agents) close(agent.fd);
  close(listener);
  close(wake);
}

void ShdrAdapter::Parts::run() {
  for (;;) {
    std::vector<pollfd> entries{{wake, POLLIN, 0}, {listener, POLLIN, 0}};
    for (const Agent& agent : agents)
      entries.push_back(
          {agent.fd, static_cast<short>(agent.out.empty() ? POLLIN : POLLIN | POLLOUT), 0});
    constexpr int look_every_ms = 1000;
    if (poll(entries.data(), entries.size(), look_every_ms) < 0 && errno != EINTR) return;
    std::uint64_t count = 0;
    static_cast<void>(!read(wake, &count, sizeof count));
    {
      const std::lock_guard lock(mutex);
      if (stops) return;
    }
    std::size_t i = 2;
    for (Agent& agent : agents) {
      if ((entries[i].revents & (POLLIN | POLLHUP | POLLERR)) != 0) read_from(agent);
      ++i;
    }
    if ((entries[1].revents & POLLIN) != 0) take_agent();
    take_snapshot();
    for (Agent& agent : agents) write_to(agent);
    drop_lost();
  }
}

void ShdrAdapter::Parts::take_agent() {
  const int fd = accept4(listener, nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC);
  if (fd < 0) return;
  if (agents.size() >= settings.agents_max && !drop_silent()) {
    close(fd);
    return;
  }
  agents.push_back({fd, "", "", false, Clock::now()});
  agents.back().out = shdr_lines({}, sent, sent_wall_s);
}

/// An agent pings once per heartbeat; the one silent longest, for at least two, is replaced by a
/// new one.
bool ShdrAdapter::Parts::drop_silent() {
  const auto silent = std::min_element(
      agents.begin(), agents.end(),
      [](const Agent& a, const Agent& b) { return a.received_at < b.received_at; });
  if (silent == agents.end() || Clock::now() - silent->received_at <
                                    std::chrono::duration<double>(2.0 * settings.heartbeat_s))
    return false;
  close(silent->fd);
  agents.erase(silent);
  return true;
}

void ShdrAdapter::Parts::take_snapshot() {
  SnapshotPointer snapshot;
  {
    const std::lock_guard lock(mutex);
    snapshot = std::exchange(newest, nullptr);
  }
  if (!snapshot) return;
  ShdrStates now = shdr_states(*snapshot);
  const std::string lines = shdr_lines(sent, now, snapshot->wall_s);
  sent = std::move(now);
  sent_wall_s = snapshot->wall_s;
  for (Agent& agent : agents) {
    agent.out += lines;
    if (agent.out.size() > unread_bytes_max) agent.is_lost = true;
  }
}

void ShdrAdapter::Parts::read_from(Agent& agent) const {
  std::array<char, 1024> bytes{};
  const ssize_t count = recv(agent.fd, bytes.data(), bytes.size(), 0);
  if (count < 0 && (errno == EAGAIN || errno == EINTR)) return;
  agent.is_lost = agent.is_lost || count <= 0;
  if (count > 0) {
    agent.in.append(bytes.data(), static_cast<std::size_t>(count));
    agent.received_at = Clock::now();
  }
  for (std::size_t end = 0; (end = agent.in.find('\n')) != std::string::npos;) {
    agent.out += shdr_answer(std::string_view(agent.in).substr(0, end), settings.heartbeat_s);
    agent.in.erase(0, end + 1);
  }
  if (agent.in.size() > line_bytes_max || agent.out.size() > unread_bytes_max) agent.is_lost = true;
}

void ShdrAdapter::Parts::write_to(Agent& agent) {
  if (agent.out.empty() || agent.is_lost) return;
  const ssize_t count =
      send(agent.fd, agent.out.data(), agent.out.size(), MSG_NOSIGNAL | MSG_DONTWAIT);
  if (count > 0) agent.out.erase(0, static_cast<std::size_t>(count));
  if (count < 0 && errno != EAGAIN && errno != EINTR) agent.is_lost = true;
}

void ShdrAdapter::Parts::drop_lost() {
  for (auto agent = agents.begin(); agent != agents.end();) {
    if (!agent->is_lost) {
      ++agent;
      continue;
    }
    close(agent->fd);
    agent = agents.erase(agent);
  }
}

ShdrAdapter::ShdrAdapter(const ShdrSettings& settings) : parts_(std::make_unique<Parts>(settings)) {
  parts_->thread = std::thread([this] { parts_->run(); });
}

ShdrAdapter::~ShdrAdapter() {
  {
    const std::lock_guard lock(parts_->mutex);
    parts_->stops = true;
  }
  const std::uint64_t one = 1;
  static_cast<void>(!write(parts_->wake, &one, sizeof one));
  parts_->thread.join();
}

void ShdrAdapter::show(const SnapshotPointer& snapshot) {
  {
    const std::lock_guard lock(parts_->mutex);
    parts_->newest = snapshot;
  }
  const std::uint64_t one = 1;
  static_cast<void>(!write(parts_->wake, &one, sizeof one));
}

std::uint16_t ShdrAdapter::port() const noexcept {
  return parts_->port;
}

}  // namespace thermocomp::gateway
