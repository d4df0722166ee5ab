#include "gateway/alarms/alarm_watch.hpp"

#include <catch2/catch.hpp>

#include "gateway/texts/mqtt_texts.hpp"

using namespace thermocomp;
using namespace thermocomp::gateway;

namespace {

const std::vector<AlarmCondition> lost{{"sensor/a", "sensor a: broken", "mend it"}};
const std::vector<AlarmCondition> nothing;

Snapshot good_snapshot() {
  Snapshot snapshot;
  snapshot.is_here = true;
  snapshot.status = {.mode = Mode::compensating, .mode_since_s = 5.0};
  snapshot.status.axes = {{.name = "z", .driven = true}};
  snapshot.status.buses = {{.name = "cabinet", .connected = true}};
  snapshot.status.model.outside = false;
  snapshot.sensors.sensors = {{.name = "a", .fault = Fault::none}};
  return snapshot;
}

std::vector<std::string> names(const std::vector<AlarmCondition>& wrong) {
  std::vector<std::string> list;
  for (const AlarmCondition& condition : wrong) list.push_back(condition.name);
  return list;
}

}  // namespace

TEST_CASE("a lasting condition raises and clears its alarm once", "[gateway][alarm]") {
  AlarmWatch watch(10.0, 60.0);
  CHECK(watch.update(0.0, lost, true).empty());
  CHECK(watch.update(9.9, lost, true).empty());
  const auto raised = watch.update(10.0, lost, true);
  REQUIRE(raised.size() == 1);
  CHECK(raised[0].is_raised);
  CHECK(raised[0].alarm.condition.text == "sensor a: broken");
  CHECK(raised[0].alarm.since_s == 0.0);
  CHECK(watch.update(11.0, lost, true).empty());
  CHECK(watch.update(20.0, nothing, true).empty());
  CHECK(watch.active().size() == 1);
  CHECK(watch.update(79.9, nothing, true).empty());
  const auto cleared = watch.update(80.0, nothing, true);
  REQUIRE(cleared.size() == 1);
  CHECK_FALSE(cleared[0].is_raised);
  CHECK(watch.active().empty());
}

TEST_CASE("an intermittent condition raises at most one alarm", "[gateway][alarm]") {
  AlarmWatch watch(3.0, 10.0);
  std::size_t changes = 0;
  for (int s = 0; s < 1000; ++s)
    changes += watch.update(s, (s % 6) < 4 ? lost : nothing, true).size();
  CHECK(changes == 1);
  AlarmWatch never(3.0, 10.0);
  for (int s = 0; s < 1000; ++s) CHECK(never.update(s, s % 2 == 0 ? lost : nothing, true).empty());
}

TEST_CASE("alarms keep their state while the daemon is away", "[gateway][alarm]") {
  AlarmWatch watch(1.0, 1.0);
  watch.update(0.0, lost, true);
  CHECK(watch.update(1.0, lost, true).size() == 1);
  const std::vector<AlarmCondition> away{{"daemon", "away", ""}};
  watch.update(2.0, away, false);
  CHECK(watch.update(100.0, away, false).size() == 1);
  CHECK(watch.active().size() == 2);
  watch.update(101.0, lost, true);
  const auto back = watch.update(103.0, lost, true);
  REQUIRE(back.size() == 1);
  CHECK(back[0].alarm.condition.name == "daemon");
}

TEST_CASE("each condition raises its own alarm", "[gateway][alarm]") {
  Snapshot snapshot = good_snapshot();
  CHECK(active_conditions(snapshot).empty());
  snapshot.status.axes[0].at_bound = true;
  snapshot.status.buses[0].connected = false;
  snapshot.status.model.outside = true;
  snapshot.status.mode = Mode::holding;
  snapshot.status.reasons = static_cast<std::uint32_t>(Reason::block_lost);
  snapshot.status.modules_frozen = {{"m1", 75.0}};
  snapshot.sensors.sensors[0].fault = Fault::open_circuit;
  snapshot.sensors.sensors[0].suspected = {.size_K = 2.0, .since = 1.0};
  const auto wrong = active_conditions(snapshot);
  CHECK(names(wrong) == std::vector<std::string>{"compensation", "bus/cabinet", "sensor/a",
                                                 "suspected/a", "frozen/m1", "bound/z", "domain"});
  for (const AlarmCondition& condition : wrong) {
    CHECK_FALSE(condition.text.empty());
    CHECK_FALSE(condition.remedy.empty());
  }
  snapshot.is_here = false;
  CHECK(names(active_conditions(snapshot)) == std::vector<std::string>{"daemon"});
}

TEST_CASE("a disconnected bus or silent module raises one alarm, not one per sensor",
          "[gateway][alarm]") {
  Snapshot snapshot = good_snapshot();
  snapshot.sensors.sensors[0].fault = Fault::no_answer;
  CHECK(names(active_conditions(snapshot)) == std::vector<std::string>{"sensor/a"});
  snapshot.status.buses[0].units = {{.name = "module", .answering = false, .sensors = {"a", "b"}}};
  const auto wrong = active_conditions(snapshot);
  REQUIRE(names(wrong) == std::vector<std::string>{"unit/module"});
  CHECK(wrong[0].text == "module on cabinet does not answer: without sensors a, b");
  snapshot.status.buses[0].connected = false;
  CHECK(names(active_conditions(snapshot)) == std::vector<std::string>{"bus/cabinet"});
}

TEST_CASE("values not yet confirmed at start-up raise no alarm", "[gateway][alarm]") {
  Snapshot snapshot = good_snapshot();
  snapshot.status.mode = Mode::starting;
  snapshot.sensors.sensors[0].fault = Fault::unconfirmed;
  CHECK(active_conditions(snapshot).empty());
  snapshot.sensors.sensors[0].jump = Jump{.size_K = 18.0};
  snapshot.status.sensors_bad = {"a"};
  CHECK(names(active_conditions(snapshot)) == std::vector<std::string>{"compensation", "sensor/a"});
}

TEST_CASE("a start that does not end raises an alarm, and one that begins clears none",
          "[gateway][alarm]") {
  Snapshot snapshot = good_snapshot();
  snapshot.status.mode = Mode::starting;
  snapshot.status.reasons = static_cast<std::uint32_t>(Reason::controller_offline);
  snapshot.status.mode_since_s = 50.0;
  CHECK(active_conditions(snapshot).empty());
  CHECK_FALSE(is_judged(snapshot));
  snapshot.status.mode_since_s = 61.0;
  CHECK(names(active_conditions(snapshot)) == std::vector<std::string>{"compensation"});
  CHECK(is_judged(snapshot));
  // Raised before a restart of the daemon, it stays; one that nobody sees is not raised.
  AlarmWatch watch(2.0, 2.0);
  const auto raised = active_conditions(snapshot);
  CHECK(watch.update(0.0, raised, true).empty());
  CHECK(watch.update(1.0, {}, false).empty());
  CHECK(watch.update(3.0, {}, false).empty());
  CHECK(watch.update(4.0, raised, true).size() == 1);
  CHECK(watch.update(20.0, {}, false).empty());
  CHECK(watch.active().size() == 1);
  static_cast<void>(watch.update(21.0, {}, true));
  CHECK(watch.update(24.0, {}, true).size() == 1);
  Confirmation slow;
  slow.settle_s = 120.0;
  snapshot.status.confirming = {slow};
  CHECK(active_conditions(snapshot).empty());
}

TEST_CASE("alarm commands are limited per hour", "[gateway][alarm]") {
  HookLimit limit(2);
  CHECK(limit.take(0.0));
  CHECK(limit.take(1.0));
  CHECK_FALSE(limit.take(3599.0));
  CHECK(limit.take(3600.0));
  CHECK_FALSE(limit.take(3600.5));
}

TEST_CASE("a full buffer keeps the newest messages, and the last of each topic",
          "[gateway][mqtt]") {
  MessageBuffer buffer(3);
  buffer.push({"rare", "r"});
  for (int i = 0; i < 5; ++i) buffer.push({"often", std::to_string(i)});
  CHECK(buffer.size() == 3);
  CHECK(buffer.dropped() == 3);
  buffer.repeat_newest();
  std::string taken;
  while (const auto message = buffer.take()) taken += message->topic + message->payload + " ";
  CHECK(taken == "often2 often3 often4 often4 rarer ");
}

TEST_CASE("a dry run raises no alarm, a held dry run does", "[gateway][alarm]") {
  Snapshot snapshot = good_snapshot();
  snapshot.status.dry_run = true;
  CHECK(active_conditions(snapshot).empty());
  snapshot.status.mode = Mode::holding;
  CHECK(names(active_conditions(snapshot)) == std::vector<std::string>{"compensation"});
}
