#include "cli/observe/status_text.hpp"

#include <string>

#include <catch2/catch.hpp>

#include "cli/observe/watch_text.hpp"
#include "status/codes.hpp"
#include "status/figures.hpp"
#include "status/verdict.hpp"

namespace {

using namespace thermocomp;
using Catch::Matchers::Contains;
using thermocomp::cli::sensors_text;
using thermocomp::cli::status_text;
using thermocomp::cli::watch_header;
using thermocomp::cli::watch_line;
using thermocomp::cli::watch_screen;

Status good_status() {
  Status status{.mode = Mode::compensating,
                .mode_since_s = 3725.0,
                .compensating_s = 3725.0,
                .enabled = true,
                .version = "0.2.0",
                .uptime_s = 4000.0};
  status.cycle = {.count = 400000,
                  .missed = 3,
                  .rate_hz = 100.0,
                  .lateness_us_p50 = 5.0,
                  .lateness_us_p999 = 77.0,
                  .lateness_us_max = 300.0,
                  .work_us_p50 = 2.5,
                  .work_us_max = 40.0,
                  .real_time = true};
  status.model = {.file = "m.toml", .checksum = "0123456789abcdef0123", .inputs = 1, .outputs = 1};
  status.axes = {{.name = "z",
                  .displacement = -3.2,
                  .target = 3.2,
                  .offset = 3.1,
                  .synced = true,
                  .driven = true}};
  status.inputs = {{.name = "bed_degC", .temp_degC = 22.5, .reference_degC = 21.0, .good = true}};
  status.controller = {.name = "cnc",
                       .kind = "modbus_tcp",
                       .connected = true,
                       .online = true,
                       .signals = {{"spindle_rpm", 6000.0}}};
  status.history = {
      .enabled = true, .file = "h.db", .working = true, .size_MB = 1.5, .last_commit_age_s = 2.0};
  return status;
}

std::uint32_t only(Reason reason) {
  return static_cast<std::uint32_t>(reason);
}

TEST_CASE("the status shows whether and how much is compensated", "[cli][status]") {
  const std::string text = status_text(good_status(), false);
  CHECK_THAT(text, Contains("Compensating    : yes, for 1 h 2 min"));
  CHECK_THAT(text, Contains("Axis z          : offset    +3.10 um, target    +3.20 um, applied"));
  CHECK_THAT(text, Contains("Problems        : none"));
  CHECK_THAT(text, Contains("SHA-256 0123456789abcdef)"));
  CHECK_THAT(text, Contains("100 Hz, 400000 cycles, 3 missed"));
  CHECK_THAT(text, !Contains("\033"));
}

TEST_CASE("the status shows time, origin and temperatures of the reference", "[cli][status]") {
  Status status = good_status();
  CHECK_THAT(status_text(status, false), Contains("Reference       : none yet"));
  ReferenceStatus& reference = status.reference;
  reference = {
      .by = "operator",
      .wall_s = 1772350211.5,
      .temps_degC = {{"bed_degC", 20.25}, {"head_degC", 21.5}, {"new_degC", not_a_number}}};
  CHECK_THAT(status_text(status, false), Contains("Reference       : taken 2026-0") &&
                                             Contains(".5 by thermocomp reference") &&
                                             Contains("at 20.25 to 21.50 degC"));
  reference.by = "first_values";
  reference.lost = true;
  CHECK_THAT(status_text(status, false),
             Contains("LOST; in its place taken ") && Contains("first values of a start"));
  reference.by = "model_file";
  reference.wall_s = not_a_number;
  CHECK_THAT(status_text(status, false), Contains("the temperatures of the model file, at 20.25"));
  reference.by = std::nullopt;
  CHECK_THAT(status_text(status, false), Contains("it is not known when"));
  reference.temps_degC = {{"bed_degC", not_a_number}};
  CHECK_THAT(status_text(status, false), Contains("Reference       : ") && Contains("none yet"));
}

TEST_CASE("a model that was never compared is reported as such", "[cli][status]") {
  Status status = good_status();
  status.model.still = {"x", "y"};
  CHECK_THAT(status_text(status, false), Contains("gives NO DISPLACEMENT of axis x, y"));
  status.model.still.clear();
  CHECK_THAT(status_text(status, false), !Contains("COMPARED"));
  status.model.compared = false;
  CHECK_THAT(status_text(status, false), Contains("NEVER COMPARED") && !Contains("probings"));
  status.model.probed_rms_um = {{"x", not_a_number}, {"z", 1.25}};
  CHECK_THAT(status_text(status, false), Contains("probings here differ by z 1.2 um rms"));
}

TEST_CASE("a machine outside its model's domain is reported", "[cli][status]") {
  Status status = good_status();
  CHECK_THAT(status_text(status, false), !Contains("Domain"));
  status.model.outside = true;
  status.model.outside_share_24h = 0.25;
  CHECK_THAT(status_text(status, false), Contains("25 % of the last 24 h"));
}

TEST_CASE("compensating needs the mode, the controller and every axis", "[cli][status]") {
  CHECK(is_compensating(good_status()));
  Status holding = good_status();
  holding.mode = Mode::holding;
  Status offline = good_status();
  offline.reasons = only(Reason::controller_offline);
  Status idle = good_status();
  idle.axes[0].driven = false;
  for (const Status& status : {holding, offline, idle}) {
    CHECK_FALSE(is_compensating(status));
    CHECK_THAT(status_text(status, false), Contains("Compensating    : no"));
  }
}

TEST_CASE("a dry run is never reported as compensating", "[cli][status]") {
  Status status = good_status();
  status.dry_run = true;
  for (const Mode mode : {Mode::compensating, Mode::holding, Mode::disabled}) {
    status.mode = mode;
    CHECK_FALSE(is_compensating(status));
    const std::string text = status_text(status, false);
    CHECK_THAT(text, Contains("Compensating    : no: DRY RUN, nothing is written"));
    CHECK_THAT(text, !Contains("yes"));
    CHECK_THAT(watch_screen(status, nullptr, false), Contains("DRY RUN"));
  }
  status.reasons = only(Reason::operator_disabled);
  CHECK_THAT(status_text(status, false),
             Contains("switch it off before the dry run ends: thermocomp enable"));
  status.controller.shown = {{"z", 3.0}};
  CHECK_THAT(status_text(status, false), Contains("online; applies by itself z +3.00 um"));
}

TEST_CASE("troubles are named in plain words", "[cli][status]") {
  Status status = good_status();
  status.mode = Mode::holding;
  status.reasons = only(Reason::block_lost);
  status.sensors_bad = {"table"};
  status.sensors_jumped = {{"table", {48.0, 0.0}}};
  status.buses = {{.name = "cabinet",
                   .kind = "modbus_tcp",
                   .last_error = "refused",
                   .units = {{.name = "bed_module"}}}};
  const std::string text = status_text(status, false);
  CHECK_THAT(text, Contains("no (offsets held, for"));
  CHECK_THAT(text,
             Contains("no good sensor left -> repair the sensor or its bus: thermocomp sensors"));
  CHECK_THAT(text, Contains("bad sensors: table"));
  CHECK_THAT(text, Contains("sensor table jumped by +48.0 K -> compare it with a hand-held "
                            "thermometer; where it is right, accept it: thermocomp accept table"));
  CHECK_THAT(text, Contains("bus cabinet is not connected (refused) -> check the module's power"));
}

TEST_CASE("a silent module is one trouble that lists the inputs lost with it", "[cli][status]") {
  Status status = good_status();
  status.mode = Mode::holding;
  status.reasons = only(Reason::block_lost);
  status.sensors_bad = {"bed_front", "bed_rear", "table", "head"};
  status.inputs = {{.name = "bed_degC", .block = "bed"},
                   {.name = "table_degC", .block = "table"},
                   {.name = "head_degC", .good = true, .block = "head"}};
  status.buses = {{.name = "cabinet",
                   .kind = "modbus_tcp",
                   .connected = true,
                   .units = {{.name = "bed_module",
                              .timeouts = 3,
                              .last_error = "no answer",
                              .sensors = {"bed_front", "bed_rear", "table"},
                              .blocks = {"bed", "table"},
                              .silent_s = 16.0}}}};
  std::vector<Trouble> list = troubles(status);
  REQUIRE(list.size() == 2);
  CHECK(list[0].what == "bed_module silent for 16 s: 3 sensors, inputs bed, table");
  CHECK(list[0].subject == Subject{SubjectKind::bus, "cabinet"});
  CHECK(list[1].what == "bad sensors: head");
  const SensorsAnswer answer{
      .sensors = {{.name = "head", .blocks = {"head"}, .fault = Fault::open_circuit}}};
  list = troubles(status, &answer);
  REQUIRE(list.size() == 2);
  CHECK(list[1].what == "sensor head: sensor wire broken");
  UnitStatus& unit = status.buses[0].units[0];
  unit.silent_s = not_a_number;  // the first second: nothing has failed yet
  unit.timeouts = 0;
  unit.last_error.clear();
  CHECK(troubles(status, &answer)[0].what ==
        "bed_module does not answer: 3 sensors, inputs bed, table");
  status.sensors_bad = {"head"};                 // the module's sensors are still good
  CHECK(troubles(status, &answer).size() == 2);  // an unexplained lost input, and head
  CHECK_THAT(troubles(status, &answer)[0].what, !Contains("silent"));
  CHECK_THAT(list[1].remedy, !Contains("thermocomp "));
}

TEST_CASE("an axis at its bound is named with what remains of its displacement", "[cli][status]") {
  Status status = good_status();
  status.reasons = only(Reason::at_bound);
  status.axes[0].at_bound = true;
  status.axes[0].target = -19.0;
  status.axes[0].offset = -12.0;
  const std::vector<Trouble> list = troubles(status);
  REQUIRE(list.size() == 1);
  CHECK(list[0].what == "axis z at its bound: 7.0 of 19.0 um remain");
  CHECK(list[0].subject == Subject{SubjectKind::axis, "z"});
}

TEST_CASE("a probing that the model does not explain is a problem of its axis", "[cli][status]") {
  Status status = good_status();
  status.axes[0].unexplained = {90.0, -0.1};
  const std::vector<Trouble> list = troubles(status);
  REQUIRE(list.size() == 1);
  CHECK(list[0].what ==
        "axis z: the last probing found a displacement of 90.0 um, of which the model gave -0.1");
  CHECK(list[0].subject == Subject{SubjectKind::axis, "z"});
}

TEST_CASE("an estimated block is reported with its standard deviation", "[cli][status]") {
  Status status = good_status();
  status.reasons = only(Reason::block_estimated);
  status.inputs.push_back({.name = "head_degC",
                           .temp_degC = 30.0,
                           .reference_degC = 21.0,
                           .block = "head",
                           .estimated = true,
                           .sd_K = 0.4});
  status.axes[0].offset_sd = 0.8;
  status.axes[0].offset_sd_max = 5.0;
  CHECK(is_compensating(status));
  const std::string text = status_text(status, false);
  CHECK_THAT(text, Contains("block head is estimated from 1 other, +-0.40 K (1 sd)"));
  CHECK_THAT(text, Contains("z +-0.80 um"));
  CHECK_THAT(text, !Contains("too uncertain"));
  CHECK_THAT(watch_screen(status, nullptr, false), Contains("estimated +-0.40 K"));
  CHECK_THAT(sensors_text({{}, status.inputs, status.axes}, false),
             Contains("block head is estimated"));
  status.axes[0].offset_sd = 6.0;
  CHECK_THAT(status_text(status, false), Contains("z +-6.00 um (too uncertain: at most 5.00)"));
}

TEST_CASE("the error state of a CAN interface is reported with its age and a remedy",
          "[cli][status]") {
  Status status = good_status();
  status.buses = {{.name = "body",
                   .kind = "can",
                   .last_error = "can0: bus-off",
                   .state = "bus_off",
                   .state_s = 3.2},
                  {.name = "table",
                   .kind = "can",
                   .connected = true,
                   .last_error = "can1: error passive",
                   .state = "passive",
                   .state_s = 61.0}};
  status.controller.state = "warning";
  status.controller.state_s = 0.5;
  const std::string text = status_text(status, false);
  CHECK_THAT(text,
             Contains("bus body: bus-off for 3 s -> check cable, termination, bit rate; then"));
  CHECK_THAT(text, Contains("bus table: error passive for 1 min 1 s -> check cable"));
  CHECK_THAT(text, Contains(": error warning for 0 s -> check cable"));
  CHECK_THAT(text, !Contains("not connected"));
  status.buses[0].state = "active";
  status.buses[0].connected = true;
  CHECK_THAT(status_text(status, false), !Contains("bus body"));
}

TEST_CASE("a suspected sensor is shown with its error and whether it is used", "[cli][status]") {
  Status status = good_status();
  const SensorError error{.size_K = -2.04, .since = 1'700'000'000.0};
  status.sensors_suspected = {{"head", error}};
  status.reasons = only(Reason::sensor_suspected);
  const std::string used = status_text(status, false);
  CHECK_THAT(used, Contains("sensor head is off by -2.0 K against its neighbours since "));
  CHECK_THAT(used, Contains(", used all the same"));
  CHECK_THAT(used, !Contains("Problems        : none"));
  status.sensors_suspected[0].suspicion.weighed_down = true;
  CHECK_THAT(status_text(status, false), Contains(", not used"));

  SensorStatus sensor{
      .name = "head", .raw_degC = 20.0, .smoothed_degC = 20.0, .fault = Fault::none, .age_s = 0.1};
  CHECK_THAT(sensors_text({{sensor}, {}, {}}, false), !Contains("suspected"));
  sensor.suspected = error;
  CHECK_THAT(sensors_text({{sensor}, {}, {}}, false),
             Contains("suspected: off by -2.0 K against its neighbours since "));
}

TEST_CASE("an unconfirmed reading is shown with its jump and the command that accepts it",
          "[cli][status]") {
  const SensorStatus sensor{.name = "head",
                            .raw_degC = 38.0,
                            .smoothed_degC = 20.0,
                            .fault = Fault::unconfirmed,
                            .age_s = 0.1,
                            .jump = Jump{.size_K = 18.0, .since = 1'700'000'000.0}};
  CHECK_THAT(sensors_text({{sensor}, {}, {}}, false),
             Contains("(jumped by +18.0 K at 2023-") && Contains("thermocomp accept SENSOR"));
}

TEST_CASE("a settling value is not reported as a fault", "[cli][status]") {
  const SensorStatus sensor{.name = "head", .raw_degC = 20.0, .fault = Fault::unconfirmed};
  CHECK_THAT(sensors_text({{sensor}, {}, {}}, false),
             Contains("new: counts once it has lasted settle_s") && !Contains("thermometer"));
  Status status = good_status();
  status.mode = Mode::starting;
  status.reasons = only(Reason::block_lost);
  CHECK_THAT(status_text(status, false), !Contains("repair the sensor"));
  status.sensors_bad = {"head"};
  CHECK_THAT(status_text(status, false), Contains("repair the sensor"));
}

TEST_CASE("an offset far from its target is on its way, which is no problem", "[cli][status]") {
  Status status = good_status();
  status.axes[0].target = -48.6;
  status.axes[0].offset = -13.5;
  status.axes[0].offset_sd_max = 5.0;
  const std::string way = "z has 35.1 um still to go to -48.6 um";
  CHECK_THAT(status_text(status, false),
             Contains("yes, for 1 h 2 min: " + way) && Contains("Problems        : none"));
  CHECK_THAT(watch_line(status, nullptr), Contains(way));
  CHECK(why_not(status, true).empty());
  status.axes[0].offset = -44.0;
  CHECK_THAT(status_text(status, false), !Contains("still to go"));
  status.axes[0].offset = -13.5;
  status.axes[0].at_bound = true;
  CHECK_THAT(status_text(status, false), !Contains("still to go"));
}

TEST_CASE("values that are being confirmed are the reason, not a lost sensor", "[cli][status]") {
  Status status = good_status();
  status.mode = Mode::holding;
  status.reasons = only(Reason::block_lost);
  CHECK_THAT(status_text(status, false), Contains("no good sensor left"));
  status.confirming = {{.sensors = {"bed"}, .settle_s = 2.0}};
  CHECK_THAT(status_text(status, false),
             Contains("new values are being confirmed: bed count after settle_s = 2 s") &&
                 !Contains("no good sensor left"));
}

TEST_CASE("a module that may be frozen is a degradation", "[cli][status]") {
  Status status = good_status();
  status.modules_frozen = {{"m1", 75.0}};
  CHECK_THAT(status_text(status, false),
             Contains("yes, ") && Contains("device m1: the same values for 1 min 15 s") &&
                 Contains("switch the device off and on"));
  CHECK(why_not(status, false).empty());
  CHECK(why_not(status, true).size() == 1);
}

TEST_CASE("a model of zeros compensates nothing", "[cli][status]") {
  Status status = good_status();
  CHECK(why_not(status, false).empty());
  status.model.moves = false;
  CHECK_FALSE(why_not(status, false).empty());
  CHECK_THAT(status_text(status, false), Contains("no (the model gives no displacement") &&
                                             Contains("fit one to measured runs: thermocomp fit"));
}

TEST_CASE("a refused write is shown with function, address and exception", "[cli][status]") {
  Status status = good_status();
  CHECK_THAT(status_text(status, false), !Contains("writes "));
  status.controller.write = {.refused = 3, .function = 16, .address = 100, .exception = 1};
  CHECK_THAT(
      status_text(status, false),
      Contains("writes refused, function 16, address 100, exception 1; last confirmed never"));
  status.controller.write = {.unanswered = 2, .last_confirmed_s = 12.0};
  CHECK_THAT(status_text(status, false), Contains("writes unanswered; last confirmed 12 s ago"));
}

TEST_CASE("a status without values is shown", "[cli][status]") {
  CHECK_FALSE(is_compensating({}));
  CHECK_FALSE(status_text({}, true).empty());
  CHECK_FALSE(sensors_text({}, true).empty());
  CHECK_FALSE(watch_screen({}, nullptr, true).empty());
  CHECK_FALSE(watch_header({}, nullptr).empty());
  CHECK_FALSE(watch_line({}, nullptr).empty());
}

TEST_CASE("a watch line shows temperatures, offsets and the simulated truth", "[cli][watch]") {
  const thermocomp::cli::TruthRow truth{
      {"time_s", "z_um", "z_offset_um", "z_error_um"}, {0, 1, 0, 0}, {10, -5.5, 6, -0.5}};
  const std::string line = watch_line(good_status(), &truth);
  CHECK_THAT(line,
             Contains("22.50") && Contains("+3.10") && Contains("-6.50") && Contains("-0.50"));
}

TEST_CASE("the heading of a watch is repeated when the truth appears", "[cli][watch]") {
  const thermocomp::cli::TruthRow truth{{"time_s", "z_um"}, {0, 1}, {10, -5.5}};
  thermocomp::cli::WatchLog log;
  const std::string plain = watch_header(good_status(), nullptr);
  CHECK(log.next(good_status(), nullptr) == plain + watch_line(good_status(), nullptr));
  CHECK(log.next(good_status(), nullptr) == watch_line(good_status(), nullptr));
  CHECK(log.next(good_status(), &truth) ==
        watch_header(good_status(), &truth) + watch_line(good_status(), &truth));
  CHECK(log.next(good_status(), &truth) == watch_line(good_status(), &truth));
}

TEST_CASE("in its first seconds a watch line shows only 'starting'", "[cli][watch]") {
  Status status = good_status();
  status.mode = Mode::starting;
  status.reasons = static_cast<std::uint32_t>(Reason::block_lost) |
                   static_cast<std::uint32_t>(Reason::no_reference);
  status.uptime_s = 0.4;
  const std::string begun = watch_line(status, nullptr);
  CHECK_THAT(begun, Contains("starting"));
  status.uptime_s = 60.0;
  CHECK(watch_line(status, nullptr).size() > begun.size() + 10);
}

TEST_CASE("durations are readable", "[cli]") {
  CHECK(duration_text(7.9) == "7 s");
  CHECK(duration_text(725.0) == "12 min 5 s");
  CHECK(duration_text(3.0 * 3600 + 1200) == "3 h 20 min");
  CHECK(duration_text(5.0 * 86400 + 7300) == "5 d 2 h");
  CHECK(duration_text(not_a_number) == "-");
}

}  // namespace
