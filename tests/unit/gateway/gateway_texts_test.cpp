#include <cmath>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>

#include "gateway/feed/page_state.hpp"
#include "gateway/feed/snapshot.hpp"
#include "gateway/texts/metrics_text.hpp"
#include "gateway/texts/mqtt_texts.hpp"
#include "gateway/texts/shdr_text.hpp"

using namespace thermocomp;
using namespace thermocomp::gateway;
using Catch::Contains;
using nlohmann::json;

namespace {

Snapshot snapshot_of_two_axes() {
  Snapshot snapshot;
  snapshot.is_here = true;
  snapshot.wall_s = 1772353800.125;
  snapshot.status = {.mode = Mode::compensating, .mode_since_s = 60.0, .version = "0.1\"x"};
  snapshot.status.axes = {
      {.name = "z", .unit = "um", .displacement = 3.5, .offset = -3.5, .driven = true},
      {.name = "b", .unit = "urad", .offset = 4.0, .driven = true}};
  snapshot.status.buses = {{.name = "cabinet", .kind = "can", .connected = true}};
  snapshot.sensors.sensors = {{.name = "bed front",
                               .blocks = {"bed"},
                               .raw_degC = 21.25,
                               .smoothed_degC = 21.5,
                               .fault = Fault::none}};
  return snapshot;
}

}  // namespace

TEST_CASE("metrics are in base units; unknown values have no sample", "[gateway][metrics]") {
  const std::string text = metrics_text(snapshot_of_two_axes(), {});
  CHECK_THAT(text, Contains("thermocomp_up 1\n"));
  CHECK_THAT(text, Contains("thermocomp_axis_offset_meters{axis=\"z\"} -3.5e-06\n"));
  CHECK_THAT(text, Contains("thermocomp_axis_offset_radians{axis=\"b\"} 4e-06\n"));
  CHECK_THAT(text, !Contains("thermocomp_axis_displacement_radians{axis=\"b\"}"));
  CHECK_THAT(
      text,
      Contains("thermocomp_sensor_temperature_celsius{sensor=\"bed front\",block=\"bed\"} 21.5\n"));
  CHECK_THAT(text, Contains("thermocomp_build_info{version=\"0.1\\\"x\"} 1\n"));
  CHECK_THAT(text, !Contains(" nan"));
}

TEST_CASE("series end while the daemon is away", "[gateway][metrics]") {
  Snapshot snapshot = snapshot_of_two_axes();
  snapshot.is_here = false;
  const std::string text = metrics_text(snapshot, {});
  CHECK_THAT(text, Contains("thermocomp_up 0\n"));
  CHECK_THAT(text, !Contains("thermocomp_axis"));
}

TEST_CASE("metrics of any answer are lines of the format", "[gateway][metrics]") {
  Snapshot odd;
  odd.is_here = true;
  odd.status.axes = {{}, {.name = "a\\\"\nb", .unit = "x\ny", .offset = 1.0}};
  odd.status.version = "\n";
  odd.sensors.sensors = {{.name = "a\\\"\nb", .blocks = {"\"", "\n"}, .smoothed_degC = 1.0}};
  const std::regex line(
      R"re((# (HELP|TYPE) [^\n]*|[a-z_]+(\{([a-z_]+="([^"\\\n]|\\["\\n])*",?)*\})? [-+0-9.e]+))re");
  std::istringstream lines(metrics_text(odd, {}));
  for (std::string each; std::getline(lines, each);) {
    INFO(each);
    CHECK(std::regex_match(each, line));
  }
}

TEST_CASE("topic names contain no MQTT special characters", "[gateway][mqtt]") {
  CHECK(topic_of("mill", "sensor", "bed front/+#") ==
        "thermocomp/mill/sensor/bed_0x20front_0x2F_0x2B_0x23");
  CHECK(topic_of("mill", "status") == "thermocomp/mill/status");
  CHECK(utc_text(1772353800.125) == "2026-03-01T08:30:00.125Z");
  CHECK(utc_text(std::nan("")) == "1970-01-01T00:00:00.000Z");
  const auto states = topic_states(snapshot_of_two_axes(), "mill");
  REQUIRE(states.size() == 4);
  CHECK(states[2].state["offset_um"] == -3.5);
  CHECK(states[3].state["offset_urad"] == 4.0);
}

TEST_CASE("topic names are unique and depend on the name only", "[gateway][names]") {
  CHECK(item_name("temp", "bed_front2") == "temp_bed_front2");
  CHECK(item_name("temp", "a b") == "temp_a_0x20b");
  CHECK(topic_of("mill", "sensor", "床前") == "thermocomp/mill/sensor/床前");
  // All short names of characters that could collide.
  const std::string alphabet = "_0x2A /\xE5";
  std::vector<std::string> names{""};
  for (std::size_t i = 0; names.size() < 60000; ++i)
    for (const char c : alphabet) names.push_back(names[i] + c);
  for (const char* name : {"床前", "床后", "主轴", "立柱", "шпиндель", "станина"})
    names.emplace_back(name);
  std::set<std::string> items;
  std::set<std::string> topics;
  const std::regex plain("temp_[A-Za-z0-9_]*");
  for (const std::string& name : names) {
    const std::string item = item_name("temp", name);
    if (items.size() % 100 == 0) CHECK(std::regex_match(item, plain));
    items.insert(item);
    topics.insert(topic_of("mill", "sensor", name));
  }
  CHECK(items.size() == names.size());
  CHECK(topics.size() == names.size());
}

TEST_CASE("every sensor has its own item in lines and device file", "[gateway][names]") {
  Snapshot snapshot = snapshot_of_two_axes();
  snapshot.sensors.sensors.clear();
  for (const char* name : {"床前", "床后", "主轴", "立柱", "a b", "a_b"})
    snapshot.sensors.sensors.push_back({.name = name, .smoothed_degC = 20.0, .fault = Fault::none});
  snapshot.sensors.sensors[1].fault = Fault::open_circuit;
  const ShdrStates states = shdr_states(snapshot);
  const std::string file = device_file(snapshot, "mill");
  std::size_t faulty = 0;
  std::size_t found = 0;
  for (const auto& [item, entries] : states) {
    CHECK_THAT(file, Contains(" id=\"" + item + "\""));
    found += item.starts_with("sensor_") ? 1u : 0u;
    faulty += entries.front().starts_with("FAULT") ? 1u : 0u;
  }
  CHECK(found == 6);
  CHECK(faulty == 1);
}

TEST_CASE("adapter lines contain all items once, then changes", "[gateway][shdr]") {
  Snapshot snapshot = snapshot_of_two_axes();
  const ShdrStates first = shdr_states(snapshot);
  const std::string all = shdr_lines({}, first, snapshot.wall_s);
  CHECK_THAT(all, Contains("2026-03-01T08:30:00.125Z|avail|AVAILABLE"));
  CHECK_THAT(all, Contains("|offset_z|-0.003500"));
  CHECK_THAT(all, Contains("|temp_bed_0x20front|21.500000"));
  CHECK_THAT(all, Contains("|displacement_b|UNAVAILABLE"));
  CHECK_THAT(all, Contains("Z|system|NORMAL||||\n"));
  CHECK(shdr_lines(first, first, snapshot.wall_s).empty());
  snapshot.status.mode = Mode::holding;
  snapshot.status.reasons = static_cast<std::uint32_t>(Reason::block_lost) |
                            static_cast<std::uint32_t>(Reason::signal_lost);
  const ShdrStates second = shdr_states(snapshot);
  const std::string changed = shdr_lines(first, second, snapshot.wall_s);
  CHECK(changed ==
        "2026-03-01T08:30:00.125Z|mode|holding\n"
        "2026-03-01T08:30:00.125Z|system|NORMAL||||\n"
        "2026-03-01T08:30:00.125Z|system|FAULT|block_lost|||an input of the model has no good "
        "sensor left\n"
        "2026-03-01T08:30:00.125Z|system|FAULT|signal_lost|||a signal of the controller is missing "
        "that the model or disable_signal needs\n");
  CHECK(shdr_lines(second, first, snapshot.wall_s) ==
        "2026-03-01T08:30:00.125Z|mode|compensating\n"
        "2026-03-01T08:30:00.125Z|system|NORMAL||||\n");
}

TEST_CASE("only a ping is answered", "[gateway][shdr]") {
  CHECK(shdr_answer("* PING\r", 10.0) == "* PONG 10000\n");
  CHECK(shdr_answer("* PINGS", 10.0).empty());
  CHECK(shdr_answer("", 10.0).empty());
}

TEST_CASE("a trend is the slope over the window, after one minute", "[gateway][trend]") {
  TrendWatch trends;
  for (int s = 0; s < 50; ++s) trends.add("a", s, 20.0 + 0.001 * s);
  CHECK(std::isnan(trends.per_hour("a")));
  for (int s = 50; s < 600; ++s) trends.add("a", s, 20.0 + 0.001 * s);
  CHECK(trends.per_hour("a") == Approx(3.6));
  trends.add("a", 700.0, std::nan(""));
  CHECK(trends.per_hour("a") == Approx(3.6));
  CHECK(std::isnan(trends.per_hour("b")));
}

TEST_CASE("the page uses the texts of thermocomp status", "[gateway][page]") {
  Snapshot snapshot = snapshot_of_two_axes();
  json state = page_state(snapshot, "mill");
  CHECK(state["verdict"]["answer"] == "yes");
  CHECK(state["verdict"]["since_s"].is_null());
  CHECK(state["verdict"]["level"] == "good");
  CHECK(state["verdict"]["advice"] == "");
  AxisStatus& axis = snapshot.status.axes[0];
  axis.offset_sd_max = 5.0;
  axis.target = axis.offset + 35.0;
  state = page_state(snapshot, "mill");
  CHECK_THAT(state["verdict"]["advice"].get<std::string>(), Catch::Contains("35.0 um still to go"));
  CHECK(state["verdict"]["level"] == "good");
  snapshot.status.mode = Mode::holding;
  snapshot.status.reasons = static_cast<std::uint32_t>(Reason::block_lost);
  state = page_state(snapshot, "mill");
  CHECK(state["verdict"]["level"] == "bad");
  CHECK_THAT(state["verdict"]["advice"].get<std::string>(),
             Catch::Contains("do not finish a precise cut"));
  CHECK(state["problems"][0]["what"] == "an input of the model has no good sensor left");
  CHECK_FALSE(state["problems"][0]["remedy"].get<std::string>().empty());
  snapshot.is_here = false;
  state = page_state(snapshot, "mill");
  CHECK(state["verdict"]["answer"] == "not known");
  CHECK(state["axes"].size() == 2);  // last known values
  CHECK_THAT(state["problems"][0]["remedy"].get<std::string>(),
             Catch::Contains("the controller keeps the last offsets: "));
  CHECK(state["verdict"]["since_s"] == std::round(snapshot.since_s));
  CHECK_FALSE(page_state(Snapshot(), "mill").contains("axes"));
}

TEST_CASE("switched off and degraded are two levels", "[gateway][page]") {
  Snapshot snapshot = snapshot_of_two_axes();
  snapshot.status.mode_since_s = 90.0;
  snapshot.status.compensating_s = 60.0;
  snapshot.status.reasons = static_cast<std::uint32_t>(Reason::outside_domain);
  json message = page_state(snapshot, "mill")["verdict"];
  CHECK(message["level"] == "warning");
  CHECK(message["since_s"] == std::round(snapshot.wall_s - 60.0));
  snapshot.status.mode = Mode::disabled;
  message = page_state(snapshot, "mill")["verdict"];
  CHECK(message["level"] == "off");
  CHECK(message["since_s"] == std::round(snapshot.wall_s - 90.0));
}

TEST_CASE("a change turns the previous state into the new one", "[gateway][page]") {
  const json before = {
      {"time_s", 1.0}, {"axes", {{{"name", "z"}, {"offset", 1.0}}}}, {"why", json()}};
  json after = before;
  after["axes"][0]["offset"] = 2.0;
  CHECK(state_change(before, after).value() == json{{"axes", {{"0", {{"offset", 2.0}}}}}});
  CHECK(state_change(before, before).value() == json::object());
  after["axes"].push_back({{"name", "x"}});  // other length: the whole array
  CHECK(state_change(before, after).value()["axes"] == after["axes"]);
  after["sensors"] = json::array();
  CHECK_FALSE(state_change(before, after));
  CHECK_FALSE(state_change(json(), after));
}

namespace {

Event event(double wall_s, EventKind kind, Subject subject, const char* code,
            double duration_s = 2.0) {
  Event made;
  made.wall_s = wall_s;
  made.kind = kind;
  made.subject = std::move(subject);
  made.code = code;
  if (kind == EventKind::recovery || kind == EventKind::mode) made.duration_s = duration_s;
  return made;
}

std::vector<std::string> texts_of(std::vector<Event> events) {
  Snapshot snapshot;
  snapshot.events = std::make_shared<const std::vector<Event>>(std::move(events));
  std::vector<std::string> texts;
  for (const json& each : page_events(snapshot, 10)) texts.push_back(each["text"]);
  return texts;
}

}  // namespace

TEST_CASE("a mode change caused by a fault or command has no entry of its own", "[gateway][page]") {
  const Subject module{SubjectKind::device, "bed_module"};
  const auto mode = [](double wall_s, const char* before, const char* now, double lasted_s) {
    return event(wall_s, EventKind::mode, {SubjectKind::nothing, before}, now, lasted_s);
  };
  const Event fault = event(100.0, EventKind::fault, module, "not_connected");
  const Event over = event(128.0, EventKind::recovery, module, "not_connected", 28.0);
  CHECK(texts_of({fault, mode(102.0, "compensating", "holding", 100.0), over,
                  mode(130.0, "holding", "compensating", 28.0)}) ==
        std::vector<std::string>{event_text(over) + "; not compensated for 28 s"});

  const Event disable = event(200.0, EventKind::command, {}, "disable");
  const Event enable = event(260.0, EventKind::command, {}, "enable");
  CHECK(texts_of({disable, mode(200.1, "compensating", "disabled", 70.0), enable,
                  mode(260.1, "disabled", "compensating", 60.0)}) ==
        std::vector<std::string>{"switch on; not compensated for 1 min 0 s", "switch off"});

  // Far from the fault it has an entry of its own.
  const Event later = mode(300.0, "compensating", "holding", 170.0);
  CHECK(texts_of({fault, over, later}) ==
        std::vector<std::string>{event_text(later), event_text(over)});
}

TEST_CASE("repeated events are one entry, without their effects", "[gateway][page]") {
  std::vector<Event> events;
  for (int i = 0; i < 3; ++i) {
    const Subject module{SubjectKind::device, "bed_module"};
    events.push_back(event(100.0 * i, EventKind::fault, module, "not_connected"));
    events.push_back(event(100.0 * i, EventKind::fault, {SubjectKind::sensor, "bed"}, "no_answer"));
    events.push_back(event(100.0 * i + 2.0, EventKind::recovery, module, "not_connected"));
  }
  events.push_back(event(500.0, EventKind::fault, {SubjectKind::sensor, "head"}, "open_circuit"));
  Snapshot snapshot;
  snapshot.events = std::make_shared<const std::vector<Event>>(events);
  const json list = page_events(snapshot, 10);
  REQUIRE(list.size() == 2);
  CHECK(list[0]["text"] == "sensor head: sensor wire broken");
  CHECK(list[1]["text"] == "device bed_module: not_connected: 3 times, 6 s in all");
  CHECK(list[1]["wall_s"] == 202.0);
}

TEST_CASE("the time without a daemon is one line, and ends the outages before it",
          "[gateway][page]") {
  const Subject sensor{SubjectKind::sensor, "head"};
  const auto broken = [&](double wall_s) {
    return event(wall_s, EventKind::fault, sensor, "open_circuit");
  };
  const auto over = [&](double wall_s) {
    return event(wall_s, EventKind::recovery, sensor, "open_circuit");
  };
  Event start = event(160.0, EventKind::daemon, {}, "started");
  start.duration_s = 60.0;
  const auto lines_of = [](std::vector<Event> events) {
    Snapshot snapshot;
    snapshot.events = std::make_shared<const std::vector<Event>>(std::move(events));
    return page_events(snapshot, 10);
  };
  const json stopped = lines_of({broken(10.0), over(12.0), broken(90.0),
                                 event(99.0, EventKind::daemon, {}, "stopping"), start});
  REQUIRE(stopped.size() == 2);
  CHECK(stopped[0]["text"] == "daemon stopped");
  CHECK(stopped[0]["from_s"] == 100.0);
  CHECK(stopped[0]["wall_s"] == 160.0);
  CHECK(stopped[1]["text"] == "sensor head: sensor wire broken: 2 times, 2 s in all");
  const json killed = lines_of({broken(10.0), over(12.0), start, broken(170.0)});
  CHECK(killed[0]["text"] == "sensor head: sensor wire broken: 2 times, 2 s in all, and still");
  CHECK(killed[1]["text"] == "daemon killed, or the power failed");
  start.duration_s = not_a_number;
  start.detail = "1.2";
  CHECK(
      lines_of({start})[0] ==
      json{{"kind", "daemon"}, {"number", 0}, {"text", "started, version 1.2"}, {"wall_s", 160.0}});
}
