// Delayed answers: which clients wait, and the order of answers.
#include <catch2/catch.hpp>

#include "socket_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

std::string request(int id, const std::string& method, const std::string& params = "{}") {
  std::string text(R"({"jsonrpc":"2.0","id":)");
  text.append(std::to_string(id)).append(R"(,"method":")").append(method);
  return text.append(R"(","params":)").append(params).append("}\n");
}

void wait_until_asked(const RunningServer& server) {
  for (int i = 0; i < 10000 && server.asked() < 3; ++i)
    std::this_thread::sleep_for(milliseconds(1));
  REQUIRE(server.asked() >= 3);
}

}  // namespace

TEST_CASE("while one client waits for a slow answer the others are served", "[socket]") {
  const TempFolder folder;
  RunningServer server(folder / "s");
  RawClient waiting(folder / "s");
  RawClient other(folder / "s");
  waiting.send(request(1, "slow"));
  wait_until_asked(server);
  for (int i = 0; i < 20; ++i) {
    other.send(status_request);
    CHECK(json::parse(other.line())["result"]["mode"] == "compensating");
  }
  server.let_go();
  CHECK(json::parse(waiting.line()) == json{{"jsonrpc", "2.0"}, {"id", 1}, {"result", "late"}});
}

TEST_CASE("requests sent during a slow answer are answered afterwards, in order", "[socket]") {
  const TempFolder folder;
  RunningServer server(folder / "s");
  RawClient client(folder / "s");
  client.send(request(1, "slow") + request(2, "status") + request(3, "slow", R"({"fails":1})"));
  client.end_sending();
  wait_until_asked(server);
  server.let_go();
  CHECK(json::parse(client.line())["result"] == "late");
  CHECK(json::parse(client.line())["id"] == 2);
  const json last = json::parse(client.line());
  CHECK(last["id"] == 3);
  CHECK(last["error"]["message"] == "not now");
  CHECK(client.line().empty());
}

TEST_CASE("a client that disconnects during a slow answer is dropped", "[socket]") {
  const TempFolder folder;
  RunningServer server(folder / "s");
  {
    RawClient client(folder / "s");
    client.send(request(1, "slow"));
    wait_until_asked(server);
  }
  server.let_go();
  RawClient next(folder / "s");
  for (int i = 0; i < 10000 && server.statistics().clients != 1; ++i)
    std::this_thread::sleep_for(milliseconds(1));
  next.send(status_request);
  CHECK(json::parse(next.line())["id"] == 1);
  CHECK(server.statistics().clients == 1);
}

TEST_CASE("a client that waits for an answer is not idle", "[socket]") {
  const TempFolder folder;
  SocketLimits limits;
  limits.idle_max = limits.partial_line_max = milliseconds(200);
  RunningServer server(folder / "s", limits);
  RawClient client(folder / "s");
  client.send(request(1, "slow") + R"({"jsonrpc")");
  std::this_thread::sleep_for(seconds(1));
  server.let_go();
  CHECK(json::parse(client.line())["result"] == "late");
}
