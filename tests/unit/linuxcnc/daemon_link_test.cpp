// Tests of the connection to the daemon with a misbehaving socket.
#include "linuxcnc/daemon_link.hpp"

#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <sys/socket.h>
#include <sys/un.h>

using namespace thermocomp_linuxcnc;

namespace {

/// A listening socket; the test writes to the accepted connection.
struct Peer {
  Peer() {
    char name[] = "/tmp/tclinkXXXXXX";
    folder = mkdtemp(name);
    path = folder + "/s";
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    REQUIRE(bind(door, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    REQUIRE(listen(door, 1) == 0);
  }
  ~Peer() {
    hang_up();
    ::close(door);
    std::filesystem::remove_all(folder);
  }
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;

  void take() {
    fd = accept(door, nullptr, nullptr);
    REQUIRE(fd >= 0);
  }
  void send(const std::string& text) const {
    REQUIRE(::send(fd, text.data(), text.size(), MSG_NOSIGNAL) ==
            static_cast<ssize_t>(text.size()));
  }
  void hang_up() {
    if (fd >= 0) ::close(fd);
    fd = -1;
  }

  int door{socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)};
  int fd{-1};
  std::string folder;
  std::string path;
};

}  // namespace

TEST_CASE("only complete lines are sent and received", "[linuxcnc]") {
  Peer peer;
  DaemonLink link(peer.path);
  REQUIRE(link.connect());
  peer.take();
  CHECK(link.send("hello\n"));
  CHECK_FALSE(link.receive());
  peer.send("fir");
  CHECK_FALSE(link.receive());
  peer.send("st\nsecond\nthi");
  CHECK(link.receive() == "first");
  CHECK(link.receive() == "second");
  CHECK_FALSE(link.receive());
  CHECK(link.connected());
}

TEST_CASE("no listener, an invalid path, and a peer that closes are reported", "[linuxcnc]") {
  DaemonLink nobody("/tmp/tclink-nobody-is-here/s");
  CHECK_FALSE(nobody.connect());
  CHECK(nobody.error().find("not reached") != std::string::npos);
  DaemonLink empty("");
  CHECK_FALSE(empty.connect());
  DaemonLink endless(std::string(200, 'x'));
  CHECK_FALSE(endless.connect());

  Peer peer;
  DaemonLink link(peer.path);
  REQUIRE(link.connect());
  peer.take();
  peer.send("last\n");
  peer.hang_up();
  CHECK(link.receive() == "last");
  CHECK_FALSE(link.receive());
  CHECK_FALSE(link.connected());
  REQUIRE(link.connect());
  peer.take();
  CHECK(link.connected());
}

TEST_CASE("a line without an end ends the connection", "[linuxcnc]") {
  Peer peer;
  DaemonLink link(peer.path);
  REQUIRE(link.connect());
  peer.take();
  const std::string piece(32768, 'x');
  for (int i = 0; i < 20 && link.connected(); ++i) {
    peer.send(piece);
    CHECK_FALSE(link.receive());
  }
  CHECK_FALSE(link.connected());
  CHECK(link.error().find("without an end") != std::string::npos);
}
