// What the other sensors say of a supposed fault of one reading.

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <random>
#include <string>
#include <vector>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "modelling/diagnosis/causes/cause.hpp"
#include "modelling/diagnosis/data/measured_runs.hpp"
#include "modelling/diagnosis/rank/fits.hpp"

using namespace thermocomp;
using namespace thermocomp::diagnosis;

namespace {

constexpr int rows = 500;
constexpr double step_s = 60.0;
constexpr std::size_t t1 = 0;
constexpr std::size_t t2 = 1;
/// What a fault makes of t2.
using Fault = std::function<double(int row, double t2_degC, double room_degC)>;

double untouched(int, double t2_degC, double) {
  return t2_degC;
}

double loose(int row, double t2_degC, double room_degC) {
  return row < rows / 2 ? t2_degC : room_degC + 0.5 * (t2_degC - room_degC);
}

double creeping(int row, double t2_degC, double) {
  return t2_degC + 0.15 * row * step_s / 3600.0;
}

/// t2 is what t1 and t3 say, t3 late; a converter reads all in steps of 0.1 K.
RunFile run_of(const std::string& name, unsigned seed, const Fault& fault) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 0.03);
  const auto read = [&](double value) { return std::round((value + noise(random)) * 10.0) / 10.0; };
  RunFile run;
  run.name = name;
  run.columns = {"time_s", "t1_degC", "t2_degC", "t3_degC", "room_degC", "z_um"};
  run.values.resize(run.columns.size());
  double late_K = 0.0;
  for (int row = 0; row < rows; ++row) {
    const double one_K = 6.0 * -std::expm1(-row / 150.0) + 2.0 * std::sin(row / 60.0 + seed);
    const double three_K = 4.0 * std::sin(row / 90.0 + 2.0 * seed);
    late_K += (three_K - late_K) * -std::expm1(-step_s / 1800.0);
    const double room = 20.0 + 0.5 * std::sin(row / 200.0 + seed);
    const double two = 22.0 + 0.5 * one_K + 0.4 * late_K;
    run.values[0].push_back(step_s * row);
    run.values[1].push_back(read(21.0 + one_K));
    run.values[2].push_back(read(fault(row, two, room)));
    run.values[3].push_back(read(21.0 + three_K));
    run.values[4].push_back(read(room));
    run.values[5].push_back(5.0 * (two - 22.0));
  }
  run.selected_end = run.rows();
  return run;
}

MeasuredData data_of(const std::vector<RunFile>& runs) {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC", "t3_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{0.5, 5.0, 0.5}};
  return measured_data(model, runs, shared_columns(model, runs));
}

/// ln L that the reading adds for a fault of the first run from a moment on.
double support(const MeasuredData& data, const char* cause, std::size_t sensor, double onset_s) {
  const std::vector<Hypothesis> all = hypotheses(data);
  const auto of = std::find_if(all.begin(), all.end(), [&](const Hypothesis& each) {
    return each.cause == cause && each.sensor == sensor && each.run == std::size_t{0};
  });
  REQUIRE(of != all.end());
  Readings readings(data);
  return Fits(data, readings, {}).trials(*of, {{onset_s}}).front().witness;
}

constexpr double half_s = step_s * rows / 2;

}  // namespace

TEST_CASE("other readings support a loose sensor, not its neighbour", "[diagnosis]") {
  const MeasuredData data = data_of({run_of("a.csv", 1, loose), run_of("b.csv", 2, untouched)});
  CHECK(support(data, "sensor_loose", t2, half_s) > 50.0);
  CHECK(support(data, "sensor_loose", t1, half_s) < 0.0);
}

TEST_CASE("other readings do not support a loose sensor without the fault", "[diagnosis]") {
  const MeasuredData data = data_of({run_of("a.csv", 1, untouched), run_of("b.csv", 2, untouched)});
  CHECK(support(data, "sensor_loose", t2, half_s) < 3.0);
}

TEST_CASE("a run without the fault adds support for a creeping reading", "[diagnosis]") {
  const RunFile faulty = run_of("a.csv", 1, creeping);
  const double alone = support(data_of({faulty}), "sensor_drift", t2, 0.0);
  const double beside =
      support(data_of({faulty, run_of("b.csv", 2, untouched)}), "sensor_drift", t2, 0.0);
  CAPTURE(alone, beside);
  CHECK(beside > alone + 5.0);
}
