#include "modelling/series/series.hpp"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <random>

#include <catch2/catch.hpp>

#include "../temp_folder.hpp"
#include "config/model/model_file.hpp"

namespace thermocomp::series {
namespace {

using Catch::Contains;
using Catch::WithinAbs;

/// z = gain_a (a - a0) + gain_b (b - b0), over hours; b follows a slowly.
RunFile run_of(unsigned seed, double gain_a, double gain_b, double hours = 12.0) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise;
  RunFile run;
  run.name = "run_" + std::to_string(seed);
  run.columns = {"time_s", "a_degC", "b_degC", "z_um"};
  run.values.resize(4);
  double a = 20.0;
  double b = 20.0;
  double heat = 0.0;
  const int rows = static_cast<int>(hours * 60.0);
  for (int i = 0; i < rows; ++i) {
    if (i % 50 == 10) heat = 10.0 * std::abs(noise(random));
    a += (20.0 + heat - a) / 20.0;
    b += (a - b) / 60.0 + 0.05 * noise(random);
    run.values[0].push_back(60.0 * i);
    run.values[1].push_back(a);
    run.values[2].push_back(b);
    run.values[3].push_back(gain_a * (a - run.values[1][0]) + gain_b * (b - run.values[2][0]) +
                            0.2 * noise(random));
  }
  run.selected_end = run.rows();
  return run;
}

RunFile renamed(RunFile run, const std::string& from, const std::string& to) {
  run.columns[*run.find(from)] = to;
  return run;
}

RunFile without(RunFile run, const std::string& column) {
  const auto at = static_cast<std::ptrdiff_t>(*run.find(column));
  run.columns.erase(run.columns.begin() + at);
  run.values.erase(run.values.begin() + at);
  return run;
}

Statistics statistics_of_run(const RunFile& run, const std::string& name) {
  std::vector<std::string> notes;
  return statistics_of({run}, name, {}, {0.0, 900.0}, notes);
}

std::vector<Statistics> sisters(int count = 6) {
  std::mt19937 random(1);
  std::normal_distribution<double> noise;
  std::vector<Statistics> machines;
  for (int i = 0; i < count; ++i)
    machines.push_back(statistics_of_run(
        run_of(static_cast<unsigned>(i), 5.0 + 0.5 * noise(random), -2.0 + 0.2 * noise(random)),
        std::string("machine ").append(std::to_string(i))));
  return machines;
}

std::filesystem::path written(const char* name, const std::string& text) {
  static const thermocomp::testing::TempFolder folder;
  const auto path = folder / name;
  std::ofstream(path) << text;
  return path;
}

TEST_CASE("the mean of sisters and a machine's adaptation are near its gains", "[series]") {
  const Series series = series_of(sisters(), std::nullopt);
  const OutputSeries& z = series.outputs.at("z_um");
  CHECK_THAT(z.mean[0] + z.mean[2], WithinAbs(5.0, 0.7));  // a, immediate and delayed
  CHECK_THAT(z.remainder_um, WithinAbs(0.2, 0.1));
  const Statistics machine = statistics_of_run(run_of(50, 6.5, -2.0, 3.0), "new");
  const Adapted result = adapted(series, machine, "series.toml");
  const double at_once = result.model.matrix_um_per_K[0][0];
  const double late = result.model.terms.at(0).bank.gain_um_per_unit.at("z_um")[0][1];
  CHECK_THAT(at_once + late, WithinAbs(6.5, 0.5));
  const MadeFrom::Output& stated = result.model.made_from->outputs.at("z_um");
  CHECK(stated.left_out_rms_um < 3.0);
  CHECK(stated.left_out_rms_um > 0.1);
  CHECK(parse_model(write_model(result.model), "m").matrix_um_per_K ==
        result.model.matrix_um_per_K);
}

TEST_CASE("a machine without a sensor gets its expectation from the others", "[series]") {
  const Series series = series_of(sisters(), std::nullopt);
  const RunFile run = run_of(50, 5.0, -2.0, 10.0);
  const Adapted result =
      adapted(series, statistics_of_run(without(run, "b_degC"), "new"), "series.toml");
  CHECK(result.model.inputs == std::vector<std::string>{"a_degC"});
  // With few rows it is the mean's gain, with b as far as a predicts it; not the gain of a alone.
  const Adapted few =
      adapted(series, statistics_of_run(without(run_of(51, 5.0, -2.0, 0.2), "b_degC"), "new"),
              "series.toml");
  const double gain = few.model.matrix_um_per_K[0][0] +
                      few.model.terms.at(0).bank.gain_um_per_unit.at("z_um")[0][1];
  CHECK(gain < 4.7);
  CHECK(gain > 2.5);
}

TEST_CASE("machines that do not fit together are refused by name", "[series]") {
  std::vector<Statistics> machines = sisters(2);
  const RunFile run = run_of(9, 5.0, -2.0);
  SECTION("one machine only") {
    machines.resize(1);
    CHECK_THROWS_WITH(series_of(machines, std::nullopt), Contains("one machine does not show"));
    CHECK_NOTHROW(series_of(machines, 0.15));
  }
  SECTION("another output") {
    machines.push_back(statistics_of_run(renamed(run, "z_um", "y_um"), "third"));
    CHECK_THROWS_WITH(series_of(machines, std::nullopt),
                      Contains("third: has no output z_um; it has y_um"));
  }
  SECTION("another unit of a temperature") {
    machines.push_back(statistics_of_run(renamed(run, "a_degC", "a_K"), "third"));
    CHECK_THROWS_WITH(series_of(machines, std::nullopt),
                      Contains("third: a_K: the series has a_degC, in another unit"));
  }
  SECTION("the same machine twice") {
    machines.push_back(machines.front());
    CHECK_THROWS_WITH(series_of(machines, std::nullopt), Contains("two machines"));
  }
  SECTION("no column in common") {
    const Series series = series_of(machines, std::nullopt);
    const Statistics other =
        statistics_of_run(renamed(renamed(run, "a_degC", "c_degC"), "b_degC", "d_degC"), "other");
    CHECK_THROWS_WITH(adapted(series, other, "s"), Contains("has none of the series'"));
  }
}

TEST_CASE("statistics and series survive writing and reading", "[series]") {
  const std::vector<Statistics> machines = sisters(2);
  const auto statistics_file = written("statistics.toml", write_statistics(machines[0]));
  CHECK(write_statistics(load_statistics(statistics_file)) == write_statistics(machines[0]));
  const Series series = series_of(machines, std::nullopt);
  std::string text = write_series(series);
  const auto series_file = written("series.toml", text);
  CHECK(write_series(load_series(series_file)) == text);
  const std::string past = write_series(own_series(series, machines[0], "series.toml", 0.05));
  CHECK(load_series(written("past.toml", past)).past_of == "machine 0");
  CHECK(write_series(load_series(written("past.toml", past))) == past);
  CHECK_THROWS_WITH(load_series(statistics_file), Contains("must be \"series\""));
  const auto at = text.find("covariance = [");
  text.replace(text.find_first_of("0123456789", at), 1, "-9");
  CHECK_THROWS_WITH(load_series(written("singular.toml", text)),
                    Contains("covariance") && Contains("must be symmetric and positive definite"));
}

TEST_CASE("a machine with another gain departs, and its sensor is named", "[series]") {
  const Series series = series_of(sisters(), std::nullopt);
  const auto healthy = compared(series, statistics_of_run(run_of(60, 5.2, -2.1), "healthy"));
  CHECK_FALSE(departs(healthy.at(0)));
  const auto other = compared(series, statistics_of_run(run_of(61, 5.0, 6.0), "other"));
  CHECK(departs(other.at(0)));
  CHECK(other[0].departure.parts.front().name == "b_degC");
}

TEST_CASE("the confidence in a machine's own past does not depend on the number of sisters",
          "[series]") {
  const Series series = series_of(sisters(2), std::nullopt);
  std::vector<std::string> notes;
  const Statistics past = statistics_of({run_of(80, 5.0, -2.0), run_of(81, 5.0, -2.0)}, "machine",
                                        {}, {0.0, 900.0}, notes);
  const Series own = own_series(series, past, "series.toml", 0.05);
  const auto healthy = compared(own, statistics_of_run(run_of(82, 5.1, -2.0), "healthy"));
  CHECK_FALSE(departs(healthy.at(0)));
  const Statistics changed = statistics_of_run(run_of(83, 6.0, -2.0), "changed");
  const auto beside_past = compared(own, changed);
  CHECK(departs(beside_past.at(0)));
  // The same distance with a covariance from these few sisters.
  Series of_type = own;
  of_type.past_of.clear();
  const auto beside_type = compared(of_type, changed);
  CHECK_THAT(beside_type[0].departure.distance2,
             WithinAbs(beside_past[0].departure.distance2, 1e-9));
  CHECK(beside_type[0].departure.probability > beside_past[0].departure.probability);
}

TEST_CASE("the more last year's model may have drifted, the more the rows override it",
          "[series]") {
  const Series series = series_of(sisters(), std::nullopt);
  ThermalModel last_year =
      adapted(series, statistics_of_run(run_of(70, 5.0, -2.0, 3.0), "new"), "series.toml").model;
  last_year.made_from->outputs.at("z_um").left_out_rms_um = 1e-3;
  const Statistics now = statistics_of_run(run_of(71, 7.0, -2.0, 3.0), "now");
  double before = 4.0;
  for (const double drift : {0.0, 0.002, 1.0}) {
    const Series prior = series_of_model(last_year, "old.toml", drift, 1.0);
    const Adapted result = adapted(prior, now, "old.toml");
    const double gain = result.model.matrix_um_per_K[0][0] +
                        result.model.terms.at(0).bank.gain_um_per_unit.at("z_um")[0][1];
    CHECK(gain > before);
    if (drift == 0.0) CHECK_THAT(gain, WithinAbs(5.0, 0.4));
    before = gain;
  }
  CHECK_THAT(before, WithinAbs(7.0, 0.5));
  ThermalModel other = last_year;
  other.terms.push_back({"thermal_lag", "a_degC", {{"tau_s", 900.0}}, {}});
  CHECK_THROWS_WITH(series_of_model(other, "old.toml", 0.05, 1.0),
                    Contains("the term thermal_lag is not a bank"));
}

}  // namespace
}  // namespace thermocomp::series
