// Events as lines for a person, and the exit status of `status`.
#include "cli/observe/events_text.hpp"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "cli/observe/status_text.hpp"

namespace {

using nlohmann::json;
using thermocomp::cli::event_text;
using thermocomp::cli::events_text;
using thermocomp::cli::status_text;
using thermocomp::cli::why_not;
using Words = std::vector<std::string>;

json event(const char* kind, const char* subject, const char* what) {
  return {{"number", 1},  {"wall_s", 1.7e9},       {"kind", kind},   {"subject", subject},
          {"what", what}, {"duration_s", nullptr}, {"user", nullptr}};
}

json compensating() {
  return {{"mode", "compensating"},
          {"reasons", json::array()},
          {"axes", {{{"name", "z"}, {"driven", true}}}}};
}

}  // namespace

TEST_CASE("each kind of event has its words", "[cli][events]") {
  json fault = event("fault", "sensor bed", "no_answer");
  CHECK(event_text(fault) == "sensor bed: the unit does not answer");
  fault["kind"] = "recovery";
  fault["duration_s"] = 28.04;
  CHECK(event_text(fault) == "sensor bed: the unit does not answer: over, lasted 28.0 s");
  json mode = event("mode", "compensating", "holding");
  mode["duration_s"] = 3725.0;
  CHECK(event_text(mode) == "compensating -> holding, after 1 h 2 min");
  CHECK(event_text(event("mode", "", "starting")) == "starting");
  json command = event("command", "", "measured z 3 um");
  CHECK(event_text(command) == "measured z 3 um");
  command["user"] = 0;
  CHECK(event_text(command) == "measured z 3 um, by root");
  CHECK(event_text(event("fault", "reason controller_offline", "controller_offline")) !=
        "reason controller_offline: controller_offline");
  const std::string lines = events_text({{"events", {mode, command}}});
  CHECK_THAT(lines, Catch::Contains("  mode      compensating -> holding"));
  CHECK(lines.find("holding") < lines.find("measured"));
  CHECK(events_text({{"events", json::array()}}) == "nothing has happened\n");
}

TEST_CASE("a run that nobody stopped is named at the start of the next", "[cli][events]") {
  const auto said = [](const char* what) { return json{{"kind", "daemon"}, {"what", what}}; };
  const json mode{{"kind", "mode"}, {"what", "holding"}};
  const std::string killed =
      events_text({{"events", {said("started, version 1"), mode, said("started, version 1")}}});
  CHECK_THAT(killed, Catch::EndsWith("started, version 1; the run before was not stopped: killed, "
                                     "or the power failed\n"));
  const std::string stopped = events_text({{"events",
                                            {said("started, version 1"), said("stopping: SIGTERM"),
                                             mode, said("started, version 1")}}});
  CHECK_THAT(stopped, !Catch::Contains("was not stopped"));
}

TEST_CASE("an answer of another shape is not trusted", "[cli][events]") {
  CHECK_NOTHROW(events_text({{"events", {1, "x", nullptr, {{"wall_s", 1e300}, {"user", -7}}}}}));
  CHECK_NOTHROW(events_text(json::array()));
  CHECK(event_text(event("command", "", "a\033[31mb")).find('\033') == std::string::npos);
}

TEST_CASE("an outage that is over is seen in the status", "[cli][status]") {
  json status = compensating();
  json over = event("recovery", "bus cabinet", "refused");
  over["duration_s"] = 28.0;
  status["ended"] = {over};
  CHECK_THAT(status_text(status, false),
             Catch::Contains("Lately          : bus cabinet: refused: over, lasted 28.0 s"));
}

TEST_CASE("status says why it exits with 1, with --strict also for what is degraded",
          "[cli][status]") {
  CHECK(why_not(compensating(), true).empty());
  json status = compensating();
  status["mode"] = "holding";
  status["reasons"] = {"block_lost"};
  CHECK(why_not(status, false) == Words{"mode holding", "block_lost"});
  const std::vector<std::pair<json, const char*>> degraded = {
      {{{"axes", {{{"name", "z"}, {"driven", true}, {"at_bound", true}}}}},
       "axis z is at its bound"},
      {{{"axes", {{{"name", "z"}, {"driven", true}, {"disagrees", true}}}}},
       "axis z: the read-back disagrees"},
      {{{"sensors_bad", {"bed"}}}, "sensor bed is bad"},
      {{{"reasons", {"block_estimated"}}}, "block_estimated"},
      {{{"buses", {{{"name", "cabinet"}, {"connected", false}}}}}, "bus cabinet is not connected"},
      {{{"history", {{"enabled", true}, {"working", false}}}}, "the history is not written"},
  };
  for (const auto& [part, why] : degraded) {
    INFO(why);
    status = compensating();
    status.update(part);
    CHECK(why_not(status, false).empty());
    CHECK(why_not(status, true) == Words{why});
  }
  status = compensating();
  status["reasons"] = {"cutting"};
  CHECK(why_not(status, true).empty());
}
