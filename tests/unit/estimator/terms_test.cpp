#include <cmath>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/estimator_config.hpp"
#include "estimator/model/displacement_model.hpp"
#include "estimator/model/terms/low_pass.hpp"
#include "estimator/model/terms/play.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

using Vector = std::vector<double>;

/// z = 2 T1 + 5 T2, w = -T1 + 3 T2.
ThermalModel with_terms(std::vector<TermSpec> terms) {
  ThermalModel model;
  model.inputs = {"t1_degC", "t2_degC"};
  model.outputs = {"z_um", "w_um"};
  model.matrix_um_per_K = {{2.0, 5.0}, {-1.0, 3.0}};
  model.terms = std::move(terms);
  return model;
}

/// Displacement with all references at 20 degC.
Vector at(DisplacementModel& model, nanoseconds now, Vector rise_K, const Vector& signals = {}) {
  for (double& value : rise_K) value += 20.0;
  Vector out(2, 99.0);
  model.step(now, rise_K, Vector(rise_K.size(), 20.0), signals, out);
  return out;
}

Vector at_rest(const std::vector<TermSpec>& terms, const Vector& rise_K,
               const Vector& signals = {}) {
  DisplacementModel model(with_terms(terms));
  return at(model, 0s, rise_K, signals);
}

nanoseconds seconds_of(double seconds) {
  return std::chrono::duration_cast<nanoseconds>(seconds_d(seconds));
}

}  // namespace

TEST_CASE("a wrong coefficient adds its difference", "[terms]") {
  const TermSpec term{"wrong_coefficient", "t2_degC", {}, {{"delta_um_per_K", {{"z_um", -0.5}}}}};
  CHECK(at_rest({term}, {1.0, 4.0}) == Vector{2.0 + 20.0 - 2.0, -1.0 + 12.0});
}

TEST_CASE("nonlinear expansion is the squared rise, of inputs and of other temperatures",
          "[terms]") {
  const auto squared = [](const std::string& subject) {
    return TermSpec{"nonlinear_expansion", subject, {}, {{"gain_um_per_K2", {{"w_um", 0.25}}}}};
  };
  CHECK(at_rest({squared("t1_degC")}, {-4.0, 0.0})[1] == Approx(4.0 + 4.0));
  const ThermalModel other = with_terms({squared("room_degC")});
  CHECK(other.temperature_columns() == std::vector<std::string>{"t1_degC", "t2_degC", "room_degC"});
  CHECK(at_rest({squared("room_degC")}, {0.0, 0.0, 2.0})[1] == Approx(1.0));
}

TEST_CASE("position dependence is a lever around p0, whichever column comes first", "[terms]") {
  const auto lever = [](const std::string& subject) {
    return TermSpec{"position_dependence",
                    subject,
                    {{"p0_mm", 100.0}},
                    {{"gain_um_per_K_mm", {{"z_um", 0.01}}}}};
  };
  CHECK(at_rest({lever("t1_degC|x_mm")}, {3.0, 0.0}, {300.0})[0] == Approx(6.0 + 6.0));
  CHECK(at_rest({lever("a_mm|t1_degC")}, {3.0, 0.0}, {0.0})[0] == Approx(6.0 - 3.0));
  CHECK(with_terms({lever("a_mm|t1_degC")}).signal_columns() == std::vector<std::string>{"a_mm"});
}

TEST_CASE("the coefficients depend on the start of the day: the two published equations",
          "[terms]") {
  const auto term = [](const std::string& subject, double at_start, double tau_s, double gain) {
    return TermSpec{"start_dependence",
                    subject,
                    {{"at_start", at_start}, {"place0_degC", 0.0}, {"tau_s", tau_s}},
                    {{"gain_um_per_unit_K", {{"z_um", gain}}}}};
  };
  // C1 = [a1 + a2 T0 + a3 T1] dTs with a1 = 2 (the matrix), a2 = 0.1, a3 = -0.03; room at 23.
  const double tau_s = 1800.0 / std::log(10.0);
  DisplacementModel bed(
      with_terms({term("t1_degC|t1_degC", 1, 0, 0.1), term("t1_degC|room_degC", 0, 0, -0.03)}));
  CHECK(at(bed, 0s, {4.0, 0.0, 3.0})[0] == Approx((2.0 + 0.1 * 20.0 - 0.03 * 23.0) * 4.0));
  // C2 = N [b1 + b2 T0 + b3 T1] {1 - exp(ln 0.1 t / 30)}, t in minutes since the speed was set.
  ThermalModel spindle = with_terms({term("spindle_rpm|t1_degC", 1, tau_s, 1e-4),
                                     term("spindle_rpm|room_degC", 0, tau_s, -2e-5)});
  spindle.terms.push_back({"missing_heat_source",
                           "spindle_rpm",
                           {{"power", 1.0}, {"tau_s", tau_s}},
                           {{"gain_um_per_unit", {{"z_um", 5e-3}}}}});
  DisplacementModel bearing(spindle);
  CHECK(at(bearing, 0s, {0.0, 0.0, 3.0}, {0.0})[0] == 0.0);
  const double share = 1.0 - std::pow(0.1, 20.0 / 30.0);
  CHECK(at(bearing, 1200s, {0.0, 0.0, 3.0}, {3000.0})[0] ==
        Approx(3000.0 * (5e-3 + 1e-4 * 20.0 - 2e-5 * 23.0) * share));
}

TEST_CASE("the start of a day is the reference, not the place's present temperature", "[terms]") {
  const TermSpec start{"start_dependence",
                       "t1_degC|t2_degC",
                       {{"at_start", 1.0}, {"place0_degC", 18.0}, {"tau_s", 0.0}},
                       {{"gain_um_per_unit_K", {{"w_um", 0.5}}}}};
  const ThermalModel spec = with_terms({start});
  const auto w_um = [&spec](double began_degC, double now_degC) {
    DisplacementModel model(spec);
    Vector out(2);
    model.step(0s, Vector{22.0, now_degC}, Vector{20.0, began_degC}, {}, out);
    return out[1];
  };
  CHECK(w_um(18.0, 18.0) == Approx(-2.0));        // as at X0: the matrix alone
  CHECK(w_um(20.0, 20.0) == Approx(-2.0 + 2.0));  // began 2 K warmer: 0.5 * 2 * 2
  CHECK(w_um(20.0, 25.0) - 3.0 * 5.0 == Approx(w_um(20.0, 20.0)));
}

TEST_CASE("exchanged channels are corrected before any other term", "[terms]") {
  const TermSpec swap{"sensor_swap", "t1_degC|t2_degC", {}, {}};
  CHECK(at_rest({swap}, {1.0, 4.0}) == Vector{2.0 * 4.0 + 5.0, -4.0 + 3.0});
  // Another term names the place, not the channel.
  const TermSpec term{"nonlinear_expansion", "t1_degC", {}, {{"gain_um_per_K2", {{"z_um", 1.0}}}}};
  CHECK(at_rest({term, swap}, {1.0, 4.0})[0] == Approx(13.0 + 16.0));
}

TEST_CASE("play follows only when its width is used up, at any speed", "[terms]") {
  for (const double step : {0.01, 0.5, 10.0}) {
    Play play(2.0);
    const auto go = [&](double from, double to) {
      double out = 0.0;
      for (double u = from; (to - from) * (to - u) > 0; u += to > from ? step : -step)
        out = play.step(u);
      out = play.step(to);
      return out;
    };
    CHECK(play.step(0.0) == 0.0);
    CHECK(go(0.0, 0.9) == 0.0);
    CHECK(go(0.9, 10.0) == Approx(9.0));
    CHECK(go(10.0, 8.5) == Approx(9.0));
    CHECK(go(8.5, 0.0) == Approx(1.0));
  }
}

TEST_CASE("play of an output acts on the sum of matrix and terms of that output alone", "[terms]") {
  const TermSpec lever{"wrong_coefficient", "t1_degC", {}, {{"delta_um_per_K", {{"z_um", 1.0}}}}};
  DisplacementModel model(with_terms({{"hysteresis", "z_um", {{"width_um", 4.0}}, {}}, lever}));
  CHECK(at(model, 0s, {0.0, 0.0}) == Vector{0.0, 0.0});
  CHECK(at(model, 1s, {4.0, 0.0}) == Vector{10.0, -4.0});
  CHECK(at(model, 2s, {3.0, 0.0}) == Vector{10.0, -3.0});
  CHECK(at(model, 3s, {0.0, 0.0}) == Vector{2.0, 0.0});
  model.restart();
  CHECK(at(model, 4s, {1.0, 0.0}) == Vector{3.0, -1.0});
}

TEST_CASE("play of a temperature acts on its part of every output", "[terms]") {
  DisplacementModel model(with_terms({{"hysteresis", "t1_degC", {{"width_K", 1.0}}, {}}}));
  CHECK(at(model, 0s, {0.0, 0.0}) == Vector{0.0, 0.0});
  CHECK(at(model, 1s, {4.0, 1.0}) == Vector{7.0 + 5.0, -3.5 + 3.0});
  CHECK(at(model, 2s, {3.0, 0.0}) == Vector{7.0, -3.5});
}

TEST_CASE("a slow sensor that warms exponentially is corrected to the true temperature",
          "[terms]") {
  const double structure_s = 3600.0;
  const double sensor_s = 240.0;
  DisplacementModel model(with_terms({{"slow_sensor", "t1_degC", {{"tau_s", sensor_s}}, {}}}));
  for (double t_s = 0.0; t_s < 20000.0; t_s += 15.0) {
    const double truth_K = 10.0 * -std::expm1(-t_s / structure_s);
    const double reading_K =
        10.0 *
        (1.0 - (structure_s * std::exp(-t_s / structure_s) - sensor_s * std::exp(-t_s / sensor_s)) /
                   (structure_s - sensor_s));
    const double z_um = at(model, seconds_of(t_s), {reading_K, 0.0})[0];
    if (t_s > 600.0) CHECK(z_um / 2.0 == Approx(truth_K).margin(0.03));
  }
}

TEST_CASE("a lead starts at the reading, and survives an outage and a step without time",
          "[terms]") {
  Lead lead(100.0);
  CHECK(lead.step(10s, 30.0) == 30.0);
  CHECK(lead.step(10s, 30.0) == 30.0);
  const double after_outage_K = lead.step(100000s, 35.0);
  CHECK(after_outage_K == Approx(35.0).margin(0.01));
  lead.restart();
  CHECK(lead.step(100001s, 50.0) == 50.0);
  // Noise of single readings grows by at most five.
  CHECK(lead.step(100001s + 1ms, 51.0) < 50.0 + 5.0);
}

TEST_CASE("a reload keeps the states of plays and leads", "[terms]") {
  const std::vector<TermSpec> terms = {{"hysteresis", "t1_degC", {{"width_K", 2.0}}, {}},
                                       {"slow_sensor", "t2_degC", {{"tau_s", 60.0}}, {}}};
  DisplacementModel before(with_terms(terms));
  at(before, 0s, {0.0, 0.0});
  at(before, 10s, {10.0, 1.0});
  DisplacementModel after(with_terms({terms[1], terms[0]}));
  after.adopt_terms(before, after.plan_terms(before));
  CHECK(at(after, 20s, {9.0, 2.0}) == at(before, 20s, {9.0, 2.0}));
}

TEST_CASE("a subject that the model does not have is refused", "[terms]") {
  const auto refused = [](const TermSpec& term) {
    CHECK_THROWS_AS(DisplacementModel(with_terms({term})), InvalidValue);
  };
  refused({"sensor_swap", "t1_degC|t9_degC", {}, {}});
  refused({"sensor_swap", "t1_degC", {}, {}});
  refused({"hysteresis", "q_um", {{"width_um", 1.0}}, {}});
  refused({"hysteresis", "t9_degC", {{"width_K", 1.0}}, {}});
  refused({"hysteresis", "z_um", {{"width_K", 1.0}}, {}});
  refused({"slow_sensor", "room_degC", {{"tau_s", 1.0}}, {}});
}
