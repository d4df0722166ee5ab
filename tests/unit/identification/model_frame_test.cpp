#include "modelling/identification/families/model_frame.hpp"

#include <catch2/catch.hpp>

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

TEST_CASE("a fitted model takes the frame of the daemon's, and its other rows", "[frame]") {
  const ThermalModel frame =
      matrix({"a_degC", "b_degC", "c_degC"}, {"x_um", "z_um"}, {{1.0, 2.0, 3.0}, {4.0, 5.0, 6.0}});
  ThermalModel fitted = matrix({"c_degC", "a_degC"}, {"z_um"}, {{7.0, 8.0}});
  fitted.terms = {
      {"thermal_lag", "c_degC", {{"tau_s", 60.0}}, {{"gain_um_per_K", {{"z_um", 1.0}}}}}};
  const ThermalModel model = in_frame(fitted, frame);
  CHECK(model.inputs == frame.inputs);
  CHECK(model.outputs == frame.outputs);
  CHECK(model.matrix_um_per_K ==
        std::vector<std::vector<double>>{{1.0, 2.0, 3.0}, {8.0, 0.0, 7.0}});
  CHECK(model.terms.size() == 1);
}

TEST_CASE("what the frame lacks comes behind it", "[frame]") {
  const ThermalModel frame = matrix({"a_degC"}, {"x_um"}, {{1.0}});
  const ThermalModel model = in_frame(matrix({"b_degC"}, {"z_um"}, {{2.0}}), frame);
  CHECK(model.inputs == std::vector<std::string>{"a_degC", "b_degC"});
  CHECK(model.matrix_um_per_K == std::vector<std::vector<double>>{{1.0, 0.0}, {0.0, 2.0}});
}

TEST_CASE("a frame whose terms would be lost is refused", "[frame]") {
  ThermalModel frame = matrix({"a_degC"}, {"x_um"}, {{1.0}});
  frame.terms = {{"wrong_coefficient", "a_degC", {}, {{"delta_um_per_K", {{"x_um", 1.0}}}}}};
  CHECK_THROWS_WITH(in_frame(matrix({"a_degC"}, {"x_um"}, {{2.0}}), frame),
                    Catch::Contains("which a fit cannot keep"));
}
