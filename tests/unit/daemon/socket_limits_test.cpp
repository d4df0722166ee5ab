#include <csignal>
#include <fcntl.h>
#include <grp.h>

#include <catch2/catch.hpp>
#include <sys/select.h>
#include <sys/wait.h>

#include "daemon/socket/status_client.hpp"
#include "socket_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

TEST_CASE("clients with incomplete requests, without requests, or not reading are cut off",
          "[socket]") {
  const TempFolder folder;
  SocketLimits limits;
  limits.partial_line_max = limits.unread_max = milliseconds(300);
  limits.idle_max = seconds(2);
  const RunningServer server(folder / "s", limits);
  SECTION("half a request, also when bytes of it keep coming") {
    RawClient client(folder / "s");
    for (int i = 0; i < 200 && server.statistics().cut_off == 0; ++i) {
      client.send("x");
      std::this_thread::sleep_for(milliseconds(20));
    }
    CHECK(client.error_code() == rpc::cut_off);
    CHECK(client.line().empty());
  }
  SECTION("no request") {
    RawClient client(folder / "s");
    CHECK(client.line().find("no request for 2 s") != std::string::npos);
    CHECK(client.line().empty());
  }
  SECTION("answers nobody takes") {
    const RawClient client(folder / "s");
    client.send("{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"big\"}\n");
    for (int i = 0; i < 500 && server.statistics().cut_off == 0; ++i) {
      std::this_thread::sleep_for(milliseconds(20));
    }
  }
  // The peer may see its end before the server's counters change.
  for (int i = 0; i < 500 && server.statistics().cut_off == 0; ++i) {
    std::this_thread::sleep_for(milliseconds(20));
  }
  CHECK(server.statistics().cut_off == 1);
}

TEST_CASE("a subscriber that does not read takes no memory and is sent the number missed",
          "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  RawClient slow(folder / "s");
  slow.send(R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"methods":["big"],)"
            R"("period_s":0.1}})"
            "\n");
  for (int i = 0; i < 500 && server.statistics().missed < 3; ++i) {
    std::this_thread::sleep_for(milliseconds(20));
  }
  CHECK(server.statistics().missed >= 3);
  CHECK(server.statistics().buffered_bytes < 1000000);
  json reported = {{"method", ""}};
  for (int i = 0; i < 100 && reported.value("method", "") != "missed"; ++i) {
    reported = json::parse(slow.line(), nullptr, false);
  }
  REQUIRE(reported["method"] == "missed");
  CHECK(reported["params"]["notifications"].get<int>() >= 3);
}

TEST_CASE("a flood of requests is delayed, not refused, and other clients are answered",
          "[socket]") {
  const TempFolder folder;
  SocketLimits limits;
  limits.requests_per_s = 50.0;
  limits.requests_burst = 20.0;
  const RunningServer server(folder / "s", limits);
  RawClient hog(folder / "s");
  std::string flood;
  for (int i = 0; i < 100; ++i) flood += status_request;
  const auto begin = std::chrono::steady_clock::now();
  hog.send(flood);
  StatusClient polite(folder / "s");
  CHECK(polite.call("status", {})["mode"] == "compensating");
  int answers = 0;
  for (; answers < 100 && hog.line().find("compensating") != std::string::npos; ++answers) {
  }
  CHECK(answers == 100);
  // Lower bound on any machine: (100 - 20) / 50 per second.
  CHECK(std::chrono::steady_clock::now() - begin >= milliseconds(1590));
  CHECK(server.statistics().delayed > 0);
}

TEST_CASE("all clients together have a rate limit", "[socket]") {
  const TempFolder folder;
  SocketLimits limits;
  limits.all_requests_per_s = 50.0;
  limits.all_requests_burst = 20.0;
  const RunningServer server(folder / "s", limits);
  const auto begin = std::chrono::steady_clock::now();
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 10; ++i) {
    clients.push_back(std::make_unique<RawClient>(folder / "s"));
    for (int k = 0; k < 10; ++k) clients.back()->send(status_request);
  }
  int answers = 0;
  for (const auto& client : clients) {
    for (int k = 0; k < 10; ++k) answers += client->line().empty() ? 0 : 1;
  }
  CHECK(answers == 100);
  CHECK(std::chrono::steady_clock::now() - begin >= milliseconds(1590));
}

TEST_CASE("a turn of the server is short, independent of the load", "[socket]") {
  const TempFolder folder;
  const SocketConfig config{folder / "s", "no-such-1", "no-such-2", "no-such-3"};
  StatusServer server(config);
  int calls = 0;
  server.add_method("slow", AccessClass::read, [&](const json&) {
    ++calls;
    std::this_thread::sleep_for(milliseconds(20));  // longer than a turn
    return json(true);
  });
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 5; ++i) {
    clients.push_back(std::make_unique<RawClient>(folder / "s"));
    for (int k = 0; k < 3; ++k) {
      clients.back()->send("{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"slow\"}\n");
    }
  }
  for (int turn = 0; turn < 100 && calls < 15; ++turn) {
    const int before = calls;
    // Remaining work keeps the descriptor readable: poll() must not sleep.
    pollfd entry{server.fd(), POLLIN, 0};
    REQUIRE(poll(&entry, 1, 10000) == 1);
    server.handle(milliseconds(0));
    CHECK(calls - before <= 1);
  }
  CHECK(calls == 15);
}

TEST_CASE("a connection does not take a descriptor below FD_SETSIZE", "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  const auto low_numbers = [] {
    int count = 0;
    for (int fd = 0; fd < FD_SETSIZE; ++fd) count += fcntl(fd, F_GETFD) >= 0 ? 1 : 0;
    return count;
  };
  const int before = low_numbers();
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 10; ++i) {
    clients.push_back(std::make_unique<RawClient>(folder / "s"));
    clients.back()->send(status_request);
    CHECK_FALSE(clients.back()->line().empty());
  }
  CHECK(low_numbers() - before == 10);  // ours
}

TEST_CASE("more than a thousand clients are served", "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 1100; ++i) {
    clients.push_back(std::make_unique<RawClient>(folder / "s"));
    REQUIRE(clients.back()->is_connected());
    clients.back()->send(status_request);
  }
  int served = 0;
  for (const auto& client : clients)
    served += client->line().find("compensating") != std::string::npos ? 1 : 0;
  CHECK(served == 1100);
  // Counters change at the end of a turn, possibly after its answers.
  for (int wait = 0; wait < 500 && server.statistics().clients != 1100; ++wait)
    std::this_thread::sleep_for(milliseconds(20));
  CHECK(server.statistics().clients == 1100);
  CHECK(server.statistics().buffered_bytes < 4u << 20);
}

TEST_CASE(
    "when all places are taken, the longest idle client is replaced, and operators have reserved "
    "places",
    "[socket][permission]") {
  if (geteuid() != 0) {
    WARN("skipped: only root can take another user");
    return;
  }
  const TempFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms::all);
  SocketLimits limits;
  limits.clients_max = 8;
  limits.operator_places = 2;
  // Every user is in the read group here; only root may operate.
  const SocketConfig config{folder / "s", "nogroup", "root", "root"};
  SECTION("a reader finds no place while all are fresh, root does") {
    limits.replaceable_after = std::chrono::hours(1);
    StatusServer server(config, limits);
    server.add_method("status", AccessClass::read, [](const json&) { return json("good"); });
    const pid_t child = fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      if (setgroups(0, nullptr) != 0 || setgid(65534) != 0 || setuid(65534) != 0) _exit(10);
      std::vector<std::unique_ptr<RawClient>> clients;
      for (int i = 0; i < 10; ++i) clients.push_back(std::make_unique<RawClient>(folder / "s"));
      clients[0]->send(status_request);
      const bool is_served = clients[0]->line().find("good") != std::string::npos;
      const bool is_refused = clients[9]->line().find("clients already") != std::string::npos;
      clients[0]->line();  // until the parent has checked
      _exit(is_served && is_refused ? 0 : 1);
    }
    for (int i = 0; i < 2000 && server.statistics().refused < 4; ++i)
      server.handle(milliseconds(5));
    CHECK(server.statistics().refused == 4);
    RawClient root(folder / "s");
    root.send(status_request);
    for (int i = 0; i < 20; ++i) server.handle(milliseconds(5));
    CHECK(root.line().find("good") != std::string::npos);
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
  }
  SECTION("who has been idle longest goes") {
    limits.replaceable_after = milliseconds(0);
    StatusServer server(config, limits);
    server.add_method("status", AccessClass::read, [](const json&) { return json("good"); });
    std::vector<std::unique_ptr<RawClient>> clients;
    for (int i = 0; i < 9; ++i) {
      clients.push_back(std::make_unique<RawClient>(folder / "s"));
      server.handle(milliseconds(50));
      std::this_thread::sleep_for(milliseconds(2));
    }
    CHECK(clients[0]->line().find("its place is needed") != std::string::npos);
    clients[8]->send(status_request);
    for (int i = 0; i < 20; ++i) server.handle(milliseconds(5));
    CHECK(clients[8]->line().find("good") != std::string::npos);
    CHECK(server.statistics().clients == 8);
  }
}

TEST_CASE("memory of all clients is bounded: the client that holds most is closed", "[socket]") {
  const TempFolder folder;
  SocketLimits limits;
  limits.buffered_bytes_max = 200000;
  const RunningServer server(folder / "s", limits);
  std::vector<std::unique_ptr<RawClient>> clients;
  for (int i = 0; i < 10; ++i) {
    clients.push_back(std::make_unique<RawClient>(folder / "s"));
    clients.back()->send(std::string(60000, 'x'));
  }
  for (int i = 0; i < 500 && server.statistics().cut_off < 5; ++i) {
    std::this_thread::sleep_for(milliseconds(20));
  }
  CHECK(server.statistics().cut_off >= 5);
  CHECK(server.statistics().buffered_bytes <= 200000);
  StatusClient polite(folder / "s");
  CHECK(polite.call("status", {})["mode"] == "compensating");
}

TEST_CASE("requests sent before hanging up are served", "[socket]") {
  const TempFolder folder;
  const SocketConfig config{folder / "s", "no-such-1", "no-such-2", "no-such-3"};
  StatusServer server(config);
  int calls = 0;
  server.add_method("enable", AccessClass::operate, [&](const json&) { return json(++calls); });
  {
    const RawClient client(folder / "s");
    for (int i = 0; i < 7; ++i) client.send("{\"jsonrpc\":\"2.0\",\"method\":\"enable\"}\n");
  }
  for (int i = 0; i < 1000 && (calls < 7 || server.statistics().clients > 0); ++i) {
    server.handle(milliseconds(10));
  }
  CHECK(calls == 7);
  CHECK(server.statistics().clients == 0);
}

TEST_CASE("supplementary groups of the peer count", "[socket][permission]") {
  if (geteuid() != 0) {
    WARN("skipped: only root can take another user");
    return;
  }
  const TempFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms::all);
  // Groups of every Debian system replace those of the package.
  StatusServer server(SocketConfig{folder / "s", "users", "disk", "dialout"});
  server.add_method("status", AccessClass::read, [](const json&) { return json(true); });
  server.add_method("enable", AccessClass::operate, [](const json&) { return json(true); });
  server.add_method("controller_state", AccessClass::bridge,
                    [](const json&) { return json(true); });
  const auto allowed = [&](const char* group) {
    const pid_t child = fork();
    REQUIRE(child >= 0);
    if (child == 0) {
      const gid_t extra = getgrnam(group)->gr_gid;
      if (setgroups(1, &extra) != 0 || setgid(65534) != 0 || setuid(65534) != 0) _exit(100);
      int bits = 0;
      int bit = 1;
      for (const char* method : {"status", "enable", "controller_state"}) {
        RawClient client(folder / "s");
        client.send(std::string(R"({"jsonrpc":"2.0","id":1,"method":")") + method + "\"}\n");
        if (client.error_code() == 0) bits |= bit;
        bit *= 2;
      }
      _exit(bits);
    }
    int status = 0;
    while (waitpid(child, &status, WNOHANG) == 0) server.handle(milliseconds(5));
    return WEXITSTATUS(status);
  };
  CHECK(allowed("users") == 1);
  CHECK(allowed("disk") == 1 + 2);
  CHECK(allowed("dialout") == 1 + 4);
  CHECK(allowed("games") == 0);
}
