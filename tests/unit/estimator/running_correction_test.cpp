#include <algorithm>
#include <cmath>
#include <random>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/learning/probings.hpp"
#include "small_machine.hpp"

using namespace thermocomp;

namespace {

CorrectionConfig config_of(CorrectionForm form) {
  CorrectionConfig config;
  config.form = form;
  config.groups = {{"t1_degC"}, {"t2_degC"}};
  config.step_um_max = 50.0;
  return config;
}

ThermalModel tie_model() {
  ThermalModel model = small_model();
  model.matrix_um_per_K = {{4.0, -2.0}};  // Ki, -Kc
  return model;
}

double model_um(double t1_K, double t2_K) {
  return 4.0 * t1_K - 2.0 * t2_K;
}

/// One probing of a machine whose true gains are `g`.
void probe(RunningCorrection& correction, nanoseconds now, double t1_K, double t2_K,
           const std::array<double, 2>& g, double noise_um = 0.0) {
  const std::vector<double> rise{t1_K, t2_K};
  correction.step(now, rise, true);
  correction.measured({g[0] * 4.0 * t1_K - g[1] * 2.0 * t2_K + noise_um, model_um(t1_K, t2_K)});
  correction.step(now, rise, true);
}

}  // namespace

TEST_CASE("in phase 1 the consistent gain makes the estimate equal the measurement",
          "[correction]") {
  RunningCorrection correction(config_of(CorrectionForm::two_phase), tie_model(), 0);
  probe(correction, 60s, 5.0, 1.0, {1.2, 1.0});
  CHECK(correction.report().gain[0] == Approx(1.2));
  CHECK(correction.report().gain[1] == 1.0);
  CHECK(model_um(5.0, 1.0) + correction.correction_um() == Approx(1.2 * 20.0 - 2.0));
}

TEST_CASE("the printed form agrees with it only while the tie is cold", "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::two_phase);
  config.first_gain = FirstGain::eq_34;
  RunningCorrection cold(config, tie_model(), 0);
  probe(cold, 60s, 5.0, 0.0, {1.2, 1.0});
  CHECK(cold.report().gain[0] == Approx(1.2));
  RunningCorrection warm(config, tie_model(), 0);
  probe(warm, 60s, 5.0, 1.0, {1.2, 1.0});
  CHECK(warm.report().gain[0] == Approx((1.2 * 20.0 - 2.0) / 18.0));
  CHECK(model_um(5.0, 1.0) + warm.correction_um() != Approx(1.2 * 20.0 - 2.0));
}

TEST_CASE("phase 2 begins when the displacement has turned, and then only the tie's gain changes",
          "[correction]") {
  RunningCorrection correction(config_of(CorrectionForm::two_phase), tie_model(), 0);
  probe(correction, 60s, 10.0, 0.0, {1.1, 0.8});
  CHECK(correction.report().phase == 1);
  probe(correction, 120s, 10.0, 1.0, {1.1, 0.8});  // back by 1.6 um: not yet beyond noise
  CHECK(correction.report().phase == 1);
  const double first = correction.report().gain[0];
  probe(correction, 180s, 10.0, 6.0, {1.1, 0.8});
  CHECK(correction.report().phase == 2);
  CHECK(correction.report().gain[0] == first);
  CHECK(model_um(10.0, 6.0) + correction.correction_um() == Approx(44.0 - 9.6));
}

TEST_CASE("a small contribution does not determine its gain", "[correction]") {
  RunningCorrection correction(config_of(CorrectionForm::two_phase), tie_model(), 0);
  probe(correction, 60s, 0.1, 0.0, {1.0, 1.0}, 2.0);
  CHECK(correction.report().gain[0] == 1.0);
  CHECK(correction.report().refused == 1);
  CHECK(correction.correction_um() == 0.0);
}

TEST_CASE("the recursive form finds gains in noise and gives their standard deviation",
          "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::recursive);
  config.gain_drift_per_sqrt_h = 0.02;
  RunningCorrection correction(config, tie_model(), 0);
  std::mt19937_64 engine(3);
  std::normal_distribution<double> noise(0.0, 0.5);
  nanoseconds now{};
  for (int i = 0; i < 60; ++i) {
    now += 300s;
    probe(correction, now, 8.0 + 3.0 * std::sin(0.3 * i), 6.0 + 3.0 * std::cos(0.11 * i),
          {1.25, 0.7}, noise(engine));
  }
  const CorrectionReport report = correction.report();
  CHECK(std::abs(report.gain[0] - 1.25) < 0.05);
  CHECK(std::abs(report.gain[1] - 0.7) < 0.1);
  CHECK(report.sd_um < 1.0);
  CHECK(report.gain_sd[0] < 0.05);
}

TEST_CASE("a probing is requested when the estimate has become too uncertain", "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::recursive);
  RunningCorrection correction(config, tie_model(), 0);
  const std::vector<double> cold{0.0, 0.0};
  correction.step(60s, cold, true);
  CHECK_FALSE(correction.report().probing_wanted);  // nothing is warm: no gain matters
  const std::vector<double> warm{10.0, 5.0};
  correction.step(120s, warm, true);
  CHECK(correction.report().probing_wanted);
  probe(correction, 120s, 10.0, 5.0, {1.0, 1.0});
  CHECK_FALSE(correction.report().probing_wanted);
  correction.step(120s + 3h, warm, true);
  CHECK(correction.report().probing_wanted);
}

TEST_CASE("one outlier is refused; a second one that agrees is accepted", "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::recursive);
  RunningCorrection correction(config, tie_model(), 0);
  nanoseconds now{};
  for (int i = 0; i < 5; ++i) probe(correction, now += 60s, 5.0, 2.0, {1.0, 1.0});
  const double before = correction.correction_um();
  probe(correction, now += 60s, 5.0, 2.0, {1.0, 1.0}, 30.0);
  CHECK(correction.correction_um() == before);
  CHECK(correction.report().refused == 1);
  probe(correction, now += 60s, 5.0, 2.0, {1.0, 1.0}, 30.0);
  CHECK(correction.correction_um() > before + 1.0);
}

TEST_CASE("no probing moves the estimate beyond its step or a gain out of its range",
          "[correction][property]") {
  const auto form = GENERATE(CorrectionForm::two_phase, CorrectionForm::recursive);
  const auto seed = GENERATE(range(0u, 50u));
  CorrectionConfig config = config_of(form);
  config.step_um_max = 2.5;
  config.bias_drift_um_per_sqrt_h = seed % 2 == 0 ? 0.0 : 3.0;
  RunningCorrection correction(config, tie_model(), 0);
  std::mt19937_64 engine(seed);
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  nanoseconds now{};
  for (int i = 0; i < 200; ++i) {
    now += std::chrono::seconds(1 + i % 900);
    const std::vector<double> rise{20.0 * any(engine), 20.0 * any(engine)};
    correction.step(now, rise, true);
    const double before = correction.correction_um();
    const double values[]{200.0 * any(engine), not_a_number, 1e300, INFINITY};
    correction.measured({values[i % 7 == 0 ? 1 + i % 3 : 0], model_um(rise[0], rise[1])});
    correction.step(now, rise, true);
    CHECK(std::abs(correction.correction_um() - before) <= 2.5 + 1e-9);
    for (std::size_t g = 0; g < 2; ++g) {
      CHECK(correction.report().gain[g] >= config.gain_min);
      CHECK(correction.report().gain[g] <= config.gain_max);
    }
  }
}

TEST_CASE("values learned while cutting are used after the cut", "[correction]") {
  RunningCorrection correction(config_of(CorrectionForm::recursive), tie_model(), 0);
  const std::vector<double> rise{5.0, 1.0};
  correction.step(1s, rise, false);
  correction.measured({30.0, 18.0});
  correction.step(2s, rise, false);
  CHECK(correction.correction_um() == 0.0);
  correction.step(3s, rise, true);
  CHECK(correction.correction_um() > 1.0);
}

TEST_CASE("gains survive a restart by name; invalid values are ignored", "[correction]") {
  RunningCorrection correction(config_of(CorrectionForm::recursive), tie_model(), 0);
  probe(correction, 60s, 5.0, 1.0, {1.3, 1.0});
  std::map<std::string, double> kept;
  for (const auto& [key, value] : RunningCorrection::persistent(correction.report()))
    kept[std::string("z.").append(key)] = value;
  RunningCorrection next(config_of(CorrectionForm::recursive), tie_model(), 0);
  next.restore(kept, "z");
  CHECK(next.report().gain[0] == correction.report().gain[0]);
  CHECK(next.report().gain_sd[0] == correction.report().gain_sd[0]);
  RunningCorrection other(config_of(CorrectionForm::recursive), tie_model(), 0);
  other.restore({{"z.gain1", 1e9}, {"z.gain2", not_a_number}, {"x.gain1", 2.0}}, "z");
  CHECK(other.report().gain[0] == 1.0);
  CHECK(other.report().gain[1] == 1.0);
}

TEST_CASE("a restart during a cut does not apply values learned in it", "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::recursive);
  config.bias_drift_um_per_sqrt_h = 5.0;
  RunningCorrection correction(config, tie_model(), 0);
  const std::vector<double> rise{5.0, 1.0};
  correction.step(60s, rise, true);
  correction.measured({30.0, model_um(5.0, 1.0)});
  correction.step(61s, rise, false);
  CHECK(correction.correction_um() == 0.0);
  std::map<std::string, double> kept;
  for (const auto& [key, value] : RunningCorrection::persistent(correction.report()))
    kept[std::string("z.").append(key)] = value;
  RunningCorrection next(config, tie_model(), 0);
  next.restore(kept, "z");
  next.step(1s, rise, false);
  CHECK(next.correction_um() == 0.0);
  next.step(2s, rise, true);
  correction.step(62s, rise, true);
  CHECK(next.correction_um() == correction.correction_um());
  CHECK(next.correction_um() != 0.0);
}

TEST_CASE("a bias learned in several steps survives a restart", "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::recursive);
  config.step_um_max = 2.0;
  RunningCorrection correction(config, tie_model(), 0);
  correction.restore({{"z.bias_um", 7.5}}, "z");
  CHECK(correction.report().bias_um == 7.5);
  correction.restore({{"z.bias_um", 1e9}}, "z");
  CHECK(correction.report().bias_um == 7.5);
}

TEST_CASE("a group that names no input of the model is refused", "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::recursive);
  config.groups[1] = {"t9_degC"};
  CHECK_THROWS_AS(RunningCorrection(config, tie_model(), 0), InvalidValue);
  config.groups[1] = {"t1_degC"};
  CHECK_THROWS_AS(RunningCorrection(config, tie_model(), 0), InvalidValue);
}

TEST_CASE("a probing of the remaining displacement corrects the estimate, at the slew of the axis",
          "[correction][estimator]") {
  EstimatorConfig config = small_config();
  config.correction = config_of(CorrectionForm::recursive);
  config.correction.gain_sd = 3.0;  // so uncertain that the probing is accepted at once
  Machine machine(config);
  machine.step({20.0, 30.0});
  machine.steps(20, {22.0, 31.0});  // 11 um
  CHECK(machine.offset_um() == Approx(-11.0));
  machine.estimator.apply(
      {CommandKind::measured, 0, 4.0});  // 4 um remain: the displacement is 15 um
  machine.step({22.0, 31.0});
  CHECK(machine.offset_um() > -21.0 - 1e-9);
  machine.steps(20, {22.0, 31.0});
  CHECK(machine.offset_um() == Approx(-15.0).margin(0.3));
  CHECK(machine.report().axes[0].correction.taken == 1);
}

TEST_CASE("the same history of probings and readings gives the same bits", "[correction][replay]") {
  EstimatorConfig config = small_config();
  config.correction = config_of(CorrectionForm::recursive);
  Machine machine(config);
  machine.step({20.0, 30.0});
  machine.steps(20, {24.0, 32.0});
  machine.estimator.apply({CommandKind::measured, 0, 3.0});
  machine.steps(3, {24.5, 32.0});
  std::vector<std::byte> state(machine.estimator.state_size_bytes());
  machine.estimator.save_state(state);
  Machine twin(config);
  twin.estimator.load_state(state);
  twin.now = machine.now;
  twin.controller = machine.controller;
  for (int i = 0; i < 50; ++i) {
    if (i % 10 == 3) {
      machine.estimator.apply({CommandKind::measured, 0, 0.1 * i});
      twin.estimator.apply({CommandKind::measured, 0, 0.1 * i});
    }
    machine.step({24.0 + 0.1 * i, 32.0});
    twin.step({24.0 + 0.1 * i, 32.0});
    CHECK(machine.offset_um() == twin.offset_um());
  }
}

TEST_CASE("a reload keeps learned values", "[correction][estimator]") {
  EstimatorConfig config = small_config();
  config.correction = config_of(CorrectionForm::recursive);
  Machine machine(config);
  machine.step({20.0, 30.0});
  machine.steps(20, {24.0, 32.0});
  machine.estimator.apply({CommandKind::measured, 0, 3.0});
  machine.steps(20, {24.0, 32.0});
  const double before = machine.offset_um();
  const double gain = machine.report().axes[0].correction.gain[0];
  CHECK(gain > 1.0);
  reload(machine, config, small_model());
  machine.steps(20, {24.0, 32.0});
  CHECK(machine.report().axes[0].correction.gain[0] == gain);
  CHECK(machine.offset_um() == Approx(before));
}

TEST_CASE("R1 by eq. 31 is the measurement over the heat source's share alone", "[correction]") {
  CorrectionConfig config = config_of(CorrectionForm::two_phase);
  config.first_gain = FirstGain::eq_31;
  RunningCorrection correction(config, tie_model(), 0);
  // By hand: shares 4*5 = 20 and -2*1 = -2, measured 1.2*20 - 2 = 22: R = 22/20, not 22/18.
  probe(correction, 60s, 5.0, 1.0, {1.2, 1.0});
  CHECK(correction.report().gain[0] == Approx(1.1));
}

TEST_CASE("the earlier form Ki (A - B) - Ci keeps its gains and learns Ci", "[correction]") {
  RunningCorrection correction(config_of(CorrectionForm::constant), tie_model(), 0);
  // By hand: model 20 - 2 = 18, measured 15: Ci = 3 in any later state.
  correction.step(60s, std::vector{5.0, 1.0}, true);
  correction.measured({15.0, 18.0});
  correction.step(61s, std::vector{2.0, 0.5}, true);
  CHECK(correction.correction_um() == Approx(-3.0));
  CHECK(correction.report().gain[0] == 1.0);
  CHECK(correction.report().gain[1] == 1.0);
  correction.measured({7.0, 7.0});
  correction.step(62s, std::vector{2.0, 0.5}, true);
  CHECK(correction.correction_um() == Approx(0.0).margin(1e-12));
}

TEST_CASE("a coarse measurement changes less than a fine one", "[correction]") {
  const auto learned = [](double sd_um) {
    RunningCorrection correction(config_of(CorrectionForm::recursive), tie_model(), 0);
    correction.step(60s, std::vector{5.0, 0.0}, true);
    correction.measured({22.0, 20.0, sd_um});
    return correction.report().gain[0];
  };
  // By hand: P h^2 = 0.09 * 400 = 36; share 36 / (36 + sd^2) of 2 um, as a gain 2 / 20.
  CHECK(learned(1.0) == Approx(1.0 + 0.1 * 36.0 / 37.0));
  CHECK(learned(6.0) == Approx(1.0 + 0.1 * 36.0 / 72.0));
  CHECK(learned(0.0) == learned(1.0));  // as configured
}

TEST_CASE("a part measured later corrects by the earlier state of the machine", "[correction]") {
  RunningCorrection correction(config_of(CorrectionForm::recursive), tie_model(), 0);
  correction.step(60s, std::vector{5.0, 0.0}, true);
  const auto then = correction.contributions_um();
  correction.step(600s, std::vector{0.0, 5.0}, true);
  correction.measured({22.0, 20.0, 1.0, then});
  CHECK(correction.report().gain[0] == Approx(1.0 + 0.1 * 36.0 / 37.0));
  CHECK(correction.report().gain[1] == 1.0);
}
