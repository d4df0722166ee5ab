#include <cmath>
#include <cstring>
#include <vector>

#include <catch2/catch.hpp>

#include "estimator/checks.hpp"
#include "estimator/learning/probings.hpp"
#include "estimator/model/displacement_model.hpp"
#include "small_machine.hpp"

using namespace thermocomp;
using namespace std::chrono_literals;

namespace {

using Vector = std::vector<double>;

/// Made at 20 +- 1 degC with rises of 0 +- 2 K.
ThermalModel made_model() {
  ThermalModel model = small_model();
  MadeFrom made_from;
  made_from.runs = {"a.csv", "b.csv", "c.csv", "d.csv"};
  made_from.columns = {"t1_degC"};
  made_from.low = {18.0};
  made_from.high = {24.0};
  made_from.taus_s = {0.0};
  made_from.mean = {20.0, 0.0};
  made_from.covariance = {{1.0, 0.0}, {0.0, 4.0}};
  made_from.distance_max = 2.0;
  made_from.outputs["z_um"] = {1.0, 0.1, 600.0, 1.5, 10.0, 8.0};
  model.made_from = made_from;
  return model;
}

EstimatorConfig config_with(OutsidePolicy policy) {
  EstimatorConfig config = small_config();
  config.compensation.outside_domain = policy;
  config.axes[0].limiter = {200.0, 2.0};
  for (SensorConfig& sensor : config.sensors) sensor.screening.rate_K_per_s_max = 100.0;
  return config;
}

}  // namespace

TEST_CASE("the distance uses the covariance: a feature at its own standard deviation gives 1",
          "[domain]") {
  ModelDomain domain(made_model());
  domain.step(1s, Vector{21.0, 0.0}, Vector{19.0, 0.0}, {});
  CHECK(domain.distance() == Approx(std::sqrt((1.0 + 1.0) / 2.0)));
  CHECK_FALSE(domain.outside());
  CHECK(domain.used_share() == 1.0);
  CHECK(domain.sd_um(0) == Approx(std::hypot(1.5, 2.5 / std::sqrt(2.0))));
  domain.step(3s, Vector{26.0, 0.0}, Vector{20.0, 0.0}, {});
  const double squared = (36.0 + 9.0) / 2.0;
  CHECK(domain.distance() == Approx(std::sqrt(squared)));
  CHECK(domain.outside());
  CHECK(domain.used_share() == Approx(4.0 / squared));
  CHECK(domain.sd_um(0) == Approx(std::hypot(1.5, 2.5)));  // its runs count as one
}

TEST_CASE("a signal beyond a tenth of its recorded range is outside, as are its low passes",
          "[domain]") {
  ThermalModel model = made_model();
  TermSpec& term = model.terms.emplace_back();
  term.kind = "signal_hinge";
  term.subject = "spindle_rpm";
  term.shared["above"] = 1000.0;
  term.per_output["gain_um_per_unit"]["z_um"] = 1e-3;
  MadeFrom& made_from = *model.made_from;
  made_from.columns.emplace_back("spindle_rpm");
  made_from.low.push_back(0.0);
  made_from.high.push_back(4000.0);
  made_from.taus_s = {0.0, 600.0};
  made_from.mean = {20.0, 0.0, 2000.0, 0.0, 2000.0};
  made_from.covariance.assign(5, Vector(5, 0.0));
  for (std::size_t i = 0; i < 5; ++i) made_from.covariance[i][i] = i % 2 == 0 && i > 0 ? 9e6 : 4.0;
  ModelDomain domain(model);
  const auto outside_at = [&](std::chrono::seconds now, double rpm) {
    domain.step(now, Vector{20.0, 0.0}, Vector{20.0, 0.0}, Vector{rpm});
    return domain.outside();
  };
  CHECK_FALSE(outside_at(1s, 4300.0));
  CHECK(outside_at(10s, 4500.0));
  CHECK(domain.used_share() == Approx(1.0 / (1.025 * 1.025)));
  CHECK(domain.furthest_column() == 1);
  CHECK_FALSE(outside_at(20s, 3000.0));
  for (int i = 0; i < 200; ++i) static_cast<void>(outside_at(30s + i * 10s, 5000.0));
  CHECK(outside_at(2100s, 3000.0));  // the machine still has the heat
}

TEST_CASE("a cold morning is outside although the machine has not moved", "[domain]") {
  ModelDomain domain(made_model());
  domain.step(1s, Vector{12.0, 12.0}, Vector{12.0, 12.0}, {});
  CHECK(domain.outside());
}

TEST_CASE("a domain with a matrix that is no covariance is refused", "[domain]") {
  ThermalModel model = made_model();
  model.made_from->covariance = {{1.0, 3.0}, {3.0, 1.0}};
  CHECK_THROWS_AS(ModelDomain(model), InvalidValue);
  model = made_model();
  model.made_from->columns = {"t9_degC"};
  CHECK_THROWS_AS(ModelDomain(model), InvalidValue);
}

TEST_CASE("outside its domain the offset follows, stays, or shrinks, as configured", "[domain]") {
  const auto policy = GENERATE(OutsidePolicy::warn, OutsidePolicy::hold, OutsidePolicy::shrink);
  Machine machine(config_with(policy), made_model());
  for (int i = 0; i < 60; ++i) machine.step({20.0, 20.0});
  double last_um = machine.report().axes[0].offset_um;
  const auto step_all = [&](double temp_degC, int steps) {
    for (int i = 0; i < steps; ++i) {
      machine.step({temp_degC, 20.0});
      const double now_um = machine.report().axes[0].offset_um;
      CHECK(std::abs(now_um - last_um) <= 2.0 + 1e-9);  // never faster than the limiter
      last_um = now_um;
    }
  };
  step_all(22.0, 60);
  const double inside_um = machine.report().axes[0].offset_um;
  CHECK(inside_um == Approx(-10.0));
  CHECK_FALSE(machine.reports(Reason::outside_domain));
  step_all(32.0, 200);
  CHECK(machine.reports(Reason::outside_domain));
  CHECK(machine.report().domain.outside);
  if (policy == OutsidePolicy::warn) CHECK(last_um == Approx(-60.0));
  if (policy == OutsidePolicy::hold) CHECK(last_um > -30.0);
  if (policy == OutsidePolicy::shrink) {
    CHECK(last_um < 0.0);
    CHECK(last_um > -6.0);
  }
  CHECK(machine.report().mode == Mode::compensating);
  step_all(22.0, 200);  // it returns, and so does the offset
  CHECK(last_um == Approx(-10.0));
  CHECK_FALSE(machine.reports(Reason::outside_domain));
  CHECK(machine.report().domain.outside_share_24h == Approx(200.0 / 519.0).margin(0.02));
}

TEST_CASE("with hold, an offset does not move while the machine is outside", "[domain]") {
  Machine machine(config_with(OutsidePolicy::hold), made_model());
  for (int i = 0; i < 60; ++i) machine.step({22.0, 20.0});
  for (int i = 0; i < 3; ++i) machine.step({40.0, 20.0});
  const double held_um = machine.report().axes[0].offset_um;
  for (int i = 0; i < 100; ++i) machine.step({40.0, 20.0});
  CHECK(machine.report().axes[0].offset_um == held_um);
}

TEST_CASE("the domain's state is saved and loaded bit for bit", "[domain]") {
  Machine machine(config_with(OutsidePolicy::shrink), made_model());
  for (int i = 0; i < 40; ++i) machine.step({20.0 + 0.3 * i, 20.0});
  std::vector<std::byte> state(machine.estimator.state_size_bytes());
  machine.estimator.save_state(state);
  Estimator other(config_with(OutsidePolicy::shrink), made_model());
  other.load_state(state);
  std::vector<std::byte> again(other.state_size_bytes());
  other.save_state(again);
  CHECK(std::memcmp(state.data(), again.data(), state.size()) == 0);
}

TEST_CASE("the share of the last day drops older hours", "[domain]") {
  OutsideShare share;
  for (int minute = 0; minute < 24 * 60; ++minute) share.step(minute * 60s, true);
  CHECK(share.share() == 1.0);
  for (int minute = 24 * 60; minute < 49 * 60; ++minute) share.step(minute * 60s, false);
  CHECK(share.share() == Approx(0.0).margin(0.05));
  share.step(100h, true);  // a gap is not observed
  CHECK(share.share() == Approx(0.0).margin(0.05));
}

TEST_CASE("probings measure the model's error", "[domain]") {
  ProbedError error;
  CHECK(std::isnan(error.rms_um()));
  error.take(3.0);
  error.take(-4.0);
  error.take(not_a_number);
  CHECK(error.rms_um() == Approx(std::sqrt(12.5)));
}
