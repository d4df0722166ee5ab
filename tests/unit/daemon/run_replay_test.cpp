#include "daemon/history/replay/run_replay.hpp"

#include <cmath>
#include <sstream>

#include <catch2/catch.hpp>

#include "config/text/problems.hpp"
#include "history_fixture.hpp"

using namespace thermocomp;
using namespace thermocomp::testing;

namespace {

/// Without smoothing, with ample bound and slew limit: the offset is the negative displacement.
DaemonConfig plain_config() {
  ReplaySetup setup = machine_setup(2.0);
  for (SensorConfig& sensor : setup.estimator.sensors) {
    sensor.smoothing.form = SmoothingForm::off;
    sensor.screening.rate_K_per_s_max = 100.0;
  }
  for (AxisConfig& axis : setup.estimator.axes) {
    axis.limiter.offset_um_max = 500.0;
    axis.limiter.rate_um_per_s_max = 1000.0;
  }
  DaemonConfig config;
  config.estimator = setup.estimator;
  config.model = setup.model;
  return config;
}

/// Rows 15 s apart, with each temperature held until the offset has settled.
std::string warming_run(const char* columns) {
  std::ostringstream text;
  text << "time_s," << columns << "\n";
  for (int row = 0; row < 40; ++row) {
    const int step = row / 4;
    const double bed_degC = 20.0 + 0.25 * step;
    text << row * 15 << "," << bed_degC << "," << 21.0 << "," << 22.0 << "\n";
  }
  return text.str();
}

RunFile replayed(const DaemonConfig& config, const RunFile& run, RunReplaySummary* summary) {
  std::ostringstream out;
  const RunReplaySummary made = replay_run_file(config, run, out);
  if (summary != nullptr) *summary = made;
  return parse_run(out.str(), "out");
}

}  // namespace

TEST_CASE("without smoothing and limits the offset is the negative displacement", "[run_replay]") {
  const char* columns =
      GENERATE("bed_degC,column_degC,spindle_degC", "bed_in_degC,column_in_degC,spindle_in_degC");
  const RunFile run = parse_run(warming_run(columns), "run");
  RunReplaySummary summary;
  const RunFile out = replayed(plain_config(), run, &summary);
  REQUIRE(out.rows() == 40);
  CHECK(summary.rows == 40);
  CHECK(summary.step_period_s == 1.0);
  CHECK(summary.steps == 39 * 15 + 1);
  CHECK(summary.notes.size() == 3);  // each sensor: rows 15 s apart, stale after 5 s
  for (std::size_t row = 3; row < 40; row += 4) {
    const double expected_um = -2.0 * (run.values[1][row] - 20.0);
    CHECK(out.column("z_offset_um")[row] == Approx(expected_um).margin(1e-9));
    CHECK(out.column("z_displacement_um")[row] == Approx(-expected_um).margin(1e-9));
  }
}

TEST_CASE("a finer step of the same run gives the same offsets", "[run_replay]") {
  const std::string text = warming_run("bed_degC,column_degC,spindle_degC");
  const std::string dense = text + "585.02,22.25,21,22\n";  // two rows 20 ms apart
  RunReplaySummary coarse;
  RunReplaySummary fine;
  const RunFile a = replayed(plain_config(), parse_run(text, "a"), &coarse);
  const RunFile b = replayed(plain_config(), parse_run(dense, "b"), &fine);
  CHECK(fine.step_period_s == Approx(0.02));
  CHECK(fine.steps > 20 * coarse.steps);
  for (std::size_t row = 3; row < 40; row += 4) {
    CHECK(a.column("y_offset_um")[row] == Approx(b.column("y_offset_um")[row]).margin(1e-9));
  }
}

TEST_CASE("every missing column is named at once", "[run_replay]") {
  const RunFile run = parse_run("time_s,bed_degC\n0,20\n1,20\n", "run.csv");
  std::ostringstream out;
  try {
    replay_run_file(plain_config(), run, out);
    FAIL("accepted");
  } catch (const ConfigurationError& error) {
    CHECK(error.problems().size() == 2);
    CHECK(std::string(error.what()).find("column_degC") != std::string::npos);
    CHECK(std::string(error.what()).find("spindle_degC") != std::string::npos);
  }
}

TEST_CASE("a run with too many steps is refused", "[run_replay]") {
  const RunFile run = parse_run(
      "time_s,bed_degC,column_degC,spindle_degC\n0,20,20,20\n0.01,20,20,20\n1e12,20,20,20\n", "r");
  std::ostringstream out;
  CHECK_THROWS_AS(replay_run_file(plain_config(), run, out), ConfigurationError);
}
