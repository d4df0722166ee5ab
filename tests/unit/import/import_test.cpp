// Logs as the programs write them, in logs/:
//   halsampler_numbered.txt, halsampler_plain.txt: made by halsampler of LinuxCNC 2.9.0-pre1
//   (Debian
//     12), siggen into sampler with cfg=ffb at 1 ms; with -t and without
//   temperature_store.json: the answer of Moonraker's GET /server/temperature_store, in the shape
//     that its documentation of the API shows
//   campbell_toa5.dat: the layout of Campbell Scientific's manual of LoggerNet, "TOA5"
//   kw_watcher.csv: the header of seven lines of Panasonic's documentation of FP-I4C, KW Watcher
//   rtu_log.csv: the "optimized" log of a remote terminal unit (help of its maker: Date;tag;tag;)
//   probings.csv: what a spreadsheet of a German shop gives
#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "cli/import/import_log.hpp"
#include "cli/import/joined_runs.hpp"
#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"

namespace {

using namespace thermocomp;
using namespace thermocomp::cli;
using Catch::Matchers::Contains;

std::string log_file(const std::string& name) {
  return std::string(THERMOCOMP_LOGS) + "/" + name;
}

ImportedLog log_of(const std::string& name, const LogOptions& options = {}) {
  return import_log(log_file(name), nullptr, options);
}

RunFile imported(const std::string& name, const LogOptions& options = {}) {
  return log_of(name, options).run;
}

RunFile imported_with(const std::string& name, const std::string& map_text) {
  const ColumnMap map = parse_column_map(map_text, "map.toml");
  return import_log(log_file(name), &map, {}).run;
}

bool says(const RunFile& run, const std::string& part) {
  return std::any_of(run.understood.begin(), run.understood.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

using Columns = std::vector<std::string>;

}  // namespace

TEST_CASE("halsampler's numbered samples become rows at their times", "[import]") {
  const RunFile run =
      imported("halsampler_numbered.txt", {{"t1_degC", "z_mm", "coolant_on"}, 0.001});
  CHECK(run.columns == Columns{"time_s", "t1_degC", "z_mm", "coolant_on"});
  REQUIRE(run.rows() == 12);
  CHECK(run.time_s().back() == Approx(0.011));
  CHECK(run.column("t1_degC")[1] == 20.125650);
  CHECK(run.column("z_mm").back() == 24.52);
  CHECK(says(run, "numbered (-t)"));
  CHECK(says(run, "number 2 is t1_degC"));
}

TEST_CASE("halsampler without numbers: an overrun before the first row loses nothing of the file",
          "[import]") {
  const RunFile run = imported("halsampler_plain.txt", {{"t1_degC", "z_mm", "coolant_on"}, 0.001});
  REQUIRE(run.rows() == 6);
  CHECK(run.column("t1_degC").front() == 20.813186);
  CHECK(says(run, "not numbered"));
}

TEST_CASE("halsampler says neither names nor period: the line to write is told", "[import]") {
  CHECK_THROWS_WITH(imported("halsampler_numbered.txt"),
                    Contains("--names t1_degC,t2_degC,t3_degC --period-s S"));
  CHECK_THROWS_WITH(imported("halsampler_numbered.txt", {{"a", "b", "c"}, {}}),
                    Contains("write --period-s S"));
  CHECK_THROWS_WITH(imported("halsampler_numbered.txt", {{"a", "b"}, 0.001}),
                    Contains("must be one for each of the 4 numbers"));
}

TEST_CASE("lost samples are a gap where they are numbered, else an error", "[import]") {
  const LogOptions one{{"z_mm"}, 0.5};
  const RunFile run = import_text("7 1.5 \n8 1.6 \noverrun\n20 1.9 \n", "log", nullptr, one).run;
  CHECK(run.time_s() == std::vector<double>{0.0, 0.5, 6.5});
  CHECK(says(run, "lost: 1 times"));
  CHECK_THROWS_WITH(import_text("1.5 \noverrun\n1.9 \n", "log", nullptr, one),
                    Contains("halsampler -t"));
  CHECK_THROWS_WITH(import_text("1 2 \n3 \n4 5 \n", "log", nullptr, one),
                    Contains("log:2: 1 numbers"));
}

TEST_CASE("Moonraker's temperature store: temperatures, targets, powers", "[import]") {
  const RunFile run = imported("temperature_store.json");
  CHECK(run.columns == Columns{"time_s", "extruder_degC", "extruder_target",
                               "extruder_power_percent", "electronics_degC", "electronics_target",
                               "electronics_speed_percent", "frame_degC"});
  CHECK(run.time_s() == std::vector<double>{0, 1, 2, 3});
  CHECK(run.column("extruder_degC")[1] == 21.12);
  CHECK(run.column("extruder_power_percent")[2] == 100.0);
  CHECK(std::isnan(run.column("frame_degC")[2]));
  CHECK(says(run, "'temperature_sensor frame' temperatures is frame_degC"));
  CHECK_THROWS_WITH(import_text(R"({"result": {"a": 1}})", "x", nullptr, {}),
                    Contains("server/temperature_store"));
  CHECK_THROWS_WITH(import_text(R"({"result": )", "x", nullptr, {}), Contains("must be JSON"));
  CHECK_THROWS_WITH(import_text(R"({"a": {"temperatures": [1, 2]}, "b": {"temperatures": [1]}})",
                                "x", nullptr, {}),
                    Contains("b.temperatures = 1 values: must be as many"));
}

TEST_CASE("TOA5: names and units from their lines, record numbers left out", "[import]") {
  const RunFile run = imported("campbell_toa5.dat");
  CHECK(run.columns == Columns{"time_s", "Bed_Avg_degC", "Head_Avg_degC", "Z_drift_um"});
  CHECK(run.time_s() == std::vector<double>{0, 60, 120});
  CHECK(run.column("Head_Avg_degC")[1] == 22.4);
  CHECK(std::isnan(run.column("Bed_Avg_degC")[2]));
  CHECK(says(run, "station 'mill_3'"));
  CHECK(says(run, "'RECORD' left out"));
}

TEST_CASE("TOA5: elements of an array keep their units, what has no value is missing", "[import]") {
  // As multiplexers of thermocouples are written; the fractions of a second of fast tables.
  const auto written = [](const std::string& unit_of_flags) {
    return "\"TOA5\",\"mill_3\",\"CR3000\",\"1\",\"CR3000.Std.22\",\"CPU:a.CR3\",\"24006\","
           "\"fast\"\r\n"
           "\"TIMESTAMP\",\"RECORD\",\"TC(1)\",\"TC(2)\",\"Flag(1)\"\r\n"
           "\"TS\",\"RN\",\"Deg C\",\"Deg C\",\"" +
           unit_of_flags +
           "\"\r\n"
           "\"\",\"\",\"Smp\",\"Smp\",\"Smp\"\r\n"
           "\"2012-06-07 12:45:00.05\",11,20.5,21.5,0\r\n"
           "\"2012-06-07 12:45:00.1\",12,\"INF\",\"NAN\",1\r\n";
  };
  const RunFile run = import_text(written("-"), "x", nullptr, {}).run;
  CHECK(run.columns == Columns{"time_s", "TC(1)_degC", "TC(2)_degC", "Flag(1)"});
  CHECK(run.time_s()[1] == Approx(0.05));
  CHECK(run.column("TC(2)_degC")[0] == 21.5);
  CHECK(std::isnan(run.column("TC(1)_degC")[1]));
  CHECK(std::isnan(run.column("TC(2)_degC")[1]));
  CHECK(says(run, "INF, taken as missing: 1"));
  CHECK_THROWS_WITH(import_text(written(""), "x", nullptr, {}),
                    Contains("column 4 = Flag(1): has no unit"));
}

TEST_CASE("KW Watcher: seven lines above the rows", "[import]") {
  const RunFile run = imported("kw_watcher.csv");
  CHECK(run.columns == Columns{"time_s", "bed_degC", "head_degC", "spindle_rpm"});
  CHECK(run.time_s() == std::vector<double>{0, 30, 60});
  CHECK(run.column("spindle_rpm")[1] == 3000.0);
}

TEST_CASE("a log whose columns have no unit asks for the map's lines, and takes them", "[import]") {
  CHECK_THROWS_WITH(imported("rtu_log.csv"), Contains("write \"plc.plc1.bed\" = "));
  const RunFile run = imported_with("rtu_log.csv",
                                    "[columns]\n\"plc.plc1.bed\" = \"bed_degC\"\n"
                                    "\"plc.plc1.head\" = \"head_degC\"\n"
                                    "\"plc.plc1.speed\" = \"spindle_rpm\"\n");
  CHECK(run.columns == Columns{"time_s", "bed_degC", "head_degC", "spindle_rpm"});
  CHECK(run.column("head_degC").back() == 22.6);
}

TEST_CASE("two files with dates are joined by them", "[import]") {
  const RunFile run = joined_runs(log_of("kw_watcher.csv"), log_of("probings.csv"), {});
  CHECK(run.columns == Columns{"time_s", "bed_degC", "head_degC", "spindle_rpm", "z_um"});
  CHECK(run.time_s() == std::vector<double>{0, 20, 30, 45, 60, 1800});
  // Between two rows: temperatures on the line, the speed as it was before.
  CHECK(run.column("head_degC")[1] == Approx(21.9 + 20.0 / 30.0 * 0.2));
  CHECK(run.column("spindle_rpm")[1] == 0.0);
  CHECK(run.column("spindle_rpm")[3] == 3000.0);
  CHECK(run.column("z_um")[1] == 0.8);
  CHECK(std::isnan(run.column("z_um")[2]));
  // After the last row of the first nothing is known of it.
  CHECK(std::isnan(run.column("head_degC")[5]));
  CHECK(says(run, "2 of its 3 rows lie within"));
  // What is written reads back.
  CHECK(parse_run(write_run(run), "again").columns == run.columns);
}

TEST_CASE("files without a common clock ask for the shift", "[import]") {
  const ImportedLog store = log_of("temperature_store.json");
  const ImportedLog probings = log_of("probings.csv");
  CHECK_THROWS_WITH(joined_runs(store, probings, {}), Contains("write --shift-s S"));
  const RunFile run = joined_runs(store, probings, 1.5);
  CHECK(run.time_s()[2] == 1.5);
  CHECK(run.column("z_um")[2] == 0.8);
  CHECK_THROWS_WITH(joined_runs(store, probings, 5000.0), Contains("lies outside of"));
  CHECK_THROWS_WITH(joined_runs(probings, probings, 0.0), Contains("is a column of"));
}

TEST_CASE("an export's comment says its clock", "[import]") {
  const ImportedLog log =
      import_text("# 0.000 s: wall time 2026-03-02T07:00:00.000Z\ntime_s,t1_degC\n0,20\n60,21\n",
                  "run.csv", nullptr, {});
  REQUIRE(log.wall_zero);
  CHECK(log.wall_zero->is_utc);
  CHECK_THROWS_WITH(joined_runs(log, log_of("probings.csv"), {}), Contains("time zone"));
}

TEST_CASE("options that a log has no use for are refused", "[import]") {
  CHECK_THROWS_WITH(imported("kw_watcher.csv", {{"a"}, {}}), Contains("--names"));
  CHECK_THROWS_WITH(imported("kw_watcher.csv", {{}, 2.0}), Contains("--period-s"));
}
