// Texts of events, and the exit status of `status`.
#include "status/event.hpp"

#include <catch2/catch.hpp>

#include "status/verdict.hpp"

namespace {

using namespace thermocomp;
using Words = std::vector<std::string>;

Status compensating() {
  Status status{.mode = Mode::compensating};
  status.axes = {{.name = "z", .driven = true}};
  return status;
}

}  // namespace

TEST_CASE("each kind of event has its text", "[status][events]") {
  Event fault{
      .kind = EventKind::fault, .subject = {SubjectKind::sensor, "bed"}, .code = "no_answer"};
  CHECK(event_text(fault) == "sensor bed: the unit does not answer");
  fault.kind = EventKind::recovery;
  fault.duration_s = 28.04;
  CHECK(event_text(fault) ==
        "sensor bed: the unit does not answer: over, lasted 28.0 s with confirmation");
  fault.value = -4.31;
  CHECK(
      event_text(fault) ==
      "sensor bed: the unit does not answer: over, lasted 28.0 s with confirmation, -4.3 K since");
  const Event mode{.kind = EventKind::mode,
                   .subject = {SubjectKind::nothing, "compensating"},
                   .code = "holding",
                   .duration_s = 3725.0};
  CHECK(event_text(mode) == "compensating -> holding, after 1 h 2 min");
  CHECK(event_text({.kind = EventKind::mode, .code = "starting"}) == "starting");
  Event command{.kind = EventKind::command,
                .subject = {SubjectKind::axis, "z"},
                .code = "measured",
                .value = 3.0};
  CHECK(event_text(command) == "measured z 3 um");
  command.user = 0;
  CHECK(event_text(command) == "measured z 3 um, by root");
  command.asked_for = "maria";
  CHECK(event_text(command) == "measured z 3 um, by root for maria");
  CHECK(event_text({.kind = EventKind::fault,
                    .subject = {SubjectKind::reason, "controller_offline"},
                    .code = "controller_offline"}) == "the controller cannot be read");
  CHECK(event_text({.kind = EventKind::fault,
                    .subject = {SubjectKind::suspected_sensor, "bed"},
                    .code = "suspected",
                    .value = 2.04}) ==
        "suspected sensor bed: off by +2.0 K against its neighbours");
  CHECK(event_text({.kind = EventKind::fault,
                    .subject = {SubjectKind::bus_errors, "body"},
                    .code = "passive"}) == "bus body, errors: error state passive");
  const std::string lines = events_text({mode, command});
  CHECK_THAT(lines, Catch::Contains("  mode      compensating -> holding"));
  CHECK(lines.find("holding") < lines.find("measured"));
  CHECK(events_text({}) == "no events\n");
}

TEST_CASE("a run that was not stopped is reported at the start of the next", "[status][events]") {
  const Event started{.code = "started", .detail = "1"};
  const Event stopping{.code = "stopping", .detail = "SIGTERM"};
  const Event mode{.kind = EventKind::mode, .code = "holding"};
  CHECK_THAT(events_text({started, mode, started}),
             Catch::EndsWith("started, version 1; the run before was not stopped: killed, "
                             "or the power failed\n"));
  const std::string stopped = events_text({started, stopping, mode, started});
  CHECK_THAT(stopped, !Catch::Contains("was not stopped"));
  CHECK_THAT(stopped, Catch::Contains("stopping: SIGTERM"));
}

TEST_CASE("an event's text has no terminal control codes", "[status][events]") {
  CHECK(event_text({.code = "a\033[31mb"}).find('\033') == std::string::npos);
  CHECK_NOTHROW(events_text({{.wall_s = 1e300, .user = -7}}));
}

TEST_CASE("status reports why it exits with 1, with --strict also degradations", "[status]") {
  CHECK(why_not(compensating(), true).empty());
  Status holding = compensating();
  holding.mode = Mode::holding;
  holding.reasons = static_cast<std::uint32_t>(Reason::block_lost);
  CHECK(why_not(holding, false) == Words{"mode holding", "block_lost"});
  using Change = void (*)(Status&);
  const std::vector<std::pair<Change, const char*>> degraded = {
      {[](Status& all) { all.axes[0].at_bound = true; }, "axis z is at its bound"},
      {[](Status& all) { all.axes[0].disagrees = true; }, "axis z: the read-back disagrees"},
      {[](Status& all) { all.sensors_bad = {"bed"}; }, "sensor bed is bad"},
      {[](Status& all) { all.reasons = static_cast<std::uint32_t>(Reason::block_estimated); },
       "block_estimated"},
      {[](Status& all) { all.buses = {{.name = "cabinet"}}; }, "bus cabinet is not connected"},
      {[](Status& all) { all.history.enabled = true; }, "the history is not written"},
  };
  for (const auto& [change, why] : degraded) {
    INFO(why);
    Status status = compensating();
    change(status);
    CHECK(why_not(status, false).empty());
    CHECK(why_not(status, true) == Words{why});
  }
  Status cutting = compensating();
  cutting.reasons = static_cast<std::uint32_t>(Reason::cutting);
  CHECK(why_not(cutting, true).empty());
}

TEST_CASE("status exits with 1 for a reason of severity fault in any mode", "[status]") {
  Status status = compensating();
  status.reasons = static_cast<std::uint32_t>(Reason::sensor_unconfirmed);
  CHECK(why_not(status, false) == Words{"sensor_unconfirmed"});
}
