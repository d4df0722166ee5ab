#include <catch2/catch.hpp>

#include "modelling/identification/families/families.hpp"

using namespace thermocomp;
using identification::in_frame;

namespace {

ThermalModel matrix(std::vector<std::string> inputs, std::vector<std::string> outputs,
                    std::vector<std::vector<double>> rows) {
  ThermalModel model;
  model.inputs = std::move(inputs);
  model.outputs = std::move(outputs);
  model.matrix_um_per_K = std::move(rows);
  return model;
}

}  // namespace

TEST_CASE("a fitted model takes inputs, outputs and other rows of the daemon's model", "[frame]") {
  const ThermalModel frame =
      matrix({"a_degC", "b_degC", "c_degC"}, {"x_um", "z_um"}, {{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}});
  ThermalModel fitted = matrix({"c_degC", "a_degC"}, {"z_um"}, {{7.0, 8.0}});
  fitted.terms = {
      {"thermal_lag", "c_degC", {{"tau_s", 60.0}}, {{"gain_um_per_K", {{"z_um", 1.0}}}}}};
  std::vector<std::string> notes;
  const ThermalModel model = in_frame(fitted, frame, notes);
  CHECK(model.inputs == frame.inputs);
  CHECK(model.outputs == frame.outputs);
  CHECK(model.matrix_um_per_K ==
        std::vector<std::vector<double>>{{1.0, 2.0, 3.0}, {8.0, 0.0, 7.0}});
  CHECK(model.terms.size() == 1);
  CHECK(notes == std::vector<std::string>{"x_um: not fitted, keeps the row of --like"});
}

TEST_CASE("columns that the frame lacks are appended", "[frame]") {
  const ThermalModel frame = matrix({"a_degC"}, {"x_um"}, {{1.0}});
  std::vector<std::string> notes;
  const ThermalModel model = in_frame(matrix({"b_degC"}, {"z_um"}, {{2.0}}), frame, notes);
  CHECK(model.inputs == std::vector<std::string>{"a_degC", "b_degC"});
  CHECK(model.matrix_um_per_K == std::vector<std::vector<double>>{{1.0, 0.0}, {0.0, 2.0}});
  REQUIRE(notes.size() == 2);
  CHECK_THAT(notes[1], Catch::Contains("z_um: no output of the model of --like"));
}

TEST_CASE("a frame that was itself fitted gives its names only", "[frame]") {
  ThermalModel frame = matrix({"a_degC", "b_degC"}, {"x_um"}, {{1.0, 2.0}});
  frame.terms = {{"wrong_coefficient", "a_degC", {}, {{"delta_um_per_K", {{"x_um", 1.0}}}}}};
  frame.covariance_K2 = {{1.0, 0.0}, {0.0, 1.0}};
  std::vector<std::string> notes;
  const ThermalModel model = in_frame(matrix({"b_degC"}, {"x_um"}, {{3.0}}), frame, notes);
  CHECK(model.inputs == frame.inputs);
  CHECK(model.matrix_um_per_K == std::vector<std::vector<double>>{{0.0, 3.0}});
  CHECK(model.terms.empty());
  CHECK(model.covariance_K2.empty());
  CHECK(notes.size() == 2);
}

TEST_CASE("a frame with terms of an output that is not fitted is refused", "[frame]") {
  ThermalModel frame = matrix({"a_degC"}, {"x_um", "z_um"}, {{1.0}, {1.0}});
  frame.terms = {{"wrong_coefficient", "a_degC", {}, {{"delta_um_per_K", {{"x_um", 1.0}}}}}};
  std::vector<std::string> notes;
  CHECK_THROWS_WITH(in_frame(matrix({"a_degC"}, {"z_um"}, {{2.0}}), frame, notes),
                    Catch::Contains("x_um of that model was not fitted"));
}
