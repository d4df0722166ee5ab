// The client with hostile servers at the daemon's path.
#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <thread>
#include <unistd.h>
#include <utility>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <sys/socket.h>

#include "daemon/socket/status_client.hpp"
#include "socket_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;
using Catch::Contains;

namespace {

using Clock = std::chrono::steady_clock;

/// Accepts one connection and answers the first request with `text`, repeatedly if `endless`.
class HostileServer {
 public:
  HostileServer(const std::filesystem::path& path, std::string text, bool endless = false)
      : listener_(listen_at(path)), text_(std::move(text)), endless_(endless) {
    thread_ = std::thread([this] { serve(); });
  }
  ~HostileServer() {
    shutdown(listener_, SHUT_RDWR);
    thread_.join();
    close(listener_);
  }
  HostileServer(const HostileServer&) = delete;
  HostileServer& operator=(const HostileServer&) = delete;

  static int listen_at(const std::filesystem::path& path) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    path.string().copy(address.sun_path, sizeof address.sun_path - 1);
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    REQUIRE(bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    REQUIRE(listen(fd, 0) == 0);
    return fd;
  }

 private:
  void serve() const {
    const int fd = accept(listener_, nullptr, nullptr);
    if (fd < 0) return;
    char byte = 0;
    while (recv(fd, &byte, 1, 0) == 1 && byte != '\n') {
    }
    do {
      for (std::size_t sent = 0; sent < text_.size();) {
        const ssize_t count = send(fd, text_.data() + sent, text_.size() - sent, MSG_NOSIGNAL);
        if (count <= 0) {
          close(fd);
          return;
        }
        sent += static_cast<std::size_t>(count);
      }
    } while (endless_);
    recv(fd, &byte, 1, 0);  // until the client disconnects
    close(fd);
  }

  int listener_;
  std::string text_;
  bool endless_;
  std::thread thread_;
};

std::string nested(std::size_t depth) {
  return std::string(depth, '[') + std::string(depth, ']');
}

}  // namespace

TEST_CASE("connecting to a full backlog ends at the time-out", "[socket]") {
  TempFolder folder;
  const int listener = HostileServer::listen_at(folder / "s");
  std::vector<StatusClient> taken;
  const auto connect_all = [&] {
    for (int i = 0; i < 10; ++i) taken.emplace_back(folder / "s", milliseconds(100));
  };
  CHECK_THROWS_WITH(connect_all(), Contains("no answer in time"));
  const auto begun = Clock::now();
  CHECK_THROWS_AS(StatusClient(folder / "s", milliseconds(200)), ClientError);
  CHECK(Clock::now() - begun < seconds(3));
  CHECK(Clock::now() - begun >= milliseconds(200));
  // The backlog drains while the client waits.
  std::thread later([&] {
    std::this_thread::sleep_for(milliseconds(100));
    close(accept(listener, nullptr, nullptr));
  });
  CHECK_NOTHROW(StatusClient(folder / "s", seconds(10)));
  later.join();
  close(listener);
}

TEST_CASE("a deeply nested answer is refused with a message", "[socket]") {
  TempFolder folder;
  const std::string answer = R"({"id":1,"result":)" + nested(400000) + "}\n";
  HostileServer server(folder / "s", answer);
  StatusClient client(folder / "s");
  CHECK_THROWS_WITH(client.call("status", json::object()), Contains("at most 16 deep"));
}

TEST_CASE("an endless answer and endless notifications take bounded time and memory", "[socket]") {
  TempFolder folder;
  const auto fails = [&](const char* name, const std::string& text) {
    HostileServer server(folder / name, text, true);
    StatusClient client(folder / name);
    const auto begun = Clock::now();
    CHECK_THROWS_AS(client.call("status", json::object(), milliseconds(500)), ClientError);
    CHECK(Clock::now() - begun < seconds(5));
  };
  fails("a", std::string(65536, 'x'));
  fails("b", "{\"method\":\"status\",\"params\":{}}\n");
  fails("c", "\n");
}

TEST_CASE("an answer of wrong types is an error, not a parser exception", "[socket]") {
  TempFolder folder;
  const auto asked = [&](const char* name, const std::string& text) {
    HostileServer server(folder / name, text + "\n");
    StatusClient client(folder / name);
    return client.call("status", json::object());
  };
  CHECK_THROWS_AS(asked("a", R"({"id":1,"error":{"code":"x","message":[1]}})"), RemoteError);
  CHECK_THROWS_AS(asked("b", R"({"id":1,"error":{}})"), RemoteError);
  CHECK_THROWS_AS(asked("c", "[1,2]"), ClientError);
  CHECK_THROWS_AS(asked("d", "\xFF\xFE"), ClientError);
  CHECK(asked("e", R"({"id":1})").is_null());
}
