#include <algorithm>
#include <arpa/inet.h>
#include <array>
#include <chrono>
#include <poll.h>
#include <string>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <netinet/in.h>
#include <sys/socket.h>

#include "gateway/http/request_rules.hpp"

using namespace thermocomp::gateway;
using std::chrono::milliseconds;
using std::chrono::seconds;
using Stage = SlowConnections::Stage;

namespace {

/// Loopback connection with both ends.
class Link {
 public:
  Link() {
    const int listener = socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in place{};
    place.sin_family = AF_INET;
    place.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    REQUIRE(bind(listener, reinterpret_cast<sockaddr*>(&place), sizeof place) == 0);
    REQUIRE(listen(listener, 1) == 0);
    socklen_t size = sizeof place;
    REQUIRE(getsockname(listener, reinterpret_cast<sockaddr*>(&place), &size) == 0);
    theirs = socket(AF_INET, SOCK_STREAM, 0);
    const int small = 2048;
    setsockopt(theirs, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    REQUIRE(connect(theirs, reinterpret_cast<sockaddr*>(&place), sizeof place) == 0);
    ours = accept(listener, nullptr, nullptr);
    REQUIRE(ours >= 0);
    close(listener);
  }
  ~Link() {
    close(ours);
    close(theirs);
  }
  Link(const Link&) = delete;
  Link& operator=(const Link&) = delete;

  [[nodiscard]] bool is_ended() const {
    pollfd entry{ours, POLLIN, 0};
    return poll(&entry, 1, 0) == 1 && (entry.revents & POLLHUP) != 0;
  }
  /// Sends `count` bytes without blocking.
  void send_bytes(std::size_t count) const {
    const std::string bytes(count, 'x');
    REQUIRE(send(ours, bytes.data(), bytes.size(), MSG_DONTWAIT) == static_cast<ssize_t>(count));
  }
  /// Reads `count` bytes at the peer.
  void take(std::size_t count) const {
    std::array<char, 4096> block{};
    while (count > 0) {
      const ssize_t got = recv(theirs, block.data(), std::min(count, block.size()), 0);
      REQUIRE(got > 0);
      count -= static_cast<std::size_t>(got);
    }
  }

  int ours{-1};
  int theirs{-1};
};

const SlowConnections::Clock::time_point begin{};

}  // namespace

TEST_CASE("a request times out after 15 s, or 3 s while all places are taken", "[gateway][slow]") {
  const Link first;
  const Link second;
  SlowConnections connections(2);
  connections.opened(first.ours, begin);
  connections.end_slow(begin + seconds(15));
  CHECK_FALSE(first.is_ended());
  connections.opened(second.ours, begin + seconds(14));
  connections.end_slow(begin + seconds(15));
  CHECK(first.is_ended());
  CHECK_FALSE(second.is_ended());
  connections.closed(first.ours);
  connections.end_slow(begin + seconds(20));
  CHECK_FALSE(second.is_ended());  // a place is free
  connections.end_slow(begin + seconds(29) + milliseconds(1));
  CHECK(second.is_ended());
}

TEST_CASE("an answer times out after 60 s, or 10 s while all places are taken", "[gateway][slow]") {
  const Link link;
  SlowConnections roomy(2);
  roomy.is_at(link.ours, Stage::answer, begin);
  roomy.end_slow(begin + seconds(60));
  CHECK_FALSE(link.is_ended());
  SlowConnections full(1);
  full.is_at(link.ours, Stage::answer, begin);
  full.end_slow(begin + seconds(10));
  CHECK_FALSE(link.is_ended());
  full.end_slow(begin + seconds(10) + milliseconds(1));
  CHECK(link.is_ended());
}

TEST_CASE("a stream is closed unless the peer reads it", "[gateway][slow]") {
  const Link link;
  SlowConnections connections(10);
  connections.is_at(link.ours, Stage::stream, begin);
  for (int i = 0; i < 100; ++i) {
    link.send_bytes(4000);
    link.take(4000);
    connections.end_slow(begin + seconds(1000 * i));
  }
  CHECK_FALSE(link.is_ended());
  for (int i = 0; i < 30 && !link.is_ended(); ++i) {
    link.send_bytes(4000);
    connections.end_slow(begin);
  }
  CHECK(link.is_ended());
}

TEST_CASE("a slow stream that the peer does not read times out like an answer", "[gateway][slow]") {
  const Link link;
  SlowConnections connections(10);
  connections.is_at(link.ours, Stage::stream, begin);
  link.send_bytes(16000);  // above the peer's window, below the immediate limit
  connections.end_slow(begin + seconds(60));
  CHECK_FALSE(link.is_ended());
  connections.end_slow(begin + seconds(61));
  CHECK(link.is_ended());
}
