/// A status server on a thread, and a client for arbitrary requests.
#pragma once

#include <atomic>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <poll.h>
#include <string>
#include <thread>
#include <unistd.h>

#include <nlohmann/json.hpp>
#include <sys/socket.h>
#include <sys/un.h>

#include "daemon/socket/status_server.hpp"
#include "history_fixture.hpp"

namespace thermocomp::testing {

using nlohmann::json;
using std::chrono::milliseconds;
using std::chrono::seconds;

/// A server with a method of each access class, on its own thread.
class RunningServer {
 public:
  explicit RunningServer(const std::filesystem::path& path, const SocketLimits& limits = {})
      : config_{path, "thermocomp-no-such-group", "thermocomp-no-such-group",
                "thermocomp-no-such-group", "thermocomp-no-such-group"} {
    server_ = std::make_unique<StatusServer>(config_, limits);
    server_->add_method("status", AccessClass::read, [](const json&) {
      return json{{"mode", "compensating"}, {"value_um", not_a_number}};
    });
    server_->add_method("big", AccessClass::read,
                        [](const json&) { return json(std::string(300000, 'x')); });
    server_->add_method("enable", AccessClass::operate, [](const json&) { return json(true); });
    server_->add_method("controller_state", AccessClass::bridge,
                        [](const json&) { return json(true); });
    server_->add_method("measured", AccessClass::operate, [](const json& params) {
      return json(params.at("value_um").get<double>());
    });
    server_->add_method("fails", AccessClass::read,
                        [](const json&) -> json { throw RpcError(rpc::refused, "not now"); });
    // Pending until released; then fails if requested.
    server_->add_slow_method("slow", AccessClass::operate, [this](const json& params) {
      return [this, fails = params.contains("fails")]() -> std::optional<json> {
        asked_.fetch_add(1);
        if (!let_go_) return std::nullopt;
        if (fails) throw RpcError(rpc::refused, "not now");
        return json("late");
      };
    });
    thread_ = std::thread([this] {
      while (!stopping_) {
        server_->handle(milliseconds(20));
        const std::lock_guard lock(mutex_);
        statistics_ = server_->statistics();
      }
    });
  }
  ~RunningServer() {
    stopping_ = true;
    thread_.join();
  }
  RunningServer(const RunningServer&) = delete;
  RunningServer& operator=(const RunningServer&) = delete;

  void let_go() { let_go_ = true; }
  [[nodiscard]] int asked() const { return asked_; }

  [[nodiscard]] SocketStatistics statistics() const {
    const std::lock_guard lock(mutex_);
    return statistics_;
  }

 private:
  mutable std::mutex mutex_;
  SocketStatistics statistics_;
  SocketConfig config_;
  std::unique_ptr<StatusServer> server_;
  std::atomic<bool> stopping_{false};
  std::atomic<bool> let_go_{false};  ///< results of `slow` are complete
  std::atomic<int> asked_{0};        ///< number of queries for results
  std::thread thread_;
};

class RawClient {
 public:
  explicit RawClient(const std::filesystem::path& path)
      : fd_(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    is_connected_ = connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  }
  ~RawClient() { close(fd_); }
  RawClient(const RawClient&) = delete;
  RawClient& operator=(const RawClient&) = delete;

  [[nodiscard]] bool is_connected() const { return is_connected_; }
  void send(const std::string& text) const {
    std::size_t done = 0;
    while (done < text.size()) {
      const ssize_t count = ::send(fd_, text.data() + done, text.size() - done, MSG_NOSIGNAL);
      if (count <= 0) return;
      done += static_cast<std::size_t>(count);
    }
  }
  void end_sending() const { shutdown(fd_, SHUT_WR); }
  /// The next line, or "" when the connection ended or after 10 s.
  std::string line() {
    for (;;) {
      const std::size_t end = input_.find('\n');
      if (end != std::string::npos) {
        std::string text = input_.substr(0, end);
        input_.erase(0, end + 1);
        return text;
      }
      pollfd entry{fd_, POLLIN, 0};
      if (poll(&entry, 1, 10000) <= 0) return {};
      char bytes[4096];
      const ssize_t count = recv(fd_, bytes, sizeof bytes, 0);
      if (count <= 0) return {};
      input_.append(bytes, static_cast<std::size_t>(count));
    }
  }
  int error_code() {
    const json answer = json::parse(line(), nullptr, false);
    return answer.is_object() && answer.contains("error") ? answer["error"]["code"].get<int>() : 0;
  }

 private:
  int fd_;
  bool is_connected_{false};
  std::string input_;
};

inline constexpr const char* status_request =
    "{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"status\"}\n";

}  // namespace thermocomp::testing
