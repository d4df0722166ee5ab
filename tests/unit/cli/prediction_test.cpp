#include "cli/model/prediction.hpp"

#include <cmath>

#include <catch2/catch.hpp>

#include "config/runs/run_file.hpp"
#include "config/text/problems.hpp"

namespace {

using Catch::Matchers::Contains;
using thermocomp::parse_run;
using thermocomp::parse_selection;
using thermocomp::RunFile;
using thermocomp::ThermalModel;
using thermocomp::cli::as_run_file;
using thermocomp::cli::predict;
using thermocomp::cli::Prediction;

ThermalModel two_temperatures() {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC"};
  model.outputs = {"z_um"};
  model.matrix_um_per_K = {{2.0, -1.0}};
  return model;
}

TEST_CASE("a prediction is the model's change since the first row, beside the measured change",
          "[cli][predict]") {
  const RunFile run = parse_run(
      "time_s,t1_degC,t2_degC,z_um\n0,20,20,100\n10,21,20,103\n20,21,22,100.5\n", "run.csv");
  const Prediction result = predict(two_temperatures(), run);
  REQUIRE(result.time_s == std::vector<double>{0, 10, 20});
  const auto& z = result.outputs.at(0);
  CHECK(z.predicted_um == std::vector<double>{0, 2, 0});
  CHECK(z.measured_um == std::vector<double>{0, 3, 0.5});
  CHECK(z.rms_um == Approx(std::sqrt((0.0 + 1.0 + 0.25) / 3.0)));
  CHECK(z.peak_um == Approx(1.0));
}

TEST_CASE("displacement counts anew from each reference of an export", "[cli][predict]") {
  const RunFile run = parse_run(
      "time_s,t1_degC,t2_degC,z_um\n0,20,20,\n5,20.5,20,7\n10,21,20,9\n"
      "# 11.0 s: command reference\n20,25,20,1\n30,26,20,2.5\n",
      "run.csv");
  REQUIRE(run.references == std::vector<std::size_t>{3});
  const Prediction result = predict(two_temperatures(), run);
  REQUIRE(result.time_s == std::vector<double>{5, 10, 20, 30});
  const auto& z = result.outputs.at(0);
  CHECK(z.predicted_um == std::vector<double>{0, 1, 0, 2});
  CHECK(z.measured_um == std::vector<double>{0, 2, 0, 1.5});
  CHECK(z.peak_um == Approx(1.0));
}

TEST_CASE("a selection keeps reference and start at the file's first row", "[cli][predict]") {
  const auto selection = parse_selection("run.csv@10:20");
  const RunFile run =
      parse_run("time_s,t1_degC,t2_degC,z_um\n0,20,20,100\n10,21,20,103\n20,21,22,100.5\n",
                "run.csv", selection);
  const Prediction result = predict(two_temperatures(), run);
  REQUIRE(result.time_s == std::vector<double>{10});
  CHECK(result.outputs[0].predicted_um[0] == Approx(2.0));
  CHECK(result.outputs[0].measured_um[0] == Approx(3.0));
}

TEST_CASE("rows with a missing input or without any measured value are skipped", "[cli][predict]") {
  const RunFile run = parse_run(
      "time_s,t1_degC,t2_degC,z_um\n0,,20,100\n10,20,20,101\n20,21,nan,5\n30,21,20,\n40,22,20,"
      "105\n",
      "run.csv");
  const Prediction result = predict(two_temperatures(), run);
  CHECK(result.time_s == std::vector<double>{10, 40});
  CHECK(result.outputs[0].predicted_um.at(1) == Approx(4.0));
  CHECK(result.outputs[0].measured_um.at(1) == Approx(4.0));
}

TEST_CASE("a run without measured displacement is still predicted", "[cli][predict]") {
  const RunFile run = parse_run("time_s,t1_degC,t2_degC\n0,20,20\n10,21,20\n", "run.csv");
  const Prediction result = predict(two_temperatures(), run);
  CHECK(result.outputs[0].predicted_um == std::vector<double>{0, 2});
  CHECK(std::isnan(result.outputs[0].rms_um));
}

TEST_CASE("a missing column of the model is named with its file", "[cli][predict]") {
  const RunFile run = parse_run("time_s,t1_degC,z_um\n0,20,20\n10,21,20\n", "run.csv");
  CHECK_THROWS_WITH(predict(two_temperatures(), run), Contains("run.csv") && Contains("t2_degC"));
}

TEST_CASE("the unit stays last in the names of the predicted columns", "[cli][predict]") {
  const RunFile run = parse_run("time_s,t1_degC,t2_degC,z_um\n0,20,20,1\n", "run.csv");
  CHECK(as_run_file(predict(two_temperatures(), run)).columns ==
        std::vector<std::string>{"time_s", "z_predicted_um", "z_measured_um", "z_residual_um"});
}

TEST_CASE("the furthest row is reported with its main quantity", "[cli][predict]") {
  ThermalModel model = two_temperatures();
  thermocomp::MadeFrom made_from;
  made_from.runs = {"a.csv"};
  made_from.columns = {"t1_degC", "t2_degC"};
  made_from.low = {19.0, 19.0};
  made_from.high = {22.0, 22.0};
  made_from.taus_s = {0.0};
  made_from.mean = {20.0, 20.0, 0.0, 0.0};
  made_from.covariance = {{1, 0, 0.5, 0}, {0, 1, 0, 0.5}, {0.5, 0, 1, 0}, {0, 0.5, 0, 1}};
  made_from.distance_max = 2.0;
  made_from.outputs["z_um"] = {1.0, 0.1, 600.0, 1.5, 10.0, 8.0};
  model.made_from = made_from;
  const std::string header = "time_s,t1_degC,t2_degC,z_um\n0,20,20,0\n10,21,20,2\n";
  const Prediction inside = predict(model, parse_run(header, "run.csv"));
  CHECK(inside.furthest.distance < 1.0);
  CHECK(furthest_text(inside).empty());
  const Prediction outside = predict(model, parse_run(header + "20,18,30,-14\n", "run.csv"));
  // With S = [1 1/2; 1/2 1] of level and rise, both 10 K: 10^2 2 / (1 + 1/2); of t1 2^2 2 / (3/2).
  CHECK(outside.furthest.distance == Approx(std::sqrt((400.0 + 16.0) / 3.0 / 4.0) / 2.0));
  CHECK(
      furthest_text(outside) ==
      "at 20 s the machine was 2.9 times the limit away from the model's data, mostly by t2_degC: "
      "30 (recorded 19 to 22)");
}

}  // namespace
