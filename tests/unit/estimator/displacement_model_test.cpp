#include "estimator/model/displacement_model.hpp"

#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

using Vector = std::vector<double>;

ThermalModel two_by_two() {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC"};
  model.outputs = {"x_um", "z_um"};
  model.matrix_um_per_K = {{5.0, 0.5}, {-2.0, 3.0}};
  return model;
}

ThermalModel without_matrix(const std::vector<std::string>& outputs = {"z_um"}) {
  ThermalModel model;
  model.inputs = {"t1_degC"};
  model.outputs = outputs;
  model.matrix_um_per_K.assign(outputs.size(), {0.0});
  return model;
}

Vector displacement(DisplacementModel& model, nanoseconds now, const Vector& temps_degC,
                    const Vector& reference_degC, const Vector& signals, std::size_t outputs) {
  Vector out(outputs, 99.0);
  model.step(now, temps_degC, reference_degC, signals, out);
  return out;
}

/// The only output at `now`, reference 0.
double single(DisplacementModel& model, nanoseconds now, const Vector& temps_degC,
              const Vector& signals = {}) {
  return displacement(model, now, temps_degC, Vector(temps_degC.size(), 0.0), signals, 1)[0];
}

}  // namespace

TEST_CASE("the displacement is the matrix times the rise over the reference", "[displacement]") {
  DisplacementModel model(two_by_two());
  CHECK(displacement(model, 1s, {22.0, 24.0}, {20.0, 20.0}, {}, 2) == Vector{12.0, 8.0});
  CHECK(displacement(model, 2s, {20.0, 20.0}, {20.0, 20.0}, {}, 2) == Vector{0.0, 0.0});
  CHECK(displacement(model, 3s, {19.0, 20.0}, {20.0, 20.0}, {}, 2) == Vector{-5.0, 2.0});
}

TEST_CASE("a guideway's row is that of the position: at nodes, between, and beyond the ends",
          "[displacement]") {
  ThermalModel spec = two_by_two();
  spec.guideways = {
      {"column", "y_mm", {0.0, 100.0, 400.0}, {{"z_um", {{1.0, 0.0}, {3.0, 10.0}, {-3.0, 40.0}}}}}};
  DisplacementModel model(spec);
  const auto z_um = [&](double y_mm) {
    return displacement(model, 1s, {1.0, 2.0}, {0.0, 0.0}, {y_mm}, 2);
  };
  // The matrix alone gives x = 6, z = 4; the rows give 1, 23, 77.
  CHECK(z_um(0.0) == Vector{6.0, 5.0});
  CHECK(z_um(100.0) == Vector{6.0, 27.0});
  CHECK(z_um(400.0) == Vector{6.0, 81.0});
  CHECK(z_um(50.0)[1] == Approx(4.0 + 12.0));
  CHECK(z_um(200.0)[1] == Approx(4.0 + 23.0 + (77.0 - 23.0) / 3));
  CHECK(z_um(-1000.0)[1] == Approx(5.0));
  CHECK(z_um(1e6)[1] == Approx(81.0));
}

TEST_CASE("a lag follows a step exactly for any step length", "[displacement]") {
  // d = g (LP(T) - T): after a step of 10 K it is -g 10 exp(-t / tau).
  ThermalModel spec = without_matrix();
  spec.terms = {
      {"thermal_lag", "t1_degC", {{"tau_s", 900.0}}, {{"gain_um_per_K", {{"z_um", 1.2}}}}}};
  for (const int step_s : {1, 7, 60, 899, 5000}) {
    DisplacementModel model(spec);
    CHECK(single(model, 0s, {0.0}) == 0.0);
    // The input is constant over a step.
    int time_s = 0;
    for (int i = 0; i < 20; ++i) {
      time_s += step_s;
      CHECK(single(model, std::chrono::seconds(time_s), {10.0}) ==
            Approx(-12.0 * std::exp(-time_s / 900.0)).margin(1e-12));
    }
  }
}

TEST_CASE("a missing heat source heats up with the signal, linear or squared", "[displacement]") {
  for (const double power : {1.0, 2.0}) {
    ThermalModel spec = without_matrix();
    spec.terms = {{"missing_heat_source",
                   "spindle_rpm",
                   {{"tau_s", 1800.0}, {"power", power}},
                   {{"gain_um_per_unit", {{"z_um", 0.004}}}}}};
    DisplacementModel model(spec);
    CHECK(single(model, 0s, {20.0}, {0.0}) == 0.0);
    const double heat = std::pow(3000.0, power);
    for (int i = 1; i <= 50; ++i)
      CHECK(single(model, i * 120s, {20.0}, {3000.0}) ==
            Approx(0.004 * heat * -std::expm1(-120.0 * i / 1800.0)));
  }
}

TEST_CASE("a missing temperature acts without lag unless tau_s is given", "[displacement]") {
  for (const double tau_s : {0.0, 600.0}) {
    ThermalModel spec = without_matrix();
    spec.terms = {{"missing_temperature",
                   "room_degC",
                   {{"tau_s", tau_s}},
                   {{"gain_um_per_K", {{"z_um", -3.0}}}}}};
    REQUIRE(spec.temperature_columns() == std::vector<std::string>{"t1_degC", "room_degC"});
    DisplacementModel model(spec);
    CHECK(single(model, 0s, {5.0, 0.0}) == 0.0);
    for (int i = 1; i <= 20; ++i) {
      const double share = tau_s > 0 ? -std::expm1(-30.0 * i / tau_s) : 1.0;
      CHECK(single(model, i * 30s, {5.0, 2.0}) == Approx(-6.0 * share));
    }
  }
}

TEST_CASE("speed growth follows the squared speed without lag", "[displacement]") {
  ThermalModel spec = without_matrix();
  spec.terms = {{"speed_growth", "spindle_rpm", {}, {{"gain_um_per_unit2", {{"z_um", 1e-7}}}}}};
  DisplacementModel model(spec);
  CHECK(single(model, 0s, {0.0}, {10000.0}) == Approx(10.0));
  CHECK(single(model, 1s, {0.0}, {-2000.0}) == Approx(0.4));
  CHECK(single(model, 2s, {0.0}, {0.0}) == 0.0);
}

TEST_CASE("hinges form a piecewise linear curve of a signal", "[displacement]") {
  ThermalModel spec = without_matrix();
  for (const auto& [above, gain] : {std::pair{1000.0, 2e-3}, std::pair{3000.0, -5e-3}})
    spec.terms.push_back({"signal_hinge",
                          "spindle_rpm",
                          {{"above", above}},
                          {{"gain_um_per_unit", {{"z_um", gain}}}}});
  DisplacementModel model(spec);
  CHECK(single(model, 0s, {0.0}, {-500.0}) == 0.0);
  CHECK(single(model, 1s, {0.0}, {1000.0}) == 0.0);
  CHECK(single(model, 2s, {0.0}, {3000.0}) == Approx(4.0));
  CHECK(single(model, 3s, {0.0}, {5000.0}) == Approx(-2.0));
}

TEST_CASE("a term acts on its named outputs, in their order", "[displacement]") {
  ThermalModel spec = without_matrix({"x_um", "y_um", "z_um"});
  spec.terms = {{"speed_growth",
                 "spindle_rpm",
                 {},
                 {{"gain_um_per_unit2", {{"z_um", 3.0}, {"x_um", -1.0}}}}}};
  DisplacementModel model(spec);
  CHECK(displacement(model, 0s, {0.0}, {0.0}, {2.0}, 3) == Vector{-4.0, 0.0, 12.0});
}

TEST_CASE("a restart starts the lags at their input's value", "[displacement]") {
  ThermalModel spec = without_matrix();
  spec.terms = {
      {"thermal_lag", "t1_degC", {{"tau_s", 900.0}}, {{"gain_um_per_K", {{"z_um", 1.0}}}}}};
  DisplacementModel model(spec);
  single(model, 0s, {0.0});
  CHECK(single(model, 1s, {10.0}) < -9.0);
  model.restart();
  CHECK(single(model, 2s, {10.0}) == 0.0);
}

TEST_CASE("a reloaded model keeps the states of unchanged terms", "[displacement]") {
  ThermalModel spec = without_matrix();
  const TermSpec slow{
      "thermal_lag", "t1_degC", {{"tau_s", 900.0}}, {{"gain_um_per_K", {{"z_um", 1.0}}}}};
  const TermSpec fast{
      "thermal_lag", "t1_degC", {{"tau_s", 10.0}}, {{"gain_um_per_K", {{"z_um", 1.0}}}}};
  spec.terms = {fast, slow};
  DisplacementModel before(spec);
  single(before, 0s, {0.0});
  single(before, 100s, {10.0});

  SECTION("with a new gain, at another place in the file") {
    TermSpec stronger = slow;
    stronger.per_output["gain_um_per_K"]["z_um"] = 2.0;
    spec.terms = {stronger};
    DisplacementModel after(spec);
    const auto plan = after.plan_terms(before);
    CHECK(plan == std::vector<int>{1});
    after.adopt_terms(before, plan);
    CHECK(single(after, 200s, {10.0}) == Approx(-20.0 * std::exp(-200.0 / 900.0)));
  }
  SECTION("a term with another time constant starts anew") {
    TermSpec other = slow;
    other.shared["tau_s"] = 901.0;
    spec.terms = {other};
    DisplacementModel after(spec);
    CHECK(after.plan_terms(before) == std::vector<int>{-1});
    after.adopt_terms(before, after.plan_terms(before));
    CHECK(single(after, 200s, {10.0}) == 0.0);
  }
}

TEST_CASE("a model whose shapes or names do not fit is refused", "[displacement]") {
  const auto refused = [](auto change) {
    ThermalModel model = two_by_two();
    model.guideways = {{"g", "y_mm", {0.0, 1.0}, {{"z_um", {{0, 0}, {0, 0}}}}}};
    change(model);
    CHECK_THROWS_AS(DisplacementModel(model), InvalidValue);
  };
  refused([](ThermalModel& model) { model.matrix_um_per_K.pop_back(); });
  refused([](ThermalModel& model) { model.matrix_um_per_K[1].push_back(1.0); });
  refused([](ThermalModel& model) { model.guideways[0].positions_mm = {0.0}; });
  refused([](ThermalModel& model) { model.guideways[0].positions_mm = {1.0, 1.0}; });
  refused([](ThermalModel& model) { model.guideways[0].rows_um_per_K["z_um"].pop_back(); });
  refused([](ThermalModel& model) { model.guideways[0].rows_um_per_K["q_um"] = {{0, 0}, {0, 0}}; });
  refused([](ThermalModel& model) { model.terms = {{"magic", "t1_degC", {}, {}}}; });
  refused([](ThermalModel& model) { model.terms = {{"thermal_lag", "t1_degC", {}, {}}}; });
  refused([](ThermalModel& model) {
    model.terms = {
        {"thermal_lag", "t9_degC", {{"tau_s", 1.0}}, {{"gain_um_per_K", {{"z_um", 1.0}}}}}};
  });
}

namespace {

/// One temperature on two time scales and the square of a speed, in addition to the matrix.
ThermalModel with_bank() {
  ThermalModel model = two_by_two();
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.subjects = {"t1_degC", "spindle_rpm"};
  term.bank.powers = {1.0, 2.0};
  term.bank.taus_s = {0.0, 100.0};
  term.bank.gain_um_per_unit["z_um"] = {{0.0, 1.5}, {2e-6, 0.0}};
  model.terms = {term};
  return model;
}

}  // namespace

TEST_CASE("a bank of lags adds each subject's low passes with their gains", "[displacement]") {
  DisplacementModel model(with_bank());
  const Vector reference{0.0, 0.0};
  CHECK(displacement(model, 1s, {0.0, 0.0}, reference, {0.0}, 2) == Vector{0.0, 0.0});
  const Vector later = displacement(model, 101s, {4.0, 0.0}, reference, {1000.0}, 2);
  CHECK(later[0] == Approx(20.0));
  // -2 * 4, the lag after one time constant, and 2e-6 * 1000^2 without lag.
  CHECK(later[1] == Approx(-8.0 + 1.5 * 4.0 * (1.0 - std::exp(-1.0)) + 2.0));
}

TEST_CASE("a bank of lags equals thermal_lag and missing_heat_source", "[displacement]") {
  ThermalModel plain = two_by_two();
  plain.terms = {
      {"thermal_lag", "t2_degC", {{"tau_s", 700.0}}, {{"gain_um_per_K", {{"x_um", 3.0}}}}},
      {"missing_heat_source",
       "spindle_rpm",
       {{"tau_s", 700.0}, {"power", 1.0}},
       {{"gain_um_per_unit", {{"x_um", 1e-3}}}}}};
  ThermalModel bank = two_by_two();
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.subjects = {"t2_degC", "spindle_rpm"};
  term.bank.taus_s = {0.0, 700.0};
  term.bank.gain_um_per_unit["x_um"] = {{-3.0, 3.0}, {0.0, 1e-3}};
  bank.terms = {term};
  DisplacementModel one(plain);
  DisplacementModel other(bank);
  for (int i = 0; i < 200; ++i) {
    const nanoseconds now = std::chrono::seconds(i * (1 + i % 7));
    if (i > 0 && now <= std::chrono::seconds((i - 1) * (1 + (i - 1) % 7))) continue;
    const Vector temps{20.0 + 0.1 * i, 20.0 + std::sin(0.1 * i)};
    const Vector signals{i % 50 < 20 ? 3000.0 : 0.0};
    const double first = displacement(one, now, temps, {20.0, 20.0}, signals, 2)[0];
    CHECK(displacement(other, now, temps, {20.0, 20.0}, signals, 2)[0] == Approx(first));
  }
}

TEST_CASE("a bank keeps its state over a reload with other gains, and loses it with other lags",
          "[displacement]") {
  const Vector reference{0.0, 0.0};
  DisplacementModel old_model(with_bank());
  static_cast<void>(displacement(old_model, 1s, {0.0, 0.0}, reference, {0.0}, 2));
  static_cast<void>(displacement(old_model, 51s, {4.0, 0.0}, reference, {0.0}, 2));

  ThermalModel spec = with_bank();
  spec.terms[0].bank.gain_um_per_unit["z_um"] = {{0.0, 3.0}, {0.0, 0.0}};
  DisplacementModel other_gains(spec);
  const std::vector<int> plan = other_gains.plan_terms(old_model);
  CHECK(plan == std::vector<int>{0});
  other_gains.adopt_terms(old_model, plan);
  const Vector after = displacement(other_gains, 101s, {4.0, 0.0}, reference, {0.0}, 2);
  CHECK(after[1] == Approx(-8.0 + 3.0 * 4.0 * (1.0 - std::exp(-1.0))));

  spec.terms[0].bank.taus_s = {0.0, 101.0};
  CHECK(DisplacementModel(spec).plan_terms(old_model) == std::vector<int>{-1});
}

TEST_CASE("a large bank's state is saved, loaded and adopted completely", "[displacement]") {
  ThermalModel spec = two_by_two();
  TermSpec term;
  term.kind = "lag_bank";
  for (int i = 0; i < 60; ++i)
    term.bank.subjects.push_back(std::string("s").append(std::to_string(i)).append("_on"));
  term.bank.taus_s = {10.0, 100.0, 1000.0};
  term.bank.gain_um_per_unit["x_um"].assign(60, {1.0, 2.0, 3.0});
  spec.terms = {term};
  DisplacementModel one(spec);
  DisplacementModel other(spec);
  const Vector zero{0.0, 0.0};
  for (int i = 0; i < 20; ++i)
    static_cast<void>(displacement(one, std::chrono::seconds(i), zero, zero, Vector(60, i % 3), 2));
  other.adopt_terms(one, other.plan_terms(one));
  CHECK(displacement(one, 25s, zero, zero, Vector(60, 1.0), 2) ==
        displacement(other, 25s, zero, zero, Vector(60, 1.0), 2));
}

TEST_CASE("a bank's value without lag is that of the call, also at the same time",
          "[displacement]") {
  // A held state is evaluated again at its own time, with the slides elsewhere.
  ThermalModel spec = without_matrix();
  TermSpec term;
  term.kind = "lag_bank";
  term.bank.subjects = {"x_mm"};
  term.bank.taus_s = {0.0, 100.0};
  term.bank.gain_um_per_unit["z_um"] = {{0.5, 0.25}};
  spec.terms = {term};
  DisplacementModel model(spec);
  CHECK(single(model, 1s, {0.0}, {0.0}) == 0.0);
  CHECK(single(model, 1s, {0.0}, {10.0}) == 5.0);
}

TEST_CASE("a bank whose shapes or names do not fit is refused", "[displacement]") {
  ThermalModel spec = with_bank();
  spec.terms[0].bank.gain_um_per_unit["z_um"].pop_back();
  CHECK_THROWS_AS(DisplacementModel(spec), InvalidValue);
  spec = with_bank();
  spec.terms[0].bank.powers = {1.0};
  CHECK_THROWS_AS(DisplacementModel(spec), InvalidValue);
  spec = with_bank();
  spec.terms[0].bank.gain_um_per_unit["q_um"] = spec.terms[0].bank.gain_um_per_unit["z_um"];
  CHECK_THROWS_AS(DisplacementModel(spec), InvalidValue);
}

TEST_CASE("the slope is the steady-state effect of a small rise for all terms", "[displacement]") {
  const auto term = [](const char* kind, const char* subject, const char* gain, double value) {
    TermSpec spec;
    spec.kind = kind;
    spec.subject = subject;
    if (*gain != '\0') spec.per_output[gain] = {{"z_um", value}};
    return spec;
  };
  ThermalModel spec = two_by_two();
  spec.guideways = {{"column", "y_mm", {0.0, 100.0}, {{"z_um", {{1.0, 0.0}, {3.0, 10.0}}}}}};
  spec.terms = {term("wrong_coefficient", "t1_degC", "delta_um_per_K", 0.75),
                term("nonlinear_expansion", "t2_degC", "gain_um_per_K2", 0.25),
                term("missing_temperature", "room_degC", "gain_um_per_K", -1.5),
                term("position_dependence", "t2_degC|y_mm", "gain_um_per_K_mm", 0.01),
                term("thermal_lag", "t2_degC", "gain_um_per_K", 0.5),
                term("sensor_swap", "t1_degC|t2_degC", "", 0.0),
                term("start_dependence", "t2_degC|room_degC", "gain_um_per_unit_K", 0.02)};
  spec.terms[6].shared = {{"at_start", 0.0}, {"place0_degC", -1.0}, {"tau_s", 60.0}};
  spec.terms[2].shared["tau_s"] = 600.0;
  spec.terms[3].shared["p0_mm"] = 20.0;
  spec.terms[4].shared["tau_s"] = 300.0;
  DisplacementModel model(spec);
  REQUIRE(spec.temperature_columns().size() == 3);
  const Vector signals{60.0};
  const auto z_um = [&](const Vector& rise_K) {
    model.restart();  // every lag has settled
    return displacement(model, 1s, rise_K, Vector(3, 0.0), signals, 2)[1];
  };
  const Vector rise_K{4.0, 3.0, 2.0};
  Vector slope(3);
  z_um(rise_K);  // a term that multiplies two values uses those of the last step
  // The slope is taken at the true rises, which here are exchanged.
  model.slope(1, Vector{3.0, 4.0, 2.0}, signals, slope);
  for (std::size_t i = 0; i < 3; ++i) {
    Vector more = rise_K;
    Vector less = rise_K;
    more[i] += 1e-3;
    less[i] -= 1e-3;
    CAPTURE(i);
    CHECK(slope[i] == Approx((z_um(more) - z_um(less)) / 2e-3));
  }
}

TEST_CASE("the slope uses a lag's transient where larger than its steady state", "[displacement]") {
  ThermalModel spec = two_by_two();
  TermSpec lag;
  lag.kind = "thermal_lag";
  lag.subject = "t2_degC";
  lag.shared["tau_s"] = 300.0;
  lag.per_output["gain_um_per_K"] = {{"z_um", -2.0}};
  spec.terms = {lag};
  const DisplacementModel model(spec);
  Vector slope(2);
  model.slope(1, Vector{1.0, 1.0}, {}, slope);
  CHECK(slope == Vector{-2.0, 5.0});  // 3 + 2 at first, 3 in steady state
}

TEST_CASE("the certainty of an offset uses the largest effect that a bank may still have",
          "[displacement]") {
  ThermalModel spec = with_bank();  // z: -2 at first, then -0.5
  const DisplacementModel model(spec);
  Vector slope(2);
  model.slope(1, Vector{1.0, 1.0}, Vector{0.0}, slope);
  CHECK(slope == Vector{-2.0, 3.0});
  spec.terms[0].bank.gain_um_per_unit["z_um"] = {{1.0, 9.0}, {0.0, 0.0}};
  const DisplacementModel more(spec);  // -2, then -1, then 8
  more.slope(1, Vector{1.0, 1.0}, Vector{0.0}, slope);
  CHECK(slope == Vector{8.0, 3.0});
}

TEST_CASE("a diameter moves its axis by half, with its sign, for all parts of a model",
          "[model][property]") {
  ThermalModel model = two_by_two();
  model.outputs = {"dia_um", "z_um"};
  model.matrix_um_per_K = {{4.0, -2.0}, {1.0, 1.0}};
  model.guideways = {{"x", "x_mm", {0.0, 100.0}, {{"dia_um", {{0.0, 0.0}, {2.0, 0.0}}}}}};
  model.terms = {
      {"thermal_lag", "t1_degC", {{"tau_s", 600.0}}, {{"gain_um_per_K", {{"dia_um", 1.5}}}}},
      {"hysteresis", "dia_um", {{"width_um", 3.0}}, {}}};
  for (const double sign : {1.0, -1.0}) {
    model.diameters = {{"dia_um", "x", sign}};
    DisplacementModel whole(model);
    DisplacementModel of_axis(in_axis_units(model));
    const std::vector<double> reference(model.temperature_columns().size(), 20.0);
    std::vector<double> dia_um(2);
    std::vector<double> axis_um(2);
    for (int i = 0; i < 200; ++i) {
      const std::vector<double> temps{20.0 + 5.0 * std::sin(0.1 * i), 20.0 + 0.02 * i};
      const std::vector<double> signals{50.0 + 40.0 * std::cos(0.07 * i)};
      whole.step(i * 60s, temps, reference, signals, dia_um);
      of_axis.step(i * 60s, temps, reference, signals, axis_um);
      CHECK(axis_um[0] == Approx(0.5 * sign * dia_um[0]).margin(1e-12));
      CHECK(axis_um[1] == dia_um[1]);
    }
  }
}
