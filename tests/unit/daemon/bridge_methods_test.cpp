// The method `controller_state`: accepted and refused reports, and the answers.
#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "daemon/methods/methods.hpp"
#include "daemon/socket/rpc.hpp"

using namespace thermocomp;
using nlohmann::json;

namespace {

struct Rig {
  Rig() : bridge(config) { bridge.start(); }
  json answer(const json& params) { return answer_bridge(bridge, config, "compensating", params); }

  BridgeControllerConfig config{"mill", 1.0, {"x"}, {"x_mm", "cutting_on"}};
  BridgeController bridge;
};

json report() {
  return {{"session", 5},
          {"taking", true},
          {"applied_um", {{"x", 2.5}, {"y", 1.0}}},
          {"signals", {{"x_mm", 10.0}, {"cutting_on", 1}, {"coolant_on", 0}}}};
}

}  // namespace

TEST_CASE("a report becomes the controller's state and is answered", "[daemon][bridge]") {
  Rig rig;
  const json answer = rig.answer(report());
  CHECK(answer["anew"] == true);
  CHECK(answer["epoch"] == 1);
  CHECK(answer["mode"] == "compensating");
  CHECK(answer["offsets_um"] == json{{"x", nullptr}});
  ControllerState state;
  rig.bridge.newest(state);
  CHECK(state.applied_um[0] == 2.5);
  CHECK(state.signals[1] == 1.0);
  OffsetCommand command;
  command.link_epoch = 1;
  command.read_back_number = 1;
  command.valid[0] = true;
  command.offset_um[0] = 2.75;
  rig.bridge.offer(command);
  CHECK(rig.answer(report())["offsets_um"]["x"] == 2.75);
}

TEST_CASE("null means unknown", "[daemon][bridge]") {
  Rig rig;
  json reported = report();
  reported["signals"]["x_mm"] = nullptr;
  rig.answer(reported);
  ControllerState state;
  rig.bridge.newest(state);
  CHECK(std::isnan(state.signals[0]));
  CHECK(state.signals[1] == 1.0);
}

TEST_CASE("an invalid report is refused, counted and has no effect", "[daemon][bridge]") {
  const auto broken = [](const char* pointer, const json& value) {
    json reported = report();
    reported[json::json_pointer(pointer)] = value;
    return reported;
  };
  Rig rig;
  std::vector<json> bad = {
      json::object(),
      broken("/session", 0),
      broken("/session", -1),
      broken("/session", 1.5),
      broken("/session", "5"),
      broken("/taking", 1),
      broken("/applied_um", json::array({1.0})),
      broken("/applied_um", {{"y", 1.0}}),
      broken("/applied_um/x", "2.5"),
      broken("/applied_um/x", 1e300),
      broken("/applied_um/x", json::array()),
      broken("/applied_um/y", true),
      broken("/signals", nullptr),
      broken("/signals", {{"x_mm", 1.0}}),
      broken("/signals/coolant_on", -1e10),
      broken("/more", 1),
  };
  for (const json& reported : bad) {
    INFO(reported.dump());
    CHECK_THROWS_AS(rig.answer(reported), RpcError);
  }
  CHECK(rig.bridge.health().read_errors == bad.size());
  CHECK(rig.bridge.health().reads == 0);
  ControllerState state;
  rig.bridge.newest(state);
  CHECK_FALSE(state.online);
}

TEST_CASE("a second bridge is refused", "[daemon][bridge]") {
  Rig rig;
  rig.answer(report());
  json other = report();
  other["session"] = 6;
  CHECK_THROWS_WITH(rig.answer(other), "another bridge is reporting");
}
