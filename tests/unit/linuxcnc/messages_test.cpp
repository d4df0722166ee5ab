// Tests of the lines between bridge and daemon.
#include "linuxcnc/messages.hpp"

#include <cmath>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

using namespace thermocomp_linuxcnc;
using nlohmann::json;

namespace {

MachineView machine() {
  MachineView view;
  view.taking = view.homed = true;
  view.motion_type = 2;
  view.mist = true;
  view.spindle_rpm = -3000.0;
  view.axes = {{0.0105, 0.0105, 100.0}, {NAN, 0.0, -5.0}};
  return view;
}

std::string answer_line(const json& offsets, std::uint64_t id = 3) {
  const json result = {
      {"epoch", 1}, {"anew", false}, {"mode", "compensating"}, {"offsets_um", offsets}};
  return json{{"jsonrpc", "2.0"}, {"id", id}, {"result", result}}.dump();
}

}  // namespace

TEST_CASE("a request contains every value in the daemon's units", "[linuxcnc]") {
  const std::string line = request_line(77, 3, "xz", machine());
  CHECK(line.back() == '\n');
  const json request = json::parse(line);
  CHECK(request["method"] == "controller_state");
  CHECK(request["id"] == 3);
  const json& params = request["params"];
  CHECK(params["session"] == 77);
  CHECK(params["taking"] == true);
  CHECK(params["applied_um"]["x"].get<double>() == Approx(10.5));
  CHECK(params["applied_um"]["z"].is_null());
  CHECK(params["signals"] == json{{"x_mm", 100.0},
                                  {"z_mm", -5.0},
                                  {"spindle_rpm", -3000.0},
                                  {"coolant_on", 1},
                                  {"cutting_on", 1},
                                  {"enabled_on", 0},
                                  {"homed_on", 1}});
}

TEST_CASE("a cut is a feed, or any motion in a program except rapids and tool changes",
          "[linuxcnc]") {
  const auto cuts = [](bool program, MotionType type) {
    MachineView view;
    view.program_running = program;
    view.motion_type = static_cast<int>(type);
    return in_cut(view);
  };
  CHECK(cuts(false, MotionType::feed));
  CHECK(cuts(false, MotionType::arc));
  CHECK(cuts(false, MotionType::probe));
  CHECK_FALSE(cuts(false, MotionType::none));
  CHECK_FALSE(cuts(false, MotionType::rapid));
  CHECK(cuts(true, MotionType::none));  // a dwell, a feed hold
  CHECK(cuts(true, MotionType::arc));
  CHECK_FALSE(cuts(true, MotionType::rapid));
  CHECK_FALSE(cuts(true, MotionType::tool_change));
}

TEST_CASE("an answer gives offsets in mm", "[linuxcnc]") {
  const Answer answer = read_answer(answer_line({{"x", 12.5}, {"z", nullptr}}), 3, "xyz", 0.2);
  CHECK_FALSE(answer.anew);
  CHECK(answer.mode == "compensating");
  REQUIRE(answer.offset_mm.size() == 3);
  CHECK(*answer.offset_mm[0] == Approx(0.0125));
  CHECK_FALSE(answer.offset_mm[1]);  // not in the daemon's configuration
  CHECK_FALSE(answer.offset_mm[2]);
}

TEST_CASE("an answer that must not be used is refused", "[linuxcnc]") {
  std::string deep;
  for (int i = 0; i < 100000; ++i) deep += "[";
  const std::vector<std::string> bad = {
      "",
      "nonsense",
      "[]",
      "{}",
      deep,
      "{\"id\":3}",
      "{\"id\":3,\"result\":7}",
      "{\"id\":3,\"result\":{\"anew\":1,\"mode\":\"m\",\"offsets_um\":{}}}",
      "{\"id\":3,\"result\":{\"anew\":true,\"mode\":2,\"offsets_um\":{}}}",
      "{\"id\":3,\"result\":{\"anew\":true,\"mode\":\"m\",\"offsets_um\":[1]}}",
      "{\"id\":3,\"error\":{\"code\":-32001,\"message\":\"not permitted\"}}",
      "{\"id\":3,\"error\":{\"message\":[]}}",
      answer_line({{"x", "1"}}),
      answer_line({{"x", true}}),
      answer_line({{"x", 200.1}}),
      answer_line({{"x", -200.1}}),
      answer_line({{"x", 1e308}}),
      answer_line({{"x", 1.0}}, 4),
  };
  for (const std::string& line : bad) {
    INFO(line.substr(0, 100));
    CHECK_THROWS_AS(read_answer(line, 3, "x", 0.2), BadAnswer);
  }
  CHECK_NOTHROW(read_answer(answer_line({{"x", 200.0}}), 3, "x", 0.2));
}

TEST_CASE(
    "brackets in a string do not hide nesting, and the daemon's text cannot control a terminal",
    "[linuxcnc]") {
  std::string hidden = R"({"a":")";
  hidden.append(400000, ']').append(R"(","id":3,"result":)");
  hidden.append(400000, '[').append(400000, ']').append("}");
  CHECK_THROWS_WITH(read_answer(hidden, 3, "x", 0.2), Catch::Contains("no JSON object"));
  const std::string words = std::string(100, '[') + "\\\"";
  CHECK_NOTHROW(read_answer(
      R"({"id":3,"note":")" + words + R"(","result":{"anew":true,"mode":"m","offsets_um":{}}})", 3,
      "x", 0.2));
  CHECK_THROWS_WITH(
      read_answer(R"({"id":3,"error":{"message":"\u001b]0;x\u0007 \u202e!"}})", 3, "x", 0.2),
      Catch::EndsWith(" ]0;x     !"));
}
