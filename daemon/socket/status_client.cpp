#include "daemon/socket/status_client.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <deque>
#include <poll.h>
#include <string_view>
#include <thread>
#include <unistd.h>
#include <utility>

#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/un.h>

#include "config/text/outer_json.hpp"
#include "daemon/socket/rpc.hpp"

namespace thermocomp {
namespace {

using nlohmann::json;
using Clock = std::chrono::steady_clock;

/// Retry period while the server's backlog is full.
constexpr std::chrono::milliseconds connected_again_every(20);

[[noreturn]] void no_daemon(const std::string& path, int error) {
  std::string why = std::strerror(error);
  if (error == ENOENT) why = "no such socket (is thermocompd running?)";
  if (error == ECONNREFUSED) why = "connection refused (is thermocompd running?)";
  throw ClientError("no daemon at " + path + ": " + why);
}

[[noreturn]] void no_answer(const std::string& path) {
  throw ClientError("no answer in time from the daemon at " + path);
}

/// Non-blocking, since a server that hangs leaves its backlog full.
int connect_to(const std::filesystem::path& path, Clock::time_point deadline) {
  const std::string text = path.string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (text.empty() || text.size() >= sizeof address.sun_path) no_daemon(text, ENAMETOOLONG);
  std::memcpy(address.sun_path, text.data(), text.size());
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0);
  if (fd < 0) no_daemon(text, errno);
  while (connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
    const int error = errno;
    const bool is_full = error == EAGAIN || error == EINTR;
    if (is_full && Clock::now() < deadline) {
      std::this_thread::sleep_for(connected_again_every);
      continue;
    }
    close(fd);
    if (is_full) no_answer(text);
    no_daemon(text, error);
  }
  return fd;
}

}  // namespace

struct StatusClient::Parts {
  Parts(const std::filesystem::path& path_in, Clock::time_point deadline)
      : path(path_in.string()), fd(connect_to(path_in, deadline)) {}
  ~Parts() { close(fd); }
  Parts(const Parts&) = delete;
  Parts& operator=(const Parts&) = delete;

  std::string path;
  int fd;
  std::string input;
  std::deque<json> notifications;
  std::int64_t next_id{1};

  void wait_for(short events, Clock::time_point deadline) const;
  void send_all(const std::string& text, Clock::time_point deadline) const;
  [[nodiscard]] json receive(Clock::time_point deadline);
  [[nodiscard]] json parse(std::string_view line) const;
  void keep(json notification);
};

void StatusClient::Parts::wait_for(short events, Clock::time_point deadline) const {
  for (;;) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) no_answer(path);
    pollfd entry{fd, events, 0};
    const int code = poll(&entry, 1, static_cast<int>(std::min<std::int64_t>(left, 1 << 30)));
    if (code > 0) return;
    if (code < 0 && errno != EINTR) throw ClientError(path + ": " + std::strerror(errno));
  }
}

void StatusClient::Parts::send_all(const std::string& text, Clock::time_point deadline) const {
  std::size_t done = 0;
  while (done < text.size()) {
    wait_for(POLLOUT, deadline);
    const ssize_t count =
        ::send(fd, text.data() + done, text.size() - done, MSG_NOSIGNAL | MSG_DONTWAIT);
    if (count < 0 && (errno == EAGAIN || errno == EINTR)) continue;
    if (count < 0 && errno == EPIPE) return;  // an error line already received may explain it
    if (count < 0) throw ClientError(path + ": " + std::strerror(errno));
    done += static_cast<std::size_t>(count);
  }
}

json StatusClient::Parts::receive(Clock::time_point deadline) {
  for (std::size_t searched = 0;;) {
    const std::size_t end = input.find('\n', searched);
    if (end != std::string::npos) {
      const std::string line = input.substr(0, end);
      input.erase(0, end + 1);
      return parse(line);
    }
    searched = input.size();
    if (searched > JsonLimits{}.bytes_max) throw ClientError(path + ": answers without an end");
    wait_for(POLLIN, deadline);
    std::array<char, std::size_t{64} * 1024> bytes{};
    const ssize_t count = recv(fd, bytes.data(), bytes.size(), MSG_DONTWAIT);
    if (count == 0) throw ClientError("the daemon at " + path + " closed the connection");
    if (count < 0 && errno != EAGAIN && errno != EINTR) {
      throw ClientError("the daemon at " + path + ": " + std::strerror(errno));
    }
    if (count > 0) input.append(bytes.data(), static_cast<std::size_t>(count));
  }
}

json StatusClient::Parts::parse(std::string_view line) const {
  try {
    json message = parse_outer_json(line);
    if (message.is_object()) return message;
  } catch (const JsonError& error) {
    throw ClientError(path + ": answer is not JSON-RPC: " + error.what());
  }
  throw ClientError(path + ": answer is not JSON-RPC");
}

void StatusClient::Parts::keep(json notification) {
  notifications.push_back(std::move(notification));
  if (notifications.size() > notifications_max) notifications.pop_front();
}

RemoteError::RemoteError(int code, const std::string& message)
    : cli::Failure(message, code == rpc::refused ? cli::exit_no : cli::exit_error), code_(code) {}

StatusClient::StatusClient(const std::filesystem::path& path, std::chrono::milliseconds timeout)
    : parts_(std::make_unique<Parts>(path, Clock::now() + timeout)) {}
StatusClient::~StatusClient() = default;
StatusClient::StatusClient(StatusClient&&) noexcept = default;

json StatusClient::call(const std::string& method, const json& params,
                        std::chrono::milliseconds timeout) {
  const Clock::time_point deadline = Clock::now() + timeout;
  const std::int64_t id = parts_->next_id++;
  const json request = {{"jsonrpc", "2.0"},
                        {"id", id},
                        {"method", method},
                        {"params", params.is_null() ? json::object() : params}};
  parts_->send_all(request.dump(-1, ' ', false, json::error_handler_t::replace) + "\n", deadline);
  for (;;) {
    json message = parts_->receive(deadline);
    if (message.contains("method")) {
      parts_->keep(std::move(message));
      continue;
    }
    const json answered = message.value("id", json());
    if (!answered.is_null() && answered != id) continue;  // answer of a call that timed out
    if (const auto error = message.find("error"); error != message.end() && error->is_object()) {
      const auto code = error->find("code");
      const auto text = error->find("message");
      const bool is_known = code != error->end() && code->is_number_integer();
      const bool has_text = text != error->end() && text->is_string();
      throw RemoteError(is_known ? code->get<int>() : 0,
                        has_text ? text->get<std::string>() : std::string("error"));
    }
    const auto result = message.find("result");
    return result == message.end() ? json() : std::move(*result);
  }
}

json StatusClient::next(std::chrono::milliseconds timeout) {
  const Clock::time_point deadline = Clock::now() + timeout;
  while (parts_->notifications.empty()) {
    json message = parts_->receive(deadline);
    if (message.contains("method")) parts_->keep(std::move(message));
  }
  json message = std::move(parts_->notifications.front());
  parts_->notifications.pop_front();
  return message;
}

}  // namespace thermocomp
