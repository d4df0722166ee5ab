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
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>
#include <random>
#include <string>
#include <unistd.h>
#include <vector>

#include <catch2/catch.hpp>

#include "cli/import/import_runs.hpp"
#include "config/run_forms/column_map.hpp"
#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"

namespace {

using namespace thermocomp;
using namespace thermocomp::cli;
using Catch::Matchers::Contains;

std::string log_file(const std::string& name) {
  return std::string(THERMOCOMP_LOGS) + "/" + name;
}

ColumnMap named(const std::vector<std::string>& names, std::optional<double> period_s = {}) {
  ColumnMap map;
  map.names = names;
  map.period_s = period_s;
  return map;
}

RunFile import_text(const std::string& text, const ColumnMap& map = {}) {
  return parse_run(text, "log", {}, &map);
}

RunFile imported(const std::string& name, const ColumnMap& map = {}) {
  return load_run({log_file(name)}, &map);
}

bool has_note(const RunFile& run, const std::string& part) {
  return std::any_of(run.understood.begin(), run.understood.end(),
                     [&](const std::string& line) { return line.find(part) != std::string::npos; });
}

using Columns = std::vector<std::string>;

}  // namespace

TEST_CASE("halsampler's numbered samples become rows at their times", "[import]") {
  const RunFile run =
      imported("halsampler_numbered.txt", named({"t1_degC", "z_mm", "coolant_on"}, 0.001));
  CHECK(run.columns == Columns{"time_s", "t1_degC", "z_mm", "coolant_on"});
  REQUIRE(run.rows() == 12);
  CHECK(run.time_s().back() == Approx(0.011));
  CHECK(run.column("t1_degC")[1] == 20.125650);
  CHECK(run.column("z_mm").back() == 24.52);
  CHECK(has_note(run, "numbered (-t)"));
  CHECK(has_note(run, "number 2 is t1_degC"));
}

TEST_CASE("halsampler without numbers: an overrun before the first row loses nothing of the file",
          "[import]") {
  const RunFile run =
      imported("halsampler_plain.txt", named({"t1_degC", "z_mm", "coolant_on"}, 0.001));
  REQUIRE(run.rows() == 6);
  CHECK(run.column("t1_degC").front() == 20.813186);
  CHECK(has_note(run, "not numbered"));
}

TEST_CASE("halsampler without names and period: the error shows the lines to add", "[import]") {
  CHECK_THROWS_WITH(imported("halsampler_numbered.txt"),
                    Contains("--names t1_degC,t2_degC,t3_degC --period-s S"));
  CHECK_THROWS_WITH(imported("halsampler_numbered.txt", named({"a", "b", "c"})),
                    Contains("write --period-s S"));
  CHECK_THROWS_WITH(imported("halsampler_numbered.txt", named({"a", "b"}, 0.001)),
                    Contains("must be one for each of the 4 numbers"));
}

TEST_CASE("lost samples are a gap if samples are numbered, else an error", "[import]") {
  const ColumnMap one = named({"z_mm"}, 0.5);
  const RunFile run = import_text("7 1.5 \n8 1.6 \noverrun\n20 1.9 \n", one);
  CHECK(run.time_s() == std::vector<double>{0.0, 0.5, 6.5});
  CHECK(has_note(run, "lost: 1 times"));
  CHECK_THROWS_WITH(import_text("1.5 \noverrun\n1.9 \n", one), Contains("halsampler -t"));
  CHECK_THROWS_WITH(import_text("1 2 \n3 \n4 5 \n", one), Contains("log:2: 1 numbers"));
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
  CHECK(has_note(run, "'temperature_sensor frame' temperatures is frame_degC"));
  CHECK_THROWS_WITH(import_text(R"({"result": {"a": 1}})"), Contains("server/temperature_store"));
  CHECK_THROWS_WITH(import_text(R"({"result": )"), Contains("must be JSON"));
  CHECK_THROWS_WITH(import_text(R"({"a": {"temperatures": [1, 2]}, "b": {"temperatures": [1]}})"),
                    Contains("b.temperatures = 1 values: must be as many"));
}

TEST_CASE("TOA5: names and units from their lines, record numbers left out", "[import]") {
  const RunFile run = imported("campbell_toa5.dat");
  CHECK(run.columns == Columns{"time_s", "Bed_Avg_degC", "Head_Avg_degC", "Z_drift_um"});
  CHECK(run.time_s() == std::vector<double>{0, 60, 120});
  CHECK(run.column("Head_Avg_degC")[1] == 22.4);
  CHECK(std::isnan(run.column("Bed_Avg_degC")[2]));
  CHECK(has_note(run, "mill_3"));
  CHECK(has_note(run, "'RECORD' left out"));
}

TEST_CASE("TOA5: elements of an array keep their units, absent values are missing", "[import]") {
  // As in tables of thermocouple multiplexers; fractions of a second as in fast tables.
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
  const RunFile run = import_text(written("-"));
  CHECK(run.columns == Columns{"time_s", "TC(1)_degC", "TC(2)_degC", "Flag(1)"});
  CHECK(run.time_s()[1] == Approx(0.05));
  CHECK(run.column("TC(2)_degC")[0] == 21.5);
  CHECK(std::isnan(run.column("TC(1)_degC")[1]));
  CHECK(std::isnan(run.column("TC(2)_degC")[1]));
  CHECK(has_note(run, "missing: 1 fields like 'INF'"));
  CHECK_THROWS_WITH(import_text(written("")), Contains("column 5 = Flag(1): has no unit"));
}

TEST_CASE("KW Watcher: seven lines above the rows", "[import]") {
  const RunFile run = imported("kw_watcher.csv");
  CHECK(run.columns == Columns{"time_s", "bed_degC", "head_degC", "spindle_rpm"});
  CHECK(run.time_s() == std::vector<double>{0, 30, 60});
  CHECK(run.column("spindle_rpm")[1] == 3000.0);
}

TEST_CASE("a log without units needs the column map and is read with it", "[import]") {
  CHECK_THROWS_WITH(imported("rtu_log.csv"), Contains("write \"plc.plc1.bed\" = "));
  const RunFile run =
      imported("rtu_log.csv", parse_column_map("[columns]\n\"plc.plc1.bed\" = \"bed_degC\"\n"
                                               "\"plc.plc1.head\" = \"head_degC\"\n"
                                               "\"plc.plc1.speed\" = \"spindle_rpm\"\n",
                                               "map.toml"));
  CHECK(run.columns == Columns{"time_s", "bed_degC", "head_degC", "spindle_rpm"});
  CHECK(run.column("head_degC").back() == 22.6);
}

TEST_CASE("two files with dates are joined by their dates", "[import]") {
  const RunFile run = joined_runs(imported("kw_watcher.csv"), imported("probings.csv"), {});
  CHECK(run.columns == Columns{"time_s", "bed_degC", "head_degC", "spindle_rpm", "z_um"});
  CHECK(run.time_s() == std::vector<double>{0, 20, 30, 45, 60, 1800});
  // Between two rows temperatures are interpolated and the speed is held.
  CHECK(run.column("head_degC")[1] == Approx(21.9 + 20.0 / 30.0 * 0.2));
  CHECK(run.column("spindle_rpm")[1] == 0.0);
  CHECK(run.column("spindle_rpm")[3] == 3000.0);
  CHECK(run.column("z_um")[1] == 0.8);
  CHECK(std::isnan(run.column("z_um")[2]));
  // Unknown after the last row of the first file.
  CHECK(std::isnan(run.column("head_degC")[5]));
  CHECK(has_note(run, "2 of its 3 rows are within"));
  // What is written reads back.
  CHECK(parse_run(write_run(run), "again").columns == run.columns);
}

TEST_CASE("files without a common clock need the shift", "[import]") {
  const RunFile store = imported("temperature_store.json");
  const RunFile probings = imported("probings.csv");
  CHECK_THROWS_WITH(joined_runs(store, probings, {}), Contains("write --shift-s S"));
  const RunFile run = joined_runs(store, probings, 1.5);
  CHECK(run.time_s()[2] == 1.5);
  CHECK(run.column("z_um")[2] == 0.8);
  CHECK_THROWS_WITH(joined_runs(store, probings, 5000.0), Contains("is outside "));
  const RunFile twice = joined_runs(probings, probings, 0.0);
  CHECK(twice.columns == Columns{"time_s", "z_um", "z_2_um"});
  CHECK(has_note(twice, "z_um of " + probings.name + " is z_2_um"));
}

namespace {

/// A spindle warms up and cools, seen from machine time `start_s` on, once per `step_s`.
RunFile seen_from(double start_s, double step_s, const std::string& column, double factor,
                  bool with_event, unsigned seed) {
  RunFile run;
  run.name = column;
  run.columns = {"time_s", column};
  run.values.resize(2);
  double temp_K = 0.0;
  std::mt19937 chance(seed);
  std::normal_distribution<double> noise(0.0, 0.02);
  for (double at_s = 0.0; at_s < 9000.0; at_s += 1.0) {
    const bool runs = with_event && ((at_s > 3000 && at_s < 4500) || (at_s > 5000 && at_s < 5600));
    temp_K += ((runs ? 8.0 : 0.0) - temp_K) / 400.0;
    if (at_s < start_s || std::fmod(at_s - start_s, step_s) != 0.0) continue;
    run.values[0].push_back(at_s - start_s);
    run.values[1].push_back(20.0 + factor * (temp_K + noise(chance)));
  }
  run.selected_end = run.rows();
  return run;
}

}  // namespace

TEST_CASE("files without dates are joined by a common event, or not at all", "[import]") {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    const RunFile first = seen_from(0.0, 10.0, "bed_degC", 1.0, true, seed);
    const RunFile second = seen_from(1500.0, 7.0, "z_um", -3.0, true, 100 + seed);
    const auto shift = clock_shift(first, second);
    REQUIRE(shift);
    INFO(shift->correlation << " next " << shift->next << " at " << shift->shift_s);
    CHECK(shift->is_sure());
    CHECK(shift->shift_s == Approx(1500.0).margin(15.0));
    CHECK(has_note(joined_runs(first, second, {}), "'bed_degC' and 'z_um' change alike"));
    // Dates that contradict the columns are refused; a lag of minutes is none.
    const auto dated = [](RunFile run, double zero_s) {
      run.wall_zero = WallZero{zero_s, false};
      return run;
    };
    CHECK_THROWS_WITH(
        joined_runs(dated(first, 1e9), dated(second, 1e9 + 1500 - 3600), {}),
        Contains("the dates give -2100 s, but 'bed_degC' and 'z_um' change alike at 1500 s"));
    CHECK(
        has_note(joined_runs(dated(first, 1e9), dated(second, 1e9 + 900), {}), ", by their dates"));
    // Noise alone, or an event in only one file, gives no result.
    const RunFile calm = seen_from(1500.0, 7.0, "z_um", 1.0, false, 200 + seed);
    CHECK(!clock_shift(first, calm)->is_sure());
    CHECK_THROWS_WITH(joined_runs(first, calm, {}), Contains("which is not sure"));
  }
}

TEST_CASE("the comment of an export gives its clock", "[import]") {
  const RunFile log =
      import_text("# 0.000 s: wall time 2026-03-02T07:00:00.000Z\ntime_s,t1_degC\n0,20\n60,21\n");
  REQUIRE(log.wall_zero);
  CHECK(log.wall_zero->is_utc);
  CHECK_THROWS_WITH(joined_runs(log, imported("probings.csv"), {}), Contains("time zone"));
}

TEST_CASE("each form's example gives the expected run", "[import]") {
  namespace fs = std::filesystem;
  std::size_t folders = 0;
  for (const auto& folder : fs::directory_iterator(THERMOCOMP_FORMS)) {
    INFO(folder.path().string());
    ++folders;
    ColumnMap map;
    if (fs::exists(folder.path() / "columns.toml"))
      map = load_column_map(folder.path() / "columns.toml");
    map.takes_signals = true;
    fs::path input;
    for (const auto& file : fs::directory_iterator(folder.path()))
      if (file.path().stem() == "in") input = file.path();
    std::string text;
    try {
      const RunFile run = load_run({input}, &map);
      text = (run.wall_zero ? wall_zero_comment(*run.wall_zero) : "") + write_run(run);
    } catch (const ConfigurationError& error) {
      text = error.what();
    }
    std::ifstream expected(folder.path() / "expected.csv");
    const std::string wanted((std::istreambuf_iterator<char>(expected)), {});
    CHECK(text == wanted);
  }
  CHECK(folders >= 25);
}

TEST_CASE("a workbook is read by xlsx2csv, or the error gives the remedy", "[import]") {
  const std::string file =
      (std::filesystem::temp_directory_path() / ("book" + std::to_string(getpid()) + ".xlsx"))
          .string();
  std::ofstream(file) << "PK\x03\x04 and no sheet";
  const std::string path = std::getenv("PATH");
  CHECK_THROWS_WITH(load_run({file}), Contains("save the sheet as CSV"));
  setenv("PATH", "/nowhere", 1);
  CHECK_THROWS_WITH(load_run({file}), Contains("apt install xlsx2csv"));
  setenv("PATH", path.c_str(), 1);
  std::filesystem::remove(file);
}

TEST_CASE("options that a log does not need are refused", "[import]") {
  CHECK_THROWS_WITH(imported("kw_watcher.csv", named({"a"})), Contains("names"));
  CHECK_THROWS_WITH(imported("kw_watcher.csv", named({}, 2.0)), Contains("period_s"));
}

TEST_CASE("operators' corrections are displacements of opposite sign", "[import]") {
  const std::string log =
      "date;time;tool;axis;correction [mm]\n20.11.2026;10:12:03;T5;Z;-0,012\n"
      "20.11.2026;11:02:44;T5;Z;-0,006\n20.11.2026;11:02:50;T5;X;0,004\n"
      "20.11.2026;13:40:11;T5;Z;0,005\n";
  // Calculated by hand: Z -12, -18, -13 um in total; X +4 um.
  const RunFile steps = displacements_of(import_text(log), CorrectionEntry::step);
  CHECK(steps.columns == std::vector<std::string>{"time_s", "z_um", "x_um"});
  const std::vector<double>& z = steps.column("z_um");
  CHECK(z[0] == Approx(12.0));
  CHECK(z[1] == Approx(18.0));
  CHECK(std::isnan(z[2]));
  CHECK(z[3] == Approx(13.0));
  CHECK(steps.column("x_um")[2] == Approx(-4.0));
  const RunFile totals = displacements_of(import_text(log), CorrectionEntry::total);
  CHECK(totals.column("z_um")[3] == Approx(-5.0));
  SECTION("two tools are two logs") {
    std::string two = log;
    two.replace(two.find("T5;Z;0,005"), 2, "T7");
    CHECK_THROWS_WITH(displacements_of(import_text(two), CorrectionEntry::step),
                      Contains("several tools or places need a log each"));
  }
  SECTION("an axis has one column") {
    CHECK_THROWS_WITH(displacements_of(import_text("time_s,z_um,Z_mm\n0,1,0.001\n1,2,0.002\n"),
                                       CorrectionEntry::step),
                      Contains("Z_mm: is a second column of corrections of axis z"));
  }
  SECTION("a number without a unit is no displacement") {
    ColumnMap signals;
    signals.takes_signals = true;
    const RunFile run = parse_run(
        "time,axis,value\n2026-11-20 10:12:03,Z,-12\n"
        "2026-11-20 11:02:44,Z,-6\n2026-11-20 11:02:44,X,1\n",
        "log", {}, &signals);
    CHECK_THROWS_WITH(displacements_of(run, CorrectionEntry::step),
                      Contains("has no unit of a correction"));
  }
}
