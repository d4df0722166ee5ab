#include <fstream>
#include <grp.h>
#include <random>
#include <string>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <sys/stat.h>
#include <sys/wait.h>

#include "daemon/socket/listening_socket.hpp"
#include "daemon/socket/rpc.hpp"
#include "daemon/socket/status_client.hpp"
#include "socket_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

TEST_CASE("a call is answered, with NaN as null", "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  StatusClient client(folder / "s");
  const json status = client.call("status", json::object());
  CHECK(status["mode"] == "compensating");
  CHECK(status["value_um"].is_null());
  CHECK(client.call("measured", {{"value_um", 2.5}}) == 2.5);
  CHECK(client.call("big", {}).get<std::string>().size() == 300000);
  try {
    client.call("fails", {});
    FAIL("no error");
  } catch (const RemoteError& error) {
    CHECK(error.code() == rpc::refused);
    CHECK(std::string(error.what()) == "not now");
  }
}

TEST_CASE("each kind of invalid request has its error, and the next request works", "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  RawClient client(folder / "s");
  const std::vector<std::pair<std::string, int>> requests = {
      {"nonsense", rpc::parse_error},
      {"\xff\xfe", rpc::parse_error},
      {std::string(60000, '['), rpc::parse_error},
      {std::string(R"({"jsonrpc":"2.0","id":1,"method":"status","params":{"a":)")
           .append(30000, '[')
           .append(30000, ']')
           .append("}}"),
       rpc::parse_error},
      {R"({"jsonrpc":"2.0","id":1,"method":"status","params":{"a":"\xff\xfe"}})", rpc::parse_error},
      {R"({"jsonrpc":"2.0","id":1e999,"method":"status"})", rpc::parse_error},
      {std::string(R"({"jsonrpc":"2.0","id":")").append(300, 'x').append(R"(","method":"status"})"),
       rpc::invalid_request},
      {R"({"jsonrpc":"2.0","id":[1],"method":"status"})", rpc::invalid_request},
      {R"({"jsonrpc":"2.0","id":true,"method":"status"})", rpc::invalid_request},
      {"[]", rpc::invalid_request},
      {R"([{"jsonrpc":"2.0","id":1,"method":"status"}])", rpc::invalid_request},
      {"3", rpc::invalid_request},
      {R"({"id":1,"method":"status"})", rpc::invalid_request},
      {R"({"jsonrpc":"2.0","id":1})", rpc::invalid_request},
      {R"({"jsonrpc":"2.0","id":{},"method":"status"})", rpc::invalid_request},
      {R"({"jsonrpc":"2.0","id":1,"method":7})", rpc::invalid_request},
      {R"({"jsonrpc":"2.0","id":1,"method":"nothing"})", rpc::method_not_found},
      {R"({"jsonrpc":"2.0","id":1,"method":"status","params":[1]})", rpc::invalid_params},
      {R"({"jsonrpc":"2.0","id":1,"method":"measured"})", rpc::invalid_params},
      {R"({"jsonrpc":"2.0","id":1,"method":"measured","params":{"value_um":"a"}})",
       rpc::invalid_params},
      {R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"period_s":0.01}})",
       rpc::invalid_params},
      {R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"methods":["enable"]}})",
       rpc::invalid_params},
      {R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"methods":["status","status"]}})",
       rpc::invalid_params},
      {R"({"jsonrpc":"2.0","id":1,"method":"subscribe","params":{"speed":1}})",
       rpc::invalid_params}};
  for (const auto& [text, code] : requests) {
    INFO(text.substr(0, 80));
    client.send(text + "\n");
    CHECK(client.error_code() == code);
  }
  client.send(status_request);
  CHECK(client.line().find("compensating") != std::string::npos);
}

TEST_CASE("a line that is too long ends the connection with an error", "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  RawClient client(folder / "s");
  client.send(std::string(70000, 'a'));
  CHECK(client.error_code() == rpc::invalid_request);
  CHECK(client.line().empty());
  StatusClient other(folder / "s");
  CHECK_NOTHROW(other.call("status", {}));
}

TEST_CASE("a request in pieces and one with its input closed are answered", "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  RawClient client(folder / "s");
  for (const char c : std::string(status_request)) client.send(std::string(1, c));
  CHECK(client.line().find("compensating") != std::string::npos);
  client.send(status_request);
  client.end_sending();
  CHECK(client.line().find("compensating") != std::string::npos);
  CHECK(client.line().empty());
}

TEST_CASE("a subscription sends its methods until the client disconnects", "[socket]") {
  const TempFolder folder;
  const RunningServer server(folder / "s");
  StatusClient client(folder / "s");
  client.call("subscribe", {{"methods", {"status"}}, {"period_s", 0.1}});
  for (int i = 0; i < 3; ++i) {
    const json message = client.next(seconds(10));
    CHECK(message["method"] == "status");
    CHECK(message["params"]["mode"] == "compensating");
  }
  CHECK(client.call("status", {})["mode"] == "compensating");
}

TEST_CASE("another user without the groups may do nothing", "[socket][permission]") {
  if (geteuid() != 0) {
    WARN("skipped: only root can take another user");
    return;
  }
  const TempFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms::all);
  const RunningServer server(folder / "s");
  const pid_t child = fork();
  REQUIRE(child >= 0);
  if (child == 0) {
    if (setgroups(0, nullptr) != 0 || setgid(65534) != 0 || setuid(65534) != 0) _exit(10);
    int failures = 0;
    for (const char* method : {"status", "enable", "controller_state", "subscribe", "nothing"}) {
      RawClient client(folder / "s");
      client.send(std::string("{\"jsonrpc\":\"2.0\",\"id\":1,\"method\":\"") + method + "\"}\n");
      if (client.error_code() != rpc::not_permitted) ++failures;
      if (!client.line().empty()) ++failures;  // one answer frees the place
    }
    _exit(failures);
  }
  int status = 0;
  waitpid(child, &status, 0);
  CHECK(WEXITSTATUS(status) == 0);
}

TEST_CASE("each group has its own permissions", "[socket][permission]") {
  // Groups of every Debian system replace those of the package.
  const SocketConfig config{"/s", "users", "disk", "dialout", "audio"};
  const auto gid = [](const char* name) { return getgrnam(name)->gr_gid; };
  const auto access = [&](uid_t user, std::vector<gid_t> groups) {
    return access_of({user, 65534, std::move(groups)}, 990, look_up_groups(config));
  };
  const PeerAccess reader = access(1000, {gid("users")});
  CHECK(reader == PeerAccess{.read = true});
  const PeerAccess op = access(1000, {gid("disk")});
  CHECK(op == PeerAccess{.read = true, .operate = true, .model = true});
  const PeerAccess bridge = access(1000, {gid("dialout")});
  CHECK(bridge == PeerAccess{.read = true, .bridge = true});
  const PeerAccess modeller = access(1000, {gid("audio")});
  CHECK(modeller == PeerAccess{.read = true, .model = true});
  const PeerAccess nobody = access(1000, {});
  CHECK(nobody == PeerAccess{});
  const PeerAccess own = access(990, {});
  CHECK(own == PeerAccess{.read = true});
  const PeerAccess root = access(0, {});
  CHECK(root == PeerAccess{true, true, true, true});
  const PeerAccess developer =
      access_of({1000, 1000, {}}, 1000,
                look_up_groups({"/s", "no-such-1", "no-such-2", "no-such-3", "no-such-4"}));
  CHECK(developer == PeerAccess{true, true, true, true});
}

TEST_CASE("a socket path is taken over only from a dead daemon", "[socket]") {
  const TempFolder folder;
  const std::filesystem::path path = folder / "s";
  SECTION("a second daemon is refused") {
    const RunningServer server(path);
    CHECK_THROWS_WITH(
        StatusServer(SocketConfig{path, "a", "b", "c"}),
        Catch::Contains("process " + std::to_string(getpid()) + " listens there already"));
    StatusClient client(path);
    CHECK_NOTHROW(client.call("status", {}));
  }
  SECTION("a file left by a dead daemon is replaced") {
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::strncpy(address.sun_path, path.c_str(), sizeof address.sun_path - 1);
    REQUIRE(bind(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0);
    close(fd);
    const RunningServer server(path);
    StatusClient client(path);
    CHECK_NOTHROW(client.call("status", {}));
  }
  SECTION("another file is left alone") {
    std::ofstream(path) << "text";
    CHECK_THROWS_WITH(StatusServer(SocketConfig{path, "a", "b", "c"}),
                      Catch::Contains("not a socket"));
    CHECK(std::filesystem::file_size(path) == 4);
  }
  SECTION("the file goes when the daemon ends") {
    { const RunningServer server(path); }
    CHECK_FALSE(std::filesystem::exists(path));
    CHECK_THROWS_WITH(StatusClient(path), Catch::Contains("no daemon at"));
  }
}

TEST_CASE("of daemons started at once exactly one has the socket", "[socket]") {
  const TempFolder folder;
  const SocketConfig config{folder / "s", "a", "b", "c"};
  std::atomic<int> listening{0};
  std::vector<std::unique_ptr<StatusServer>> servers(8);
  std::vector<std::thread> threads;
  for (auto& server : servers) {
    threads.emplace_back([&] {
      try {
        server = std::make_unique<StatusServer>(config);
        ++listening;
      } catch (const SocketError&) {
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  CHECK(listening == 1);
}

TEST_CASE("the dispatcher answers bytes without a socket", "[socket]") {
  RpcDispatcher rig(SocketConfig{});
  rig.add_method("status", AccessClass::read, [](const json&) { return json("good"); });
  const PeerAccess reader{true, false, false};
  const auto answered = [&](const char* line) {
    return json::parse(rig.answer(reader, line).text, nullptr, false);
  };
  CHECK(answered(R"({"jsonrpc":"2.0","id":"a","method":"status"})")["result"] == "good");
  CHECK(answered(R"({"jsonrpc":"2.0","id":-1.5,"method":"status"})")["id"] == -1.5);
  CHECK(answered(R"({"jsonrpc":"2.0","id":null,"method":"status"})")["result"] == "good");
  CHECK(rig.answer(reader, R"({"jsonrpc":"2.0","method":"status"})").text.empty());
  CHECK(rig.answer(reader, R"({"jsonrpc":"2.0","method":"nothing"})").text.empty());
  CHECK_FALSE(rig.answer(reader, R"({"jsonrpc":"2.0"})").text.empty());
  CHECK(rig.answer({}, R"({"jsonrpc":"2.0","id":1,"method":"status"})").is_error);
}
