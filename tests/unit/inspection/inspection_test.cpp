// Tests of the inspection on a machine with six places and two heat sources: planted faults are
// found, and none on the unchanged machine.
#include "modelling/inspection/inspection.hpp"

#include <algorithm>
#include <cmath>
#include <random>

#include <catch2/catch.hpp>

using namespace thermocomp;
using namespace thermocomp::inspection;

namespace {

constexpr std::size_t rows = 700;

/// Twelve hours with a row per minute; three speed levels and a wandering room.
RunFile recording(unsigned seed = 1) {
  RunFile run;
  run.name = "run.csv";
  run.columns = {"time_s",  "spindle_rpm", "t1_degC", "t2_degC", "t3_degC",
                 "t4_degC", "t5_degC",     "t6_degC", "z_um"};
  run.values.assign(run.columns.size(), {});
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.02);
  double spindle = 0.0;
  double body = 0.0;
  double room = 20.0;
  for (std::size_t row = 0; row < rows; ++row) {
    const double rpm = 1500.0 * static_cast<double>((row / 110) % 3);
    spindle += (rpm / 250.0 - spindle) / 25.0;
    body += (spindle - body) / 90.0;
    room += noise(random);
    const double shares[6][2] = {{1, 0}, {0.8, 0.2}, {0.5, 0.5}, {0.1, 0.9}, {0, 1}, {0.3, 0.4}};
    run.values[0].push_back(60.0 * static_cast<double>(row));
    run.values[1].push_back(rpm);
    for (std::size_t i = 0; i < 6; ++i)
      run.values[2 + i].push_back(room + shares[i][0] * spindle + shares[i][1] * body +
                                  noise(random));
    run.values[8].push_back(4.0 * spindle + 6.0 * body + 10.0 * noise(random));
  }
  run.selected_end = rows;
  return run;
}

std::vector<double>& column(RunFile& run, const std::string& name) {
  return run.values[*run.find(name)];
}

const Finding* find(const Inspection& inspection, const std::string& kind) {
  const auto found = std::find_if(inspection.findings.begin(), inspection.findings.end(),
                                  [&](const Finding& each) { return each.kind == kind; });
  return found == inspection.findings.end() ? nullptr : &*found;
}

}  // namespace

TEST_CASE("offsets of the compensation are not displacements of the machine", "[inspection]") {
  RunFile run = recording();
  for (const char* name : {"z_offset_um", "z_applied_um", "z_measured_um"}) {
    run.columns.emplace_back(name);
    run.values.emplace_back(rows, 0.0);
    for (std::size_t row = 300; row < rows; row += 40) run.values.back()[row] = 18.0;
  }
  for (const Finding& each : inspect({run}).findings)
    CHECK_THAT(each.column, !Catch::Contains("z_"));
}

TEST_CASE("a controller's error code in a signal is named", "[inspection]") {
  RunFile run = recording();
  column(run, "spindle_rpm")[333] = 65535.0;
  const Inspection inspection = inspect({run}, 0.5);
  const Finding* found = find(inspection, "spikes");
  REQUIRE(found != nullptr);
  CHECK(found->column == "spindle_rpm");
  CHECK(found->probability > 0.9);
  CHECK(found->text.find("stray values (1) of up to 65535 rpm") != std::string::npos);
}

TEST_CASE("a reading in kelvin from some row on is named as such", "[inspection]") {
  RunFile run = recording();
  for (std::size_t row = 500; row < rows; ++row) column(run, "t4_degC")[row] += 273.15;
  const Inspection inspection = inspect({run}, 0.5);
  REQUIRE_FALSE(inspection.findings.empty());
  CHECK(inspection.findings[0].column == "t4_degC");
  CHECK(inspection.findings[0].text.find("in kelvin") != std::string::npos);
}

TEST_CASE("nothing is found in a faultless recording", "[inspection]") {
  for (unsigned seed = 1; seed <= 3; ++seed) {
    const Inspection inspection = inspect({recording(seed)});
    INFO(inspection_text(inspection));
    CHECK(inspection.findings.empty());
    CHECK(inspection.runs.front().step_s == 60.0);
    CHECK(inspection.runs.front().gaps.empty());
    REQUIRE(inspection.excited.size() == 1);
    CHECK(inspection.excited.front().second);
  }
}

TEST_CASE("a reading that jumps is named with its time and size, and its neighbours are not",
          "[inspection]") {
  RunFile run = recording();
  for (std::size_t row = 400; row < rows; ++row) column(run, "t3_degC")[row] += 2.0;
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  REQUIRE(inspection.findings.size() == 1);
  const Finding& finding = inspection.findings.front();
  CHECK(finding.kind == "sensor_step");
  CHECK(finding.column == "t3_degC");
  CHECK(finding.at_s == Approx(24000.0).margin(60.0));
  CHECK(finding.size == Approx(2.0).margin(0.1));
  const Cleaned clean = cleaned({run}, inspection);
  CHECK(clean.notes.size() == 1);
  CHECK(clean.runs.front().column("t3_degC")[500] ==
        Approx(run.column("t3_degC")[500] - 2.0).margin(0.1));
}

TEST_CASE("only steps of displacements are removed before a fit, above or below 1 um",
          "[inspection]") {
  const double size_um = GENERATE(40.0, 0.5);
  RunFile run = recording();
  if (size_um < 1.0)
    for (double& each : column(run, "z_um")) each *= 0.01;
  CHECK(without_steps({run}, {"z_um"}).notes.empty());
  const RunFile still = run;
  for (std::size_t row = 300; row < rows; ++row) column(run, "z_um")[row] += size_um;
  for (std::size_t row = 400; row < rows; ++row) column(run, "t3_degC")[row] += 2.0;
  const Cleaned clean = without_steps({run}, {"z_um"});
  REQUIRE(clean.notes.size() == 1);
  CHECK_THAT(clean.notes.front(), Catch::Contains("z_um jumps") && Catch::Contains("subtracted"));
  CHECK(clean.runs.front().column("z_um")[500] ==
        Approx(still.column("z_um")[500]).margin(0.1 * size_um));
  CHECK(clean.runs.front().column("t3_degC") == run.column("t3_degC"));
  CHECK(without_steps({run}, {}).notes.empty());
  run.selected_end = 300;  // rows after the selection are ignored
  CHECK(without_steps({run}, {"z_um"}).notes.empty());
}

TEST_CASE("the leap after a stuck displacement is no step of its zero", "[inspection]") {
  RunFile run = recording();
  std::vector<double>& z_um = column(run, "z_um");
  std::fill(z_um.begin() + 225, z_um.begin() + 265, z_um[225]);
  REQUIRE(std::abs(z_um[265] - z_um[225]) > 5.0);
  CHECK(without_steps({run}, {"z_um"}).notes.empty());
  CHECK(find(inspect({run}), "displacement_step") == nullptr);
}

TEST_CASE("noise of a signal does not hide a step of a displacement, a change of the signal does",
          "[inspection]") {
  const bool operated = GENERATE(false, true);
  RunFile run = recording();
  run.columns.emplace_back("current_A");
  run.values.emplace_back();
  std::mt19937 random(2);
  std::normal_distribution<double> noise_A(0.0, 0.03);
  for (std::size_t row = 0; row < rows; ++row)
    run.values.back().push_back((operated && row >= 500 ? 5.0 : 6.0) + noise_A(random));
  for (std::size_t row = 500; row < rows; ++row) column(run, "z_um")[row] += 40.0;
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  CHECK((find(inspection, "displacement_step") != nullptr) == !operated);
}

TEST_CASE("a module's outage is a gap, not a step of its sensors", "[inspection]") {
  RunFile run = recording();
  for (const char* name : {"t1_degC", "t2_degC"})
    for (std::size_t row = 215; row < 240; ++row) column(run, name)[row] = std::nan("");
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  CHECK(find(inspection, "sensor_step") == nullptr);
  const std::pair<double, double> away{214 * 60.0, 240 * 60.0};
  CHECK(inspection.runs.front().gaps == std::vector{away});
  REQUIRE(inspection.findings.size() == 1);
  CHECK(inspection.findings.front().text ==
        "t1_degC, t2_degC have no value for 26 min after 3 h 34 min.");
  CHECK_THAT(inspection_html({run}, inspection), Catch::Contains("t1_degC, t2_degC"));
}

TEST_CASE("single places do not form a group", "[inspection]") {
  Inspection inspection;
  inspection.groups = {{"t1_degC"}, {"t2_degC"}};
  CHECK_THAT(inspection_text(inspection), Catch::Contains("No two places correlate above 0.98."));
  CHECK_THAT(inspection_html({recording()}, inspection),
             Catch::Contains("No two places correlate above 0.98."));
  inspection.groups = {{"t1_degC", "t2_degC"}, {"t3_degC"}};
  CHECK_THAT(inspection_text(inspection),
             Catch::Contains("correlate above 0.98:\n  t1_degC, t2_degC\n"));
  CHECK_THAT(inspection_text(inspection), !Catch::Contains("t3_degC"));
}

TEST_CASE("a heater that switches on and off causes a ramp, not a step of a sensor",
          "[inspection]") {
  // Without a signal: the bed warms by 4 K per row for six rows, holds, and cools.
  for (unsigned seed = 1; seed <= 3; ++seed) {
    RunFile run = recording(seed);
    std::vector<double>& bed = column(run, "t3_degC");
    double warm = 0.0;
    for (std::size_t row = 0; row < rows; ++row) {
      if (row >= 200 && row < 206) warm += 4.0;
      if (row >= 420) warm *= 0.97;
      bed[row] += warm;
      column(run, "t4_degC")[row] += 0.05 * warm;
    }
    const Inspection inspection = inspect({run});
    INFO(inspection_text(inspection));
    CHECK(find(inspection, "sensor_step") == nullptr);
  }
}

TEST_CASE("the most probable drift is that of the drifting reading", "[inspection]") {
  RunFile run = recording();
  for (std::size_t row = 0; row < rows; ++row)
    column(run, "t4_degC")[row] += 4.0 * static_cast<double>(row) / static_cast<double>(rows);
  const Inspection inspection = inspect({run}, 0.0);
  INFO(inspection_text(inspection));
  const Finding* finding = find(inspection, "sensor_drift");
  REQUIRE(finding != nullptr);
  CHECK(finding->column == "t4_degC");
  CHECK(finding->size == Approx(4.0).margin(1.0));
}

TEST_CASE("spikes are found one by one, and replaced", "[inspection]") {
  RunFile run = recording();
  for (const std::size_t row : {50U, 300U, 640U}) column(run, "t2_degC")[row] -= 3.0;
  const Inspection inspection = inspect({run});
  const Finding* finding = find(inspection, "spikes");
  REQUIRE(finding != nullptr);
  CHECK(finding->column == "t2_degC");
  CHECK(finding->times_s == std::vector<double>{3000, 18000, 38400});
  const Cleaned clean = cleaned({run}, inspection);
  CHECK(clean.runs.front().column("t2_degC")[300] ==
        Approx(run.column("t2_degC")[299]).margin(0.3));
}

TEST_CASE("the values of an open thermocouple are spikes, however many, and no step",
          "[inspection]") {
  const std::size_t last = GENERATE(425U, rows);
  RunFile run = recording();
  std::fill_n(column(run, "t3_degC").begin() + 300, last - 300, 850.0);
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  REQUIRE(find(inspection, "spikes") != nullptr);
  CHECK(find(inspection, "spikes")->times_s.size() == last - 300);
  CHECK(find(inspection, "sensor_step") == nullptr);
  const double left = cleaned({run}, inspection).runs.front().column("t3_degC")[350];
  CHECK(std::isnan(left));
  // A setpoint has levels.
  run = recording();
  std::vector<double>& target = column(run, "t3_degC");
  std::fill(target.begin(), target.end(), 20.0);
  std::fill_n(target.begin() + 300, 50, 250.0);
  CHECK(find(inspect({run}), "spikes") == nullptr);
}

TEST_CASE("a value during a jump, or in a noisy stretch, is not a spike", "[inspection]") {
  RunFile run = recording();
  std::mt19937 random(5);
  std::normal_distribution<double> gust(0.0, 0.5);
  for (std::size_t row = 100; row < 300; ++row)
    column(run, "t5_degC")[row] +=
        std::sin(M_PI * static_cast<double>(row - 100) / 200.0) * gust(random);
  for (std::size_t row = 300; row < rows; ++row)
    column(run, "z_um")[row] -= row < 302 ? 85.0 : 68.0;
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  CHECK(find(inspection, "spikes") == nullptr);
  CHECK(find(inspection, "outliers") == nullptr);
}

TEST_CASE("a reading controlled to a setpoint is not stuck", "[inspection]") {
  RunFile run = recording();
  for (std::size_t row = 330; row < 430; ++row) column(run, "t1_degC")[row] = 40.0;
  REQUIRE(find(inspect({run}), "stuck") != nullptr);
  run.columns.emplace_back("heater_target");
  run.values.emplace_back(rows, 40.0);
  CHECK(find(inspect({run}), "stuck") == nullptr);
}

TEST_CASE("a reading in kelvin is named, a nozzle of 250 degC is not", "[inspection]") {
  RunFile run = recording();
  const auto name = *std::find_if(run.columns.begin(), run.columns.end(),
                                  [](const std::string& each) { return each.ends_with("_degC"); });
  const std::vector<double> degC = column(run, name);
  for (double& value : column(run, name)) value += 273.15;
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  REQUIRE(find(inspection, "unit") != nullptr);
  CHECK(find(inspection, "unit")->column == name);
  for (std::size_t row = 0; row < degC.size(); ++row)
    column(run, name)[row] = 250.0 + 0.1 * degC[row];
  CHECK(find(inspect({run}), "unit") == nullptr);
}

TEST_CASE("readings in steps of 1 K that stay at a step are not stuck", "[inspection]") {
  RunFile run = recording();
  for (const std::string& name : run.columns)
    if (name.ends_with("_degC"))
      for (double& value : column(run, name)) value = std::round(value / 2.0);
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  CHECK(find(inspection, "coarse") != nullptr);
  CHECK(find(inspection, "stuck") == nullptr);
}

TEST_CASE("a corner of the course is no outlier", "[inspection]") {
  // Up and down by 6 um per row, noise 0.5 um.
  RunFile run = recording();
  std::mt19937 random(3);
  std::normal_distribution<double> noise_um(0.0, 0.5);
  for (std::size_t row = 0; row < rows; ++row) {
    const auto phase = static_cast<double>(row % 160);
    column(run, "z_um")[row] = 6.0 * std::min(phase, 160.0 - phase) + noise_um(random);
  }
  CHECK(find(inspect({run}), "outliers") == nullptr);
  column(run, "z_um")[300] += 100.0;
  const Inspection inspection = inspect({run});
  REQUIRE(find(inspection, "outliers") != nullptr);
  CHECK(find(inspection, "outliers")->times_s == std::vector<double>{18000});
}

TEST_CASE("exchanged readings are found among alike runs, not among runs of other operation",
          "[inspection]") {
  const auto is_exchanged = [](const std::vector<RunFile>& runs) {
    return find(inspect(runs), "sensor_swap") != nullptr;
  };
  std::vector<RunFile> runs{recording(1), recording(2), recording(3)};
  CHECK_FALSE(is_exchanged(runs));
  std::swap(column(runs[1], "t1_degC"), column(runs[1], "t4_degC"));
  CHECK(is_exchanged(runs));
  // A second heater beside t1 or t4 that only one of two runs uses.
  runs = {recording(1), recording(2)};
  const char* heated[] = {"t1_degC", "t4_degC"};
  for (std::size_t r = 0; r < 2; ++r)
    for (std::size_t row = 0; row < rows; ++row)
      column(runs[r], heated[r])[row] += 4.0 * std::sin(0.03 * static_cast<double>(row));
  CHECK_FALSE(is_exchanged(runs));
}

TEST_CASE("stuck, coarse and duplicate readings are reported", "[inspection]") {
  RunFile run = recording();
  for (std::size_t row = 330; row < 430; ++row)
    column(run, "t1_degC")[row] = column(run, "t1_degC")[330];
  for (double& value : column(run, "t6_degC")) value = 0.5 * std::round(2.0 * value);
  column(run, "t5_degC") = column(run, "t4_degC");
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  REQUIRE(find(inspection, "stuck") != nullptr);
  CHECK(find(inspection, "stuck")->column == "t1_degC");
  REQUIRE(find(inspection, "coarse") != nullptr);
  CHECK(find(inspection, "coarse")->size == Approx(0.5));
  REQUIRE(find(inspection, "copy") != nullptr);
  CHECK(find(inspection, "copy")->column == "t5_degC");
  CHECK(find(inspection, "copy")->other == "t4_degC");
}

TEST_CASE("a displacement that keeps one value is stuck, and has no step at its end",
          "[inspection]") {
  RunFile run = recording();
  std::fill_n(column(run, "z_um").begin() + 300, 120, column(run, "z_um")[300]);
  const Inspection inspection = inspect({run});
  REQUIRE(find(inspection, "stuck") != nullptr);
  CHECK(find(inspection, "stuck")->column == "z_um");
  CHECK(find(inspection, "stuck")->at_s == 300 * 60.0);
  CHECK(find(inspection, "displacement_step") == nullptr);
}

TEST_CASE("hours of noise of one reading are named; of all, or with a speed, they are not",
          "[inspection]") {
  RunFile run = recording();
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.4);
  const auto add_to = [&](const std::string& name) {
    for (std::size_t row = 240; row < 320; ++row) column(run, name)[row] += noise(random);
  };
  add_to("t3_degC");
  const Inspection inspection = inspect({run});
  REQUIRE(find(inspection, "noise") != nullptr);
  CHECK(find(inspection, "noise")->column == "t3_degC");
  CHECK(find(inspection, "noise")->at_s == Approx(240 * 60.0).margin(900.0));
  CHECK(find(inspection, "noise")->size == Approx(20.0).margin(8.0));
  SECTION("with a speed that no other rows have") {
    for (std::size_t row = 240; row < 320; ++row) column(run, "spindle_rpm")[row] = 9000.0;
    CHECK(find(inspect({run}), "noise") == nullptr);
  }
  SECTION("of all") {
    for (const char* name : {"t1_degC", "t2_degC", "t4_degC", "t5_degC", "t6_degC"}) add_to(name);
    CHECK(find(inspect({run}), "noise") == nullptr);
  }
}

TEST_CASE("a reading that is tenfold or negative is named, a cold and a hot one are not",
          "[inspection]") {
  const auto factor = GENERATE(10.0, -1.0, 0.1);
  RunFile run = recording();
  for (double& value : column(run, "t3_degC")) value *= factor;
  const Inspection inspection = inspect({run});
  INFO(inspection_text(inspection));
  REQUIRE(find(inspection, "unit") != nullptr);
  CHECK(find(inspection, "unit")->column == "t3_degC");
  CHECK(find(inspection, "unit")->size == factor);
  run = recording();
  for (double& value : column(run, "t1_degC")) value += 180.0;
  for (double& value : column(run, "t2_degC")) value -= 40.0;
  CHECK(find(inspect({run}), "unit") == nullptr);
}

TEST_CASE("a displacement that agrees with other runs only when multiplied is named",
          "[inspection]") {
  const auto factor = GENERATE(10.0, -1.0);
  std::vector<RunFile> runs{recording(1), recording(2), recording(3)};
  CHECK(find(inspect(runs), "unit") == nullptr);
  for (double& value : column(runs[1], "z_um")) value *= factor;
  const Inspection inspection = inspect(runs);
  REQUIRE(find(inspection, "unit") != nullptr);
  CHECK(find(inspection, "unit")->column == "z_um");
  CHECK(find(inspection, "unit")->run == 1);
  CHECK(find(inspection, "unit")->size == factor);
}

TEST_CASE("a time in minutes is named beside a run in seconds, rows each second are not",
          "[inspection]") {
  RunFile minutes = recording(2);
  for (double& at : minutes.values[0]) at /= 60.0;
  const Inspection inspection = inspect({recording(1), minutes});
  REQUIRE(find(inspection, "clock") != nullptr);
  CHECK(find(inspection, "clock")->run == 1);
  CHECK(find(inspection, "clock")->size == 60.0);
  RunFile seconds = recording(3);
  for (std::size_t i = 0; i < seconds.columns.size(); ++i)
    for (std::size_t row = 0; row < rows; ++row)
      seconds.values[i][row] = i == 0 ? static_cast<double>(row) : seconds.values[i][row / 60];
  CHECK(find(inspect({recording(1), seconds}), "clock") == nullptr);
}

TEST_CASE("rows of a sensor's code are spikes", "[inspection]") {
  RunFile run = recording();
  std::fill_n(column(run, "t3_degC").begin() + 300, 20, 85.0);
  const Inspection inspection = inspect({run});
  REQUIRE(find(inspection, "spikes") != nullptr);
  CHECK(find(inspection, "spikes")->times_s.size() == 20);
}

TEST_CASE("a gap and a clock set forward are distinguished", "[inspection]") {
  RunFile run = recording();
  RunFile gap = run;
  for (std::vector<double>& values : gap.values)
    values.erase(values.begin() + 200, values.begin() + 260);
  gap.selected_end = gap.rows();
  REQUIRE(find(inspect({gap}), "gap") != nullptr);
  CHECK(find(inspect({gap}), "clock") == nullptr);
  for (std::size_t row = 250; row < rows; ++row) column(run, "time_s")[row] += 3600.0;
  const Inspection inspection = inspect({run});
  REQUIRE(find(inspection, "clock") != nullptr);
  CHECK(find(inspection, "clock")->at_s == 249 * 60.0);
}

TEST_CASE("a clock set back by less than a row is found, a row between two others is none",
          "[inspection]") {
  RunFile shifted = recording();
  for (std::size_t row = 250; row < rows; ++row) column(shifted, "time_s")[row] -= 50.0;
  REQUIRE(find(inspect({shifted}), "clock") != nullptr);
  RunFile between = recording();
  for (std::vector<double>& values : between.values)
    values.insert(values.begin() + 250, values[249]);
  column(between, "time_s")[250] += 3.0;
  between.selected_end = between.rows();
  CHECK(find(inspect({between}), "clock") == nullptr);
}

TEST_CASE("a signal that never changed is not identifiable, and an experiment is proposed",
          "[inspection]") {
  RunFile run = recording();
  std::fill(column(run, "spindle_rpm").begin(), column(run, "spindle_rpm").end(), 1000.0);
  const Inspection inspection = inspect({run});
  REQUIRE(inspection.excited.size() == 1);
  CHECK_FALSE(inspection.excited.front().second);
  REQUIRE_FALSE(inspection.experiments.empty());
  CHECK(inspection.experiments.front().find("spindle_rpm never changed") == 0);
}

TEST_CASE("two signals that always went together are reported once", "[inspection]") {
  RunFile run = recording();
  run.columns.emplace_back("load_percent");
  run.values.push_back(column(run, "spindle_rpm"));
  for (double& value : run.values.back()) value /= 30.0;
  const std::string text = inspection_text(inspect(std::vector<RunFile>{run}));
  CHECK(text.find("spindle_rpm always went with load_percent: run") != std::string::npos);
  CHECK(text.find("load_percent always went with") == std::string::npos);
  CHECK(text.find("run.csv: 700 rows, one every 60 s, 0 gaps\n") == 0);
  CHECK(step_text(33.4) == "33.4 s");
  CHECK(step_text(13350.0) == "3.71 h");
}

TEST_CASE("the page shows each finding with its picture", "[inspection]") {
  RunFile run = recording();
  for (std::size_t row = 400; row < rows; ++row) column(run, "t3_degC")[row] += 2.0;
  const Inspection inspection = inspect({run});
  const std::string page = inspection_html({run}, inspection);
  CHECK(page.find("t3_degC jumps up by 2") != std::string::npos);
  CHECK(page.find("<svg") != std::string::npos);
}
